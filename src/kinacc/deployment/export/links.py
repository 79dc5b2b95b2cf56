"""A DH chain cut at its axes: the fixed frame in front of every joint, which then turns about z."""

from __future__ import annotations

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.geometry import IDENTITY, Pose, compose, rotation_x, rotation_y, rotation_z
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.robot import Robot


def origins(dh: DHModel) -> tuple[list[Pose], Pose]:
    """Frames of the k joints in the link before each, and the last DH frame in the last link.

    Link i is what follows joint i: it turns about (or slides along) the z axis of its origin, so
    the arm is ``origin_1 Rz(q_1) origin_2 Rz(q_2) .. end``.
    """
    found, before = [], IDENTITY
    for joint in range(dh.joints):
        turn = Pose(rotation_z(dh.theta_offset_rad[joint]), np.zeros(3))
        found.append(compose(before, turn))
        tilt = rotation_x(dh.alpha_rad[joint]) @ rotation_y(dh.beta_rad[joint])
        before = Pose(tilt, np.array([dh.a_mm[joint], 0.0, dh.d_mm[joint]]))
    return found, before


def signs(robot: Robot) -> np.ndarray:
    """Sense (k,) in which reported joints turn the DH axes.

    Raises InputError where reported joints are coupled or scaled, which no chain of single joints
    can express.
    """
    diagonal = np.diag(robot.joint_map)
    if np.array_equal(robot.joint_map, np.diag(diagonal)) and (np.abs(diagonal) == 1.0).all():
        return diagonal
    problem = Problem(
        f"robot {robot.name}",
        "reports joints that are coupled or scaled, which a URDF cannot say",
        "every reported joint turns one axis, by its own angle",
        "export with the joints of the DH table instead (--dh-joints)",
    )
    raise InputError(problem)
