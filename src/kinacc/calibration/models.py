"""The models of an arm fitted to observations by stated options, and how they are compared."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinacc.artifacts import allowed
from kinacc.calibration import dh_fit, selection, vec_fit
from kinacc.calibration.constrained import FrameTerms
from kinacc.calibration.constraints import ArmTerms, arm_terms, frame_terms, free_parameters
from kinacc.calibration.dh_fit import DHFit
from kinacc.calibration.frames import BASE, Frames, coordinates, known
from kinacc.calibration.observations import Observations, full_poses
from kinacc.calibration.selection import Choice, Grid
from kinacc.calibration.solve import Spectrum
from kinacc.calibration.vec_fit import Prior, VECFit
from kinacc.config.parameter_rules import Rule
from kinacc.geometry import IDENTITY, Pose, compose
from kinacc.kinematics import vec
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import ErrorModel
from kinacc.kinematics.tables import NOMINAL
from kinacc.kinematics.vec import VECModel

MEASURED = "measured"


class Fit(NamedTuple):
    """A model with the base and targets it was fitted with."""

    model: ErrorModel
    frames: Frames


class Comparison(NamedTuple):
    """Whose error is meant: that of ``reference``, a model or the measurement, minus ``model``."""

    reference: str
    model: str

    @property
    def name(self) -> str:
        """As artefacts name it."""
        return f"{self.model}_vs_{self.reference}"


COMPARISONS = tuple(Comparison(*pair) for pair in allowed.COMPARED)


@dataclass(frozen=True)
class Options:
    """How models are fitted; see the ``calibration`` section of the configuration.

    What is None is not stated: a fit that asks for it has not been given its section.
    ``frames_estimated``: base and tool are unknown; else they are ``base`` and ``tool``, the
    robot's own. ``frame_rules``: what is known of them beforehand, by DH and nominal fit; the VEC
    model holds a base or target they leave nothing free of. ``dh_to_vec``: the DH model follows the
    VEC at the measured joints instead of the measurements. ``grid``: orders and priors to choose
    from; None where ``order`` and ``prior`` are stated. ``hayati_instead``: beta in place of d at
    ``hayati_joints``, else beside it. ``arm_rules``: parameters of the DH fit that are fixed or
    known beforehand.
    """

    rotation_weight_mm_per_rad: float
    frames_estimated: bool
    order: int | None = None
    prior: Prior | None = None
    grid: Grid | None = None
    travel_direction: bool | None = None
    dh_to_vec: bool = True
    hayati_joints: tuple[int, ...] = ()
    hayati_instead: bool = False
    arm_rules: tuple[Rule, ...] = ()
    frame_rules: tuple[Rule, ...] = ()
    loss: str | None = None
    threshold: float | None = None
    base: Pose = IDENTITY
    tool: Pose = IDENTITY

    def stated(self, observations: Observations) -> Frames:
        """Every base and every target where the robot's description has them."""
        return known(
            self.base,
            self.tool,
            sessions=len(observations.session_names),
            targets=len(observations.target_names),
        )

    def arm(self, nominal: DHModel) -> ArmTerms:
        """What the DH fit takes for granted of the arm."""
        free = free_parameters(nominal.joints, self.hayati_joints, self.hayati_instead)
        return arm_terms(nominal, free, self.arm_rules)

    def frames(self, observations: Observations) -> FrameTerms:
        """What the fits take for granted of base and targets, where these are estimated."""
        return frame_terms(observations, self.stated(observations), self.frame_rules)

    def frames_free(self, observations: Observations) -> tuple[bool, bool]:
        """Whether base and targets are estimated with the VEC model."""
        if not self.frames_estimated:
            return False, False
        terms = self.frames(observations)
        count = len(observations.session_names)
        bases = {BASE, *(f"{BASE}{number}" for number in range(2, count + 1))}
        of_base = np.array([name.partition(".")[0] in bases for name in terms.names])
        return bool(terms.free[of_base].any()), bool(terms.free[~of_base].any())


def fit_all(
    observations: Observations,
    nominal: DHModel,
    joint_range_rad: tuple[np.ndarray, np.ndarray],
    options: Options,
    near: Mapping[str, Fit] | None = None,
) -> dict[str, Fit]:
    """Every model by name, fitted to ``observations``; starts may be those ``near``.

    Raises FitError.
    """
    start = near[VECModel.kind].model if near else None
    # High orders are worth it; the end is the same to a few nm, which the paper's tables keep.
    worth = options.grid is not None and start is not None and start.order == options.order
    volumetric = fit_vec(observations, nominal, joint_range_rad, options, start if worth else None)
    by_vec = Fit(volumetric.model, volumetric.frames)
    best = fit_dh(observations, nominal, options, by_vec)
    plain = fit_nominal(observations, nominal, options)
    return {
        VECModel.kind: by_vec,
        DHModel.kind: Fit(best.model, best.frames),
        NOMINAL: Fit(nominal, plain.frames),
    }


