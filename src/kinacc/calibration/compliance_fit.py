"""How joint compliance under gravity is fitted: with the DH parameters, to the measurements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from kinacc.calibration import dh_fit, tables
from kinacc.calibration.constrained import ConstrainedFrames
from kinacc.calibration.dh_estimator import DHEstimator
from kinacc.calibration.dh_fit import Unknowns
from kinacc.calibration.frames import ANGLE_UNIT_RAD, FrameCoordinates, Frames
from kinacc.calibration.models import Common, Estimator, Fit
from kinacc.calibration.observations import Observations
from kinacc.calibration.robust import Weights
from kinacc.calibration.solve import Solution
from kinacc.calibration.system import FlangeModel
from kinacc.calibration.uncertainty import Uncertainty, scale_of
from kinacc.geometry import Pose
from kinacc.kinematics import compliance
from kinacc.kinematics.compliance import ComplianceModel
from kinacc.kinematics.model import JointState
from kinacc.kinematics.robot import Robot
from kinacc.tables.columns import Columns

_NO_MOMENT = 1e-6  # N m, or mm of lever: far above rounding, far below what bends a joint


@dataclass(frozen=True)
class ComplianceFit:
    """Fitted ``model`` and ``frames``; ``std`` (P,) as its parameters, NaN undetermined.

    ``free`` (P,) marks those that took part; ``solution`` has the figures of the fit, frame
    coordinates (``coordinates``) first. ``weights`` of the rows, where the loss had some.
    """

    model: ComplianceModel
    frames: Frames
    std: np.ndarray
    free: np.ndarray
    solution: Solution
    coordinates: FrameCoordinates | ConstrainedFrames
    weights: Weights | None = None


@dataclass(frozen=True)
class ComplianceEstimator(Estimator):
    """Settings of ``calibration.compliance``, beside those of the DH parameters.

    ``stiff``: the arm before anything is fitted; coefficients that are to be fitted are zero.
    """

    dh: DHEstimator
    stiff: ComplianceModel

    kind: ClassVar[str] = "compliance"
    name: ClassVar[str] = "compliance fit"
    fix: ClassVar[str] = dh_fit.DH_FIX

    @classmethod
    def of(cls, calibration: Mapping, arm: Robot, every: Observations) -> Self:
        """By the ``calibration`` settings; what loads ``every`` row says which terms there are."""
        section = calibration["compliance"]
        gravity = np.array(section["gravity"], dtype=float)
        payload = _body(section["payload"])
        links = np.full((arm.dh.joints, 4), np.nan)
        if section["links"]:
            links = np.array([_body(each) for each in section["links"]])
        coefficients = np.full((arm.dh.joints, 2), np.nan)
        bent = np.array(section["joints"]) - 1
        if not section["links"]:
            coefficients[bent, 1] = 0.0
        if section["links"] or _load_changes(every, payload):
            coefficients[bent, 0] = 0.0
        model = ComplianceModel(
            arm.dh,
            coefficients[:, 0],
            coefficients[:, 1],
            gravity / np.linalg.norm(gravity),
            links,
            payload,
        )
        return cls(Common.of(calibration, arm), DHEstimator.of(calibration, arm, every), model)

    @classmethod
    def contradictions(
        cls, calibration: Mapping, arm: Robot
    ) -> Iterator[tuple[tuple[str, ...], str, str]]:
        """Joints the arm has not or that slide, links of another arm, no direction of gravity."""
        section, joints = calibration["compliance"], arm.dh.joints
        beyond = [each for each in section["joints"] if each > joints]
        if beyond:
            what = f"{arm.name} has no joint {', '.join(map(str, beyond))}"
            yield ("joints",), what, f"1 to {joints}"
        sliding = [each for each in section["joints"] if each not in beyond]
        sliding = [each for each in sliding if arm.dh.prismatic[each - 1]]
        if sliding:
            what = f"joint {', '.join(map(str, sliding))} of {arm.name} slides"
            yield ("joints",), what, "joints that turn"
        if section["links"] and len(section["links"]) != joints:
            what = f"{len(section['links'])} links for the {joints} joints of {arm.name}"
            yield ("links",), what, "one for each joint, or none"
        if not np.any(section["gravity"]):
            yield ("gravity",), "has no direction", "a vector of any length above 0"

    @property
    def size(self) -> int:
        """Number of free parameters."""
        return self.dh.size + int(np.isfinite(self.stiff.coefficients).sum())

    def fit(
        self, observations: Observations, others: Mapping[str, Fit], near: Fit | None = None
    ) -> ComplianceFit:
        """The bent arm closest to the measurements, whatever the DH model follows."""
        arm = self.dh.arm
        nominal = replace(self.stiff, dh=arm.nominal)
        held, names = compliance.to_vector(nominal), nominal.parameter_names
        free = np.concatenate([arm.free.ravel(), np.ones(len(names) - arm.free.size, bool)])

        def model(x: np.ndarray) -> ComplianceModel:
            vector = held.copy()
            vector[free] = x
            return compliance.with_vector(nominal, vector)

        def linearised(x: np.ndarray, at: JointState) -> tuple[Pose, np.ndarray]:
            bent = model(x)
            return bent.pose(at), bent.parameter_jacobian(at).transpose(2, 1, 0)[free]

        flange = FlangeModel(
            int(free.sum()),
            lambda x, at: model(x).pose(at),
            linearised,
        )
        more = len(names) - arm.free.size
        unknowns = Unknowns(
            self.name,
            flange,
            start=held[free],
            nominal=held[free],
            prior_std=np.concatenate([arm.std[arm.free], np.full(more, np.inf)]),
            scale=np.concatenate([dh_fit.scales(arm.free), _scales(nominal, observations)]),
        )
        frames, terms = self.common.frames(observations)
        coords, solution, weights = dh_fit.solved(
            observations,
            unknowns,
            arm.nominal,
            rotation_weight_mm_per_rad=self.common.rotation_weight_mm_per_rad,
            threshold=self.dh.threshold,
            frames=frames,
            frame_terms=terms,
            loss=self.dh.loss,
        )
        std = np.full(held.size, np.nan)
        std[free] = solution.std[coords.size :]
        return ComplianceFit(
            model(solution.x[coords.size :]),
            coords.frames(solution.x[: coords.size]),
            std,
            free,
            solution,
            coords,
            weights,
        )

    def tables(
        self, fitted: ComplianceFit, known: Uncertainty, observations: Observations
    ) -> dict[str, Columns]:
        """How the fit went."""
        return {"compliance_fit": tables.fit_columns("compliance_fit", fitted, known)}


def _body(section: Mapping) -> np.ndarray:
    """Mass in kg and centre in mm (4,)."""
    return np.array([section["mass_kg"], *section["centre_mm"]], dtype=float)


def _load_changes(every: Observations, payload: np.ndarray) -> bool:
    """Whether rows carry different payloads, where those that say nothing carry ``payload``."""
    carried = np.where(np.isnan(every.payload), payload, every.payload)
    loads = carried[:, :1] * np.column_stack([np.ones(len(carried)), carried[:, 1:]])
    return bool(np.ptp(loads, axis=0).any()) if len(loads) else False


def _scales(nominal: ComplianceModel, observations: Observations) -> np.ndarray:
    """By each coefficient what turns its joint by one mrad, rms over the observations."""
    moments = nominal.moments(observations.at)
    rms = np.sqrt(np.mean(moments**2, axis=0))
    names = nominal.parameter_names[len(nominal.dh.parameter_names) :]
    plain = np.array([scale_of(name) for name in names])
    own = rms[np.isfinite(nominal.coefficients)]
    return np.divide(ANGLE_UNIT_RAD, own, out=plain, where=own > _NO_MOMENT)
