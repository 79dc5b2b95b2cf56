"""Joints of an arm of four or five axes: the point where it is wanted, turned as near as it can be.

Such an arm cannot take every orientation, and a calibrated one, whose axes are a little askew, not
even those its maker means. Its point can still be put exactly where it is wanted.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinacc.geometry import Pose, compose, skew
from kinacc.kinematics.inverse.newton import pose_error

SIX = 6  # axes that take any orientation
_MM_PER_UNIT = 1000.0  # travel of a sliding joint that counts as a radian
_LONGEST_STEP = 0.5
_SMALLEST_STEP = 1e-12
_SINGULAR = 1e-9  # share of the largest singular value


def refine(
    forward: Callable[[np.ndarray], Pose],
    jacobian: Callable[[np.ndarray], np.ndarray],
    target: Pose,
    carried: Pose,
    q: np.ndarray,
    prismatic: np.ndarray,
    most_steps: int = 60,
) -> np.ndarray:
    """Joints (n, k), rad and mm, that put ``carried`` at ``target`` (n, ...), from ``q`` (n, k).

    Gauss-Newton on the rotation error in the directions of the joints that leave the position,
    Newton on the position in the others. ``forward`` and ``jacobian`` as for ``newton.refine``, of
    the last frame, in which ``carried`` is given. ``prismatic`` (k,) marks joints in mm. Nothing
    says whether the point was reached: look at the pose.
    """
    unit = np.where(prismatic, _MM_PER_UNIT, 1.0)
    q = np.array(q, dtype=float)
    active = np.arange(len(q))
    for _ in range(most_steps):
        end = forward(q[active])
        arm = (end.rotation @ carried.position_mm[:, None])[..., 0]
        goal = Pose(target.rotation[active], target.position_mm[active])
        error = pose_error(goal, compose(end, carried))
        slopes = jacobian(q[active])
        # A turn of the last frame swings the point: w x arm = -[arm] w.
        moves = (slopes[:, :3] - skew(arm) @ slopes[:, 3:]) * unit
        turns = slopes[:, 3:] * unit
        step = _step(moves, turns, error) * unit
        q[active] += step
        size = np.max(np.abs(step / unit), axis=1, initial=0.0)
        active = active[np.isfinite(size) & (size > _SMALLEST_STEP)]
        if not len(active):
            break
    return q


def _step(moves: np.ndarray, turns: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Step (n, k) of joints that ``moves``, ``turns`` (n, 3, k) the point by ``error`` (n, 6)."""
    free = np.linalg.svd(moves)[2][:, 3:]  # directions that leave the position, to first order
    reach = np.linalg.pinv(moves, rcond=_SINGULAR)
    there = (reach @ error[:, :3, None])[..., 0]
    left = error[:, 3:] - (turns @ there[..., None])[..., 0]
    along = turns @ np.swapaxes(free, 1, 2)
    step = there + (np.swapaxes(free, 1, 2) @ np.linalg.pinv(along) @ left[..., None])[..., 0]
    longest = np.max(np.abs(step), axis=1, keepdims=True)
    return step * np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-300))