def fit_vec(
    observations: Observations,
    nominal: DHModel,
    joint_range_rad: tuple[np.ndarray, np.ndarray],
    options: Options,
    start: VECModel | None = None,
) -> VECFit:
    """VEC model on the nominal arm over ``joint_range_rad`` (k,), (k,). Raises FitError.

    ``start``: a model of the same order near the solution, which saves steps and changes nothing.
    """
    frames = options.stated(observations)
    if options.frames_estimated:
        frames = fit_nominal(observations, nominal, options).frames
    return vec_fit.fit(
        _with_wanted_directions(observations, options),
        vec.without_errors(nominal, *joint_range_rad, options.order),
        prior=options.prior,
        rotation_weight_mm_per_rad=options.rotation_weight_mm_per_rad,
        frames=frames,
        frames_free=options.frames_free(observations),
        start=start,
    )


def choose_vec(
    observations: Observations,
    nominal: DHModel,
    joint_range_rad: tuple[np.ndarray, np.ndarray],
    options: Options,
    progress=None,
) -> list[Choice]:
    """Order and prior chosen from ``options.grid``; see ``selection.choices``. Raises FitError."""
    frames = fit_nominal(observations, nominal, options).frames
    frames_free = options.frames_free(observations)
    size = coordinates(observations, frames, *frames_free).size
    # A choice trains on three blocks of five at least; every fit of the chosen order on more.
    count = observations.select(observations.fold >= 0).components * 3 // 5
    grid = options.grid.within(count, nominal.joints, size)
    return selection.choices(
        _with_wanted_directions(observations, options),
        vec.without_errors(nominal, *joint_range_rad, max(grid.orders)),
        frames,
        frames_free,
        options.rotation_weight_mm_per_rad,
        grid,
        progress,
    )


def vec_gauge(observations: Observations, fitted: VECFit, options: Options) -> Spectrum:
    """What the poses tell of the VEC coefficients without a prior; see ``vec_fit.gauge``."""
    return vec_fit.gauge(
        _with_wanted_directions(observations, options),
        fitted.model,
        fitted.frames,
        options.rotation_weight_mm_per_rad,
    )


def fit_dh(
    observations: Observations,
    nominal: DHModel,
    options: Options,
    followed: Fit | None,
) -> DHFit:
    """DH model of the measurements or, with ``dh_to_vec``, of the model followed at their joints.

    Base and targets are then those of the model ``followed``. Raises FitError.
    """
    frames, terms = _of_frames(observations, options)
    if options.dh_to_vec:
        at_target = compose(
            followed.model.pose(observations.q_rad, observations.s),
            _rows(followed.frames.targets, observations.target),
        )
        poses = full_poses(observations.q_rad, at_target)
        observations = poses.with_targets_of(observations)
        frames, terms = Frames(IDENTITY, followed.frames.targets), None
    arm = options.arm(nominal)
    fitted = dh_fit.fit(
        observations,
        arm.nominal,
        free=arm.free,
        std=arm.std,
        rotation_weight_mm_per_rad=options.rotation_weight_mm_per_rad,
        threshold=options.threshold,
        frames=frames,
        frame_terms=terms,
        loss=options.loss,
    )
    return fitted.with_frames(followed.frames) if options.dh_to_vec else fitted


def fit_nominal(observations: Observations, nominal: DHModel, options: Options) -> DHFit:
    """Base and targets of the nominal arm; nothing to fit where they are known. Raises FitError."""
    frames, terms = _of_frames(observations, options)
    return dh_fit.fit_frames(
        observations,
        nominal,
        rotation_weight_mm_per_rad=options.rotation_weight_mm_per_rad,
        frames=frames,
        frame_terms=terms,
    )


def _of_frames(
    observations: Observations, options: Options
) -> tuple[Frames | None, FrameTerms | None]:
    """Frames nobody estimates, or what the fits take for granted of those they estimate."""
    if options.frames_estimated:
        return None, options.frames(observations)
    return options.stated(observations), None


def _with_wanted_directions(observations: Observations, options: Options) -> Observations:
    return observations if options.travel_direction else observations.without_directions()


def _rows(targets: Pose, target: np.ndarray) -> Pose:
    return Pose(targets.rotation[target], targets.position_mm[target])
