"""One damped Newton method that brings joints onto poses of any model, from starts close by.

Levenberg-Marquardt on the pose error (position in mm, rotation times a lever): plain Newton steps
where they help, damped and shortened ones close to a singularity. Poses leave the batch as soon as
they meet the tolerance, so no result depends on its neighbours.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose, log_so3
from kinacc.kinematics.model import ErrorModel, JointState

POSITION_TOLERANCE_MM = 1e-6
ROTATION_TOLERANCE_RAD = 1e-9  # 1e-6 mm at a lever of one metre

_LEVER_MM = 1000.0  # a radian counts as this
_LONGEST_TURN_RAD = 0.5
_TIGHT_MM = 1e-9
_BLOCK = 8192
_ROUND_OFF = 1e-15  # smallest damping, relative to the trace of J'J: keeps the solve regular
_FIRST_DAMPING, _SMALLEST_DAMPING, _LARGEST_DAMPING = 1e-5, 1e-9, 1e3
_STEPS, _PATIENT_STEPS = 60, 600
_CLOSE_MM = 2.0


class Refined(NamedTuple):
    """Joints that ``refine`` reached.

    Attributes
    ----------
    q_rad : numpy.ndarray
        DH joints, shape (n, k), rad (mm where a joint slides).
    error_mm : numpy.ndarray
        Pose errors, shape (n,); a radian counts as a metre.
    converged : numpy.ndarray
        Whether they meet the tolerance, shape (n,).
    """

    q_rad: np.ndarray
    error_mm: np.ndarray
    converged: np.ndarray


def pose_error(target: Pose, actual: Pose) -> np.ndarray:
    """Difference of poses, in the frame the poses are given in.

    Parameters
    ----------
    target, actual : Pose
        Poses (n, ...).

    Returns
    -------
    numpy.ndarray
        Position difference in mm, then the rotation vector in rad that turns ``actual`` to
        ``target``, shape (n, 6).
    """
    turn = log_so3(target.rotation @ np.swapaxes(actual.rotation, 1, 2))
    return np.concatenate([target.position_mm - actual.position_mm, turn], axis=1)


def refine(
    model: ErrorModel,
    target: Pose,
    q_rad: np.ndarray,
    like: JointState | None = None,
    first: int = 0,
    most_steps: int = _PATIENT_STEPS,
) -> Refined:
    """Joints at which a model has the wanted poses, near a start.

    After 60 steps only poses are followed that are close but creeping: beside a singular posture
    the error falls along a narrow curved valley.

    Parameters
    ----------
    model : ErrorModel
        Model of k joints.
    target : Pose
        Poses (n, ...) of the last DH frame in the first one.
    q_rad : numpy.ndarray
        DH joints to start from, rad, or mm where a joint slides, shape (n, k).
    like : JointState, optional
        States whose travel directions and payload the arm has: of every pose, or one for all.
    first : int
        Joints before this one stay.
    most_steps : int
        Largest number of steps.

    Returns
    -------
    Refined
        Angles are not wrapped and limits are not looked at. A pose without a solution near its
        start has ``converged`` False and the joints of its smallest error.
    """
    at = JointState(q_rad) if like is None else like.moved(q_rad)
    if len(q_rad) > _BLOCK:
        blocks = [slice(begin, begin + _BLOCK) for begin in range(0, len(q_rad), _BLOCK)]
        parts = [
            refine(model, target.select(block), q_rad[block], at.select(block), first, most_steps)
            for block in blocks
        ]
        return Refined(*map(np.concatenate, zip(*parts, strict=True)))
    best, trial = np.array(q_rad, dtype=float), np.array(q_rad, dtype=float)
    count, unit = len(best), model.dh.travel_unit[first:]
    weight = np.repeat([1.0, _LEVER_MM], 3)
    active, converged = np.arange(count), np.zeros(count, dtype=bool)
    damping, lowest = np.zeros(count), np.full(count, np.inf)
    slopes, gap = np.empty((count, 6, unit.size)), np.empty((count, 6))
    for step in range(most_steps + 1):
        error = weight * pose_error(
            target.select(active), model.pose(at.select(active).moved(trial))
        )
        cost = np.sum(error**2, axis=1)
        met = (np.sum(error.reshape(-1, 2, 3) ** 2, axis=2) < POSITION_TOLERANCE_MM**2).all(axis=1)
        better, already = cost < lowest[active], converged[active]
        rows = active[better]
        best[rows], lowest[rows], gap[rows] = trial[better], cost[better], error[better]
        converged[rows] = met[better]
        before = damping[active]
        relaxed = np.where(before > _SMALLEST_DAMPING, 0.1 * before, 0.0)
        damping[active] = np.where(better, relaxed, np.maximum(8.0 * before, _FIRST_DAMPING))
        # One step more than the tolerance asks for: it costs little and gains what it has gained.
        done = converged[active] & (already | (lowest[active] < _TIGHT_MM**2))
        going = ~done & (damping[active] <= _LARGEST_DAMPING)
        if step == _STEPS:
            going &= lowest[active] < _CLOSE_MM**2
        rows, active = active[going & better], active[going]
        if not len(active):
            break
        if len(rows):
            jacobian = model.joint_jacobian(at.select(rows).moved(best[rows]))
            slopes[rows] = jacobian[..., first:] * weight[:, None] * unit
        turned = np.swapaxes(slopes[active], 1, 2)
        normal = turned @ slopes[active]
        diagonal = np.trace(normal, axis1=1, axis2=2) * (damping[active] + _ROUND_OFF)
        system = normal + diagonal[:, None, None] * np.eye(unit.size)
        move = np.linalg.solve(system, turned @ gap[active, :, None])[..., 0]
        longest = np.max(np.abs(move), axis=1, keepdims=True)
        move *= np.minimum(1.0, _LONGEST_TURN_RAD / np.maximum(longest, 1e-300))
        trial = best[active]
        trial[:, first:] += move * unit
    return Refined(best, np.sqrt(lowest), converged)
