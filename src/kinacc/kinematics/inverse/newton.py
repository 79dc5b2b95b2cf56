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

_LEVER_MM = 1000.0  # a radian counts as this, and so does a turn as travel of a joint that slides
_LONGEST_TURN_RAD = 0.5
_TIGHT_MM = 1e-9  # a radian counts as a metre
_BLOCK = 8192
_ROUND_OFF = 1e-15  # smallest damping, relative to the trace of J'J: keeps the solve regular
_FIRST_DAMPING, _SMALLEST_DAMPING, _LARGEST_DAMPING = 1e-5, 1e-9, 1e3
_CHEAP_STEPS, _STEPS, _PATIENT_STEPS = 12, 60, 600
_CLOSE_MM, _CLOSE_RAD = 2.0, 2e-3


class Refined(NamedTuple):
    """Outcome per pose: joints (n, k), remaining errors (n,), whether both met tolerance (n,)."""

    q_rad: np.ndarray
    position_error_mm: np.ndarray
    rotation_error_rad: np.ndarray
    converged: np.ndarray


def pose_error(target: Pose, actual: Pose) -> np.ndarray:
    """Error (n, 6): position in mm and the rotation vector in rad that turns actual to target."""
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
    """Joints (n, k) at which ``model`` has the poses ``target`` (n, ...), from ``q_rad`` (n, k).

    It travels and is loaded as in the one state ``like``. Joints before ``first`` stay. Angles are
    not wrapped and limits are not looked at. A pose that has no solution near its start comes back
    with ``converged`` False and its smallest error. After 60 steps only poses are followed that are
    close but creeping: beside a singular posture the error falls along a narrow curved valley.
    """
    count = len(q_rad)
    result = Refined(
        np.array(q_rad, dtype=float),
        np.full(count, np.inf),
        np.full(count, np.inf),
        np.zeros(count, dtype=bool),
    )
    for begin in range(0, count, _BLOCK):
        block = slice(begin, begin + _BLOCK)
        part = Refined(*(column[block] for column in result))
        goal = Pose(target.rotation[block], target.position_mm[block])
        _refine_block(model, goal, part, like, first, most_steps)
    return result


def _refine_block(
    model: ErrorModel,
    target: Pose,
    result: Refined,
    like: JointState | None,
    first: int,
    most_steps: int,
) -> None:
    active = np.arange(len(result.q_rad))
    # Errors of a milliradian change the slopes by a thousandth: each step with those of the DH arm
    # still gains three digits, at a fifth of the cost.
    cheap_until = _CHEAP_STEPS if model.table is None else 0
    unit = np.where(model.dh.prismatic, _LEVER_MM, 1.0)[first:]
    weight = np.repeat([1.0, _LEVER_MM], 3)
    damping, lowest = np.zeros(len(active)), np.full(len(active), np.inf)
    normal = np.empty((len(active), unit.size, unit.size))
    gradient, nearest = np.empty((len(active), unit.size)), np.empty((len(active), 6))
    trial = result.q_rad.copy()
    for step in range(most_steps + 1):
        goal = Pose(target.rotation[active], target.position_mm[active])
        at = JointState(trial) if like is None else like.moved(trial)
        error = pose_error(goal, model.pose(at))
        position = np.linalg.norm(error[:, :3], axis=1)
        rotation = np.linalg.norm(error[:, 3:], axis=1)
        met = (position < POSITION_TOLERANCE_MM) & (rotation < ROTATION_TOLERANCE_RAD)
        cost = position**2 + (_LEVER_MM * rotation) ** 2
        better = cost < lowest
        rows, already = active[better], result.converged[active]
        result.q_rad[rows], result.converged[rows] = trial[better], met[better]
        result.position_error_mm[rows] = position[better]
        result.rotation_error_rad[rows] = rotation[better]
        nearest[better], lowest[better] = error[better], cost[better]
        relaxed = np.where(damping > _SMALLEST_DAMPING, 0.1 * damping, 0.0)
        damping = np.where(better, relaxed, np.maximum(8.0 * damping, _FIRST_DAMPING))
        # One step more than the tolerance asks for: it costs little and gains what it has gained.
        going = ~(result.converged[active] & (already | (lowest < _TIGHT_MM**2)))
        if step >= cheap_until:
            going &= damping <= _LARGEST_DAMPING
        if step == _STEPS:
            going &= result.position_error_mm[active] < _CLOSE_MM
            going &= result.rotation_error_rad[active] < _CLOSE_RAD
        if not going.any():
            break
        exact = step == cheap_until > 0  # from here on with the slopes of the model itself
        if exact:
            damping[:] = 0.0
        renewed = np.flatnonzero(going & (better | exact))
        if len(renewed):
            there = result.q_rad[active[renewed]]
            at = JointState(there) if like is None else like.moved(there)
            slopes = (model.dh if step < cheap_until else model).joint_jacobian(at)
            slopes = slopes[..., first:] * weight[:, None] * unit
            turned = np.swapaxes(slopes, 1, 2)
            normal[renewed] = turned @ slopes
            gradient[renewed] = (turned @ (nearest[renewed] * weight)[..., None])[..., 0]
        active, damping, lowest = active[going], damping[going], lowest[going]
        normal, gradient, nearest = normal[going], gradient[going], nearest[going]
        diagonal = np.trace(normal, axis1=1, axis2=2) * (damping + _ROUND_OFF)
        system = normal + diagonal[:, None, None] * np.eye(unit.size)
        move = np.linalg.solve(system, gradient[..., None])[..., 0]
        longest = np.max(np.abs(move), axis=1)
        move *= np.minimum(1.0, _LONGEST_TURN_RAD / np.maximum(longest, 1e-300))[:, None]
        trial = result.q_rad[active]
        trial[:, first:] += move * unit
