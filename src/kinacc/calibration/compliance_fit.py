"""How joint compliance under gravity is fitted: with the DH parameters, to the measurements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from kinacc.calibration.dh_estimator import DHEstimator
from kinacc.calibration.fitting import Fit, ModelFit, scales
from kinacc.calibration.frames import ANGLE_UNIT_RAD
from kinacc.calibration.models import Common, Estimator
from kinacc.calibration.observations import Observations
from kinacc.config.records import Settings
from kinacc.kinematics.compliance import ComplianceModel
from kinacc.kinematics.robot import Robot

_NO_MOMENT = 1e-6  # N m, or mm of lever: far above rounding, far below what bends a joint


@dataclass(frozen=True)
class ComplianceEstimator(Estimator):
    """Settings of ``calibration.compliance``, beside those of the DH parameters.

    ``stiff``: the arm before anything is fitted; coefficients that are to be fitted are zero.
    """

    dh: DHEstimator
    stiff: ComplianceModel

    kind: ClassVar[str] = "compliance"

    @classmethod
    def of(cls, calibration: Settings, arm: Robot, every: Observations) -> Self:
        """By the ``calibration`` settings; what loads ``every`` row says which terms there are."""
        section = calibration["compliance"]
        gravity = np.array(section["gravity"], dtype=float)
        payload = _body(section["payload"])
        links = np.full((arm.dh.joints, 4), np.nan)
        if section["links"]:
            links = np.array([_body(link) for link in section["links"]])
        coefficients = np.full((arm.dh.joints, 2), np.nan)
        bent = np.array(section["joints"]) - 1
        if not section["links"]:
            coefficients[bent, 1] = 0.0
        if section["links"] or _load_changes(every, payload):
            coefficients[bent, 0] = 0.0
        model = ComplianceModel(
            arm.dh, coefficients, gravity / np.linalg.norm(gravity), links, payload
        )
        return cls(Common.of(calibration, arm), DHEstimator.of(calibration, arm, every), model)

    @classmethod
    def contradictions(
        cls, calibration: Settings, arm: Robot
    ) -> Iterator[tuple[tuple[str, ...], str, str]]:
        """Joints the arm has not or that slide, links of another arm, no direction of gravity."""
        section, joints = calibration["compliance"], arm.dh.joints
        turning = (1 + np.flatnonzero(~arm.dh.prismatic)).tolist()
        for joint in {*section["joints"]} - {*turning}:
            what = f"{arm.name} has no joint {joint} that turns"
            yield ("joints",), what, ", ".join(map(str, turning))
        if section["links"] and len(section["links"]) != joints:
            what = f"{len(section['links'])} links for the {joints} joints of {arm.name}"
            yield ("links",), what, "one for each joint, or none"
        if not np.any(section["gravity"]):
            yield ("gravity",), "has no direction", "a vector of any length above 0"

    def fit(self, observations: Observations, others: Mapping[str, Fit]) -> ModelFit:
        """The bent arm closest to the measurements, whatever the DH model follows."""
        nominal = replace(self.stiff, dh=self.dh.nominal)
        more = len(nominal.names) - self.dh.free.size
        return self.common.fit(
            observations,
            nominal,
            free=np.concatenate([self.dh.free.ravel(), np.ones(more, dtype=bool)]),
            std=np.concatenate([self.dh.std.ravel(), np.full(more, np.inf)]),
            scale=_scales(nominal, observations),
            threshold=self.dh.threshold,
            loss=self.dh.loss,
            name="compliance fit",
        )


def _body(section: Settings) -> np.ndarray:
    """Mass in kg and centre in mm (4,)."""
    return np.array([section["mass_kg"], *section["centre_mm"]], dtype=float)


def _load_changes(every: Observations, payload: np.ndarray) -> bool:
    """Whether rows carry different payloads, where those that say nothing carry ``payload``."""
    carried = np.where(np.isnan(every.payload), payload, every.payload)
    loads = carried[:, :1] * np.column_stack([np.ones(len(carried)), carried[:, 1:]])
    return len(np.unique(loads, axis=0)) > 1


def _scales(nominal: ComplianceModel, observations: Observations) -> np.ndarray:
    """By each parameter what moves a pose as one mm; coefficients turn a joint by one mrad, rms."""
    moments = nominal.moments(observations.at)
    rms = np.sqrt(np.mean(moments**2, axis=0))[np.isfinite(nominal.coefficients)]
    plain = scales(nominal)
    bending = plain[len(plain) - len(rms) :]
    np.divide(ANGLE_UNIT_RAD, rms, out=bending, where=rms > _NO_MOMENT)
    return plain
