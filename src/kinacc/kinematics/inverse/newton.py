"""Batched refinement of joint angles onto any forward model, from a start close to a solution.

Levenberg-Marquardt on the pose error (position in mm, rotation times a lever): plain Newton steps
where they help, damped and shortened ones close to a singularity. Poses leave the batch as soon as
they meet the tolerance, so no result depends on its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose, log_so3

POSITION_TOLERANCE_MM = 1e-6
ROTATION_TOLERANCE_RAD = 1e-9  # 1e-6 mm at a lever of one metre

_LEVER_MM = 1000.0
_LONGEST_TURN_RAD = 0.5
_BLOCK = 8192
_ROUND_OFF = 1e-15  # smallest damping, relative to the trace of J'J: keeps the solve regular
_FIRST_DAMPING, _SMALLEST_DAMPING, _LARGEST_DAMPING = 1e-5, 1e-9, 1e3


class Refined(NamedTuple):
    """Outcome per pose: joints (n, k), remaining errors (n,), whether both met tolerance (n,)."""

    q_rad: np.ndarray
    position_error_mm: np.ndarray
    rotation_error_rad: np.ndarray
    converged: np.ndarray
    steps: np.ndarray


def pose_error(target: Pose, actual: Pose) -> np.ndarray:
    """Error (n, 6): position in mm and the rotation vector in rad that turns actual to target."""
    error = np.empty((len(target.position_mm), 6))
    error[:, :3] = target.position_mm - actual.position_mm
    wanted, found = target.rotation, actual.rotation
    # Half the sum of the cross products of the axes is the axis times the sine of the angle.
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        product = found[:, j, :] * wanted[:, k, :] - found[:, k, :] * wanted[:, j, :]
        error[:, 3 + i] = 0.5 * (product[:, 0] + product[:, 1] + product[:, 2])
    cosine = 0.5 * (np.einsum("nij,nij->n", wanted, found) - 1.0)
    sine = np.sqrt(np.einsum("ni,ni->n", error[:, 3:], error[:, 3:]))
    safe = np.where(sine < 1e-8, 1.0, sine)
    error[:, 3:] *= np.where(sine < 1e-8, 1.0, np.arctan2(safe, cosine) / safe)[:, None]
    far = np.flatnonzero(cosine < 0.0)
    if len(far):
        error[far, 3:] = log_so3(wanted[far] @ np.swapaxes(found[far], 1, 2))
    return error


def refine(
    forward: Callable[[np.ndarray], Pose],
    jacobian: Callable[[np.ndarray], np.ndarray],
    target: Pose,
    q_rad: np.ndarray,
    most_steps: int = 60,
    position_tolerance_mm: float = POSITION_TOLERANCE_MM,
    rotation_tolerance_rad: float = ROTATION_TOLERANCE_RAD,
) -> Refined:
    """Joints (n, k) whose ``forward`` pose is ``target`` (n, ...), starting at ``q_rad`` (n, k).

    ``forward`` maps (m, k) to a Pose of true rotations, ``jacobian`` to (m, 6, k) with rows as
    ``models.dh.joint_jacobian``. Angles are not wrapped and limits are not looked at. A pose that
    has no solution near its start comes back with ``converged`` False and its smallest error.
    """
    count = len(q_rad)
    result = Refined(
        np.array(q_rad, dtype=float),
        np.full(count, np.inf),
        np.full(count, np.inf),
        np.zeros(count, dtype=bool),
        np.zeros(count, dtype=int),
    )
    tolerances = position_tolerance_mm, rotation_tolerance_rad
    for begin in range(0, count, _BLOCK):
        block = slice(begin, begin + _BLOCK)
        part = Refined(*(column[block] for column in result))
        goal = Pose(target.rotation[block], target.position_mm[block])
        _refine_block(forward, jacobian, goal, part, most_steps, tolerances)
    return result


def _refine_block(
    forward: Callable[[np.ndarray], Pose],
    jacobian: Callable[[np.ndarray], np.ndarray],
    target: Pose,
    result: Refined,
    most_steps: int,
    tolerances: tuple[float, float],
) -> None:
    active = np.arange(len(result.q_rad))
    damping = np.zeros(len(active))
    lowest = np.full(len(active), np.inf)
    normal = gradient = np.empty(0)
    trial = result.q_rad.copy()
    for step in range(most_steps + 1):
        goal = Pose(target.rotation[active], target.position_mm[active])
        error = pose_error(goal, forward(trial))
        position = np.sqrt(np.einsum("ni,ni->n", error[:, :3], error[:, :3]))
        rotation = np.sqrt(np.einsum("ni,ni->n", error[:, 3:], error[:, 3:]))
        cost = position**2 + (_LEVER_MM * rotation) ** 2
        better = cost < lowest
        _record(result, active[better], trial[better], position[better], rotation[better], step)
        lowest = np.where(better, cost, lowest)
        if step == 0:
            normal, gradient = _normal_equations(jacobian, trial, error)
        elif better.any():
            renewed = np.flatnonzero(better & ~_met(position, rotation, tolerances))
            normal[renewed], gradient[renewed] = _normal_equations(
                jacobian, trial[renewed], error[renewed]
            )
        damping = _next_damping(damping, better)
        going = ~_met(
            result.position_error_mm[active], result.rotation_error_rad[active], tolerances
        )
        result.converged[active[~going]] = True
        going &= damping <= _LARGEST_DAMPING
        if not going.any() or step == most_steps:
            break
        active, damping, lowest = active[going], damping[going], lowest[going]
        normal, gradient = normal[going], gradient[going]
        trial = result.q_rad[active] + _step(normal, gradient, damping)


def _record(
    result: Refined,
    rows: np.ndarray,
    q_rad: np.ndarray,
    position_mm: np.ndarray,
    rotation_rad: np.ndarray,
    step: int,
) -> None:
    result.q_rad[rows] = q_rad
    result.position_error_mm[rows] = position_mm
    result.rotation_error_rad[rows] = rotation_rad
    result.steps[rows] = step


def _met(
    position_mm: np.ndarray, rotation_rad: np.ndarray, tolerances: tuple[float, float]
) -> np.ndarray:
    return (position_mm < tolerances[0]) & (rotation_rad < tolerances[1])


def _normal_equations(
    jacobian: Callable[[np.ndarray], np.ndarray], q_rad: np.ndarray, error: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    weight = np.array([1.0, 1.0, 1.0, _LEVER_MM, _LEVER_MM, _LEVER_MM])
    slope = jacobian(q_rad) * weight[:, None]
    slope_t = np.swapaxes(slope, 1, 2)
    return slope_t @ slope, slope_t @ (error * weight)[..., None]


def _next_damping(damping: np.ndarray, better: np.ndarray) -> np.ndarray:
    relaxed = np.where(damping > _SMALLEST_DAMPING, 0.1 * damping, 0.0)
    raised = np.maximum(8.0 * damping, _FIRST_DAMPING)
    return np.where(better, relaxed, raised)


def _step(normal: np.ndarray, gradient: np.ndarray, damping: np.ndarray) -> np.ndarray:
    trace = np.trace(normal, axis1=1, axis2=2)
    diagonal = trace * (damping + _ROUND_OFF)
    joints = normal.shape[1]
    turn = np.linalg.solve(normal + diagonal[:, None, None] * np.eye(joints), gradient)[..., 0]
    longest = np.max(np.abs(turn), axis=1)
    return turn * np.minimum(1.0, _LONGEST_TURN_RAD / np.maximum(longest, 1e-300))[:, None]
