"""Which parameters of a fit the data determine, and which of them they cannot tell apart."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from kinacc.calibration.blind_groups import LeftOpen, groups, of_arm
from kinacc.calibration.fitting import ModelFit, flange_model
from kinacc.calibration.observations import Observations, full_poses
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.solve import MOVES_SQUARED, TOUCH_SQUARED, undetermined
from kinacc.calibration.system import PoseSystem
from kinacc.calibration.uncertainty import Uncertainty, named_directions
from kinacc.geometry import Pose, compose
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import JointState

IDENTIFIED, PRIOR, UNDETERMINED, FIXED = "identified", "prior", "undetermined", "fixed"
LEANS = 0.5  # share of its prior above which a standard deviation is that of the prior
STRUCTURAL = 1e-5  # share of the largest singular value over poses all over the joints
UNSEEN_POSES = 60
UNSEEN_WEIGHT = 500.0  # mm per rad; what is null is so by any weight


@dataclass(frozen=True)
class Parameter:
    """What is known of one parameter.

    ``share``: length of its part in the undetermined directions of unit length (mm and mrad), 0
    where it takes part in none. ``prior_std``: to how much it was known beforehand, mm or rad,
    where that is what determines it.
    """

    name: str
    status: str
    share: float = 0.0
    prior_std: float | None = None


def parameters(fit: ModelFit, known: Uncertainty) -> list[Parameter]:
    """Every parameter of a DH fit, frames first.

    Undetermined are those of which directions below the truncation's share of the largest singular
    value (base and targets projected out) hold more than 1 % (``truncated.TOUCH_SQUARED``), or half
    of them where it has a prior (``truncated.MOVES_SQUARED``).
    """
    priors, fixed = _priors(fit), _fixed(fit)
    std = dict(zip(known.names, np.sqrt(np.maximum(np.diag(known.covariance), 0.0)), strict=True))
    found = []
    for name, share in zip(
        known.names, np.sqrt(np.sum(known.undetermined**2, axis=0)), strict=True
    ):
        status = FIXED if name in fixed else IDENTIFIED
        status = PRIOR if name in priors and std[name] > LEANS * priors[name] else status
        most = MOVES_SQUARED if status == PRIOR else TOUCH_SQUARED
        status = UNDETERMINED if share**2 > most else status
        prior = priors[name] if status == PRIOR else None
        found.append(Parameter(name, status, float(share), prior))
    free = zip(fit.model.names, fit.free.ravel(), strict=True)
    return found + [Parameter(name, FIXED) for name, is_free in free if not is_free]


def left_open(fit: ModelFit, known: Uncertainty, seen: Observations) -> LeftOpen:
    """What the data cannot tell apart. ``seen``: what was fitted."""
    hidden = named_directions(fit, seen.target_names, unseen_anywhere(fit, seen, STRUCTURAL))
    found = groups(hidden, known.undetermined, of_arm(known.names))
    return LeftOpen(found, known.names, fit.frames)


@one_thread
def unseen_anywhere(fit: ModelFit, observations: Observations, threshold: float) -> np.ndarray:
    """Directions (m, P) of a fit's coordinates that no pose shows, whatever the joints.

    ``observations`` say which targets were seen in which sessions, and how. Poses all over the
    joints' turns (prismatic ones: a metre) are put where the model has them: without residuals what
    cannot be seen is null to rounding.
    """
    seen = _everywhere(fit, observations)
    flange = flange_model(fit.model, fit.free.ravel())
    system = PoseSystem(seen, flange, fit.parameters, UNSEEN_WEIGHT)
    return undetermined(system, fit.solution.x, fit.solution.scale, threshold)


def _everywhere(fit: ModelFit, observations: Observations) -> Observations:
    """Poses at joints of all kinds, by the model: every kind of row of ``observations`` in each."""
    kinds = np.unique(
        np.stack([observations.session, observations.target, observations.has_rotation], axis=1),
        axis=0,
    )
    q_rad = joints_anywhere(fit.model.dh)
    pose, kind = np.repeat(np.arange(len(q_rad)), len(kinds)), np.tile(kinds.T, len(q_rad))
    session, target, turned = kind
    frames = fit.frames
    at = compose(
        fit.model.pose(JointState(q_rad[pose])),
        Pose(frames.targets.rotation[target], frames.targets.position_mm[target]),
    )
    at = compose(Pose(frames.bases.rotation[session], frames.bases.position_mm[session]), at)
    made = full_poses(q_rad[pose], at)
    return replace(
        made,
        rotation=np.where(turned.astype(bool)[:, None, None], at.rotation, np.nan),
        pose=pose,
        target=target,
        session=session,
        target_names=observations.target_names,
        session_names=observations.session_names,
    )


def joints_anywhere(model: DHModel) -> np.ndarray:
    """Joints (n, k) of all kinds, beyond any limits: a whole turn each, or a metre either way."""
    reach = np.where(model.prismatic, 1e3, np.pi)
    return np.random.default_rng(0).uniform(-reach, reach, (UNSEEN_POSES, model.joints))


def _priors(fit: ModelFit) -> dict[str, float]:
    """Standard deviations of the priors by parameter, mm and rad."""
    names = (*fit.parameters.names, *fit.model.names)
    std = np.concatenate([fit.parameters.std, fit.prior_std.ravel()])
    return {name: float(each) for name, each in zip(names, std, strict=True) if np.isfinite(each)}


def _fixed(fit: ModelFit) -> set[str]:
    """Components of frames that were not estimated."""
    return set(compress(fit.parameters.names, ~fit.parameters.free))
