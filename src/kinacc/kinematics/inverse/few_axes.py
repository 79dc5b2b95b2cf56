"""Joints of an arm of four or five axes: the point where it is wanted, turned as near as it can be.

Such an arm cannot take every orientation, and a calibrated one, whose axes are a little askew, not
even those its maker means. Its point can still be put exactly where it is wanted.
"""

from __future__ import annotations

import numpy as np

from kinacc.geometry import Pose, compose, skew
from kinacc.kinematics.inverse.newton import pose_error
from kinacc.kinematics.model import ErrorModel, JointState

SIX = 6  # axes that take any orientation
_MOST_STEPS = 60
_LONGEST_STEP, _SMALLEST_STEP = 0.5, 1e-12
_SINGULAR = 1e-9  # share of the largest singular value


def refine(
    model: ErrorModel, target: Pose, carried: Pose, q: np.ndarray, like: JointState
) -> np.ndarray:
    """Joints of an arm of four or five axes that put a point where it is wanted.

    Gauss-Newton on the rotation error in the directions of the joints that leave the position,
    Newton on the position in the others.

    Parameters
    ----------
    model : ErrorModel
        Model of k joints.
    target : Pose
        Wanted poses (n, ...) of ``carried`` in the first DH frame, mm.
    carried : Pose
        The tool in the last DH frame, mm.
    q : numpy.ndarray
        DH joints to start from, shape (n, k), rad (mm where a joint slides).
    like : JointState
        States whose travel directions and payload the arm has: of every pose, or one for all.

    Returns
    -------
    numpy.ndarray
        DH joints, shape (n, k). Whether a point was reached shows in its pose.
    """
    unit = model.dh.travel_unit
    q = np.array(q, dtype=float)
    active, state = np.arange(len(q)), like.moved(q)
    for _ in range(_MOST_STEPS):
        at = state.select(active).moved(q[active])
        end = model.pose(at)
        arm = (end.rotation @ carried.position_mm[:, None])[..., 0]
        error = pose_error(target.select(active), compose(end, carried))
        slopes = model.joint_jacobian(at)
        # A turn of the last frame swings the point: w x arm = -[arm] w.
        moves = (slopes[:, :3] - skew(arm) @ slopes[:, 3:]) * unit
        turns = slopes[:, 3:] * unit
        free = np.swapaxes(np.linalg.svd(moves)[2][:, 3:], 1, 2)  # these leave the position
        there = np.linalg.pinv(moves, rcond=_SINGULAR) @ error[:, :3, None]
        left = error[:, 3:, None] - turns @ there
        step = (there + free @ np.linalg.pinv(turns @ free) @ left)[..., 0]
        size = np.max(np.abs(step), axis=1, initial=0.0)
        step *= np.minimum(1.0, _LONGEST_STEP / np.maximum(size, 1e-300))[:, None]
        q[active] += step * unit
        active = active[np.isfinite(size) & (size > _SMALLEST_STEP)]
        if not len(active):
            break
    return q
