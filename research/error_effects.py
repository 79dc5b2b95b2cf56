"""What errors of single joints do at the tool: the columns that make errors of poses comparable."""

from __future__ import annotations

import numpy as np

from kinacc.kinematics import dh
from kinacc.kinematics.robot import Robot

CAUSES_PER_JOINT = 6


def joint_errors(robot: Robot, q_rad: np.ndarray, tool_mm: np.ndarray | None = None) -> np.ndarray:
    """Motion of the tool point (n, 3, 6 k), robot base frame, per mm and mrad of a joint's error.

    q_rad: (n, k) reported joints; tool_mm: (3,) or (n, 3) in the flange frame, default the flange.
    The errors are those of eq. 5 in order delta_x, delta_y, delta_z (mm), eps_x, eps_y, eps_z
    (mrad), joint by joint, in the frame behind the joint.
    """
    frames = dh.chain(robot.dh, robot.dh_joints(q_rad))
    axes = frames.rotation[:, 1:]  # (n, k, 3, 3): columns are the axes of the frames
    offset = np.zeros(3) if tool_mm is None else np.asarray(tool_mm, dtype=float)
    tip = frames.position_mm[:, -1] + np.einsum(
        "nij,nj->ni", axes[:, -1], np.broadcast_to(offset, (len(axes), 3))
    )
    lever = tip[:, None, :] - frames.position_mm[:, 1:]
    swung = 1e-3 * np.cross(axes, lever[..., None], axisa=2, axisb=2, axisc=2)
    both = np.concatenate([axes, swung], axis=-1)  # (n, k, 3, 6)
    return np.swapaxes(both, 1, 2).reshape(len(both), 3, -1)
