"""Which parameters of a fit the data determine, and which of them they cannot tell apart."""

from __future__ import annotations

from dataclasses import replace
from itertools import compress

import numpy as np

from kinacc.calibration.fitting import ModelFit
from kinacc.calibration.identifiability import (
    FIXED,
    IDENTIFIED,
    PRIOR,
    UNDETERMINED,
    LeftOpen,
    statements,
)
from kinacc.calibration.observations import Observations, full_poses
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.split import MOVES_SQUARED, TOUCH_SQUARED, undetermined
from kinacc.calibration.system import PoseSystem
from kinacc.calibration.uncertainty import Uncertainty, is_angle, named_directions, unit_of
from kinacc.geometry import Pose
from kinacc.kinematics.dh import DHModel
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

LEANS = 0.5  # share of its prior above which a standard deviation is that of the prior
STRUCTURAL = 1e-5  # share of the largest singular value over poses all over the joints
UNSEEN_POSES = 60
UNSEEN_WEIGHT = 500.0  # mm per rad; what is null is so by any weight


def table(fit: ModelFit, known: Uncertainty, observations: Observations) -> Columns:
    """``dh_identified``: status of every parameter of a DH fit, frames first, and why.

    Undetermined are those of which directions below the truncation's share of the largest singular
    value (base and targets projected out) hold more than 1 % (``split.TOUCH_SQUARED``), or a
    quarter where a prior determines it (``split.MOVES_SQUARED``).

    Parameters
    ----------
    fit : ModelFit
        A fit of a DH model.
    known : Uncertainty
        Its uncertainty.
    observations : Observations
        What was fitted.
    """
    free = fit.free.ravel()
    prior = np.concatenate([fit.parameters.std, fit.prior_std.ravel()[free]])
    estimated = np.concatenate([fit.parameters.free, free[free]])
    std = np.sqrt(np.maximum(np.diag(known.covariance), 0.0))
    part = np.linalg.norm(known.undetermined, axis=0)
    why, rows = statements(left_open(fit, known, observations)), []
    for i, name in enumerate(known.names):
        status = IDENTIFIED if estimated[i] else FIXED
        statement = None if estimated[i] else "fixed by calibration.frames"
        if np.isfinite(prior[i]) and std[i] > LEANS * prior[i]:
            size, unit = (1e3, "mrad") if is_angle(name) else (1.0, "mm")
            status, statement = PRIOR, f"known beforehand to {size * prior[i]:g} {unit}"
        if part[i] ** 2 > (MOVES_SQUARED if status == PRIOR else TOUCH_SQUARED):
            status, statement = UNDETERMINED, why.get(name)
        deviation = std[i] if status in (IDENTIFIED, PRIOR) else None
        rows.append((name, status, deviation, unit_of(name), float(part[i]), statement))
    fixed = compress(fit.model.names, ~free)
    rows += [(name, FIXED, None, unit_of(name), 0.0, "not fitted") for name in fixed]
    return columns_of("dh_identified", rows)


def left_open(fit: ModelFit, known: Uncertainty, observations: Observations) -> LeftOpen:
    """What the data cannot tell apart. ``observations``: what was fitted."""
    hidden = named_directions(fit, unseen_anywhere(fit, observations, STRUCTURAL))
    return LeftOpen.of(hidden, known.undetermined, known.names, fit.frames)


@one_thread
def unseen_anywhere(fit: ModelFit, observations: Observations, threshold: float) -> np.ndarray:
    """Directions (m, P) of a fit's coordinates that no pose shows, whatever the joints.

    ``observations`` say which targets were seen in which sessions, and how. Poses all over the
    joints' turns (prismatic ones: a metre) are put where the model has them: without residuals what
    cannot be seen is null to rounding.
    """
    everywhere = _everywhere(fit, observations)
    system = PoseSystem(everywhere, fit.model, fit.free.ravel(), fit.parameters, UNSEEN_WEIGHT)
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
    nowhere = Pose(np.zeros((len(pose), 3, 3)), np.zeros((len(pose), 3)))
    names = {"target_names": observations.target_names, "session_names": observations.session_names}
    observed = replace(
        full_poses(q_rad[pose], nowhere), pose=pose, target=target, session=session, **names
    )
    predicted = fit.frames.seen(fit.model, observed)
    rotation = np.where(turned.astype(bool)[:, None, None], predicted.rotation, np.nan)
    return replace(observed, position_mm=predicted.position_mm, rotation=rotation)


def joints_anywhere(model: DHModel) -> np.ndarray:
    """Joints of all kinds, beyond any limits: a whole turn each, or a metre either way.

    Parameters
    ----------
    model : DHModel
        An arm with k joints.

    Returns
    -------
    numpy.ndarray
        Random DH joints, the same at each call, shape (UNSEEN_POSES, k) in rad or mm.
    """
    reach = np.where(model.prismatic, 1e3, np.pi)
    return np.random.default_rng(0).uniform(-reach, reach, (UNSEEN_POSES, model.joints))
