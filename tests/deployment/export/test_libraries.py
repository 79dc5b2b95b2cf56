"""Modified DH rows and pybotics: forward kinematics equal to the calibrated model's."""

import importlib.util

import pytest
from oracles.controllers.arms import frame
from oracles.kinematics import rot_x, rot_z, trans
from pose_checks import of_matrices
from scipy.spatial.transform import Rotation
from test_export_urdf import assert_close, bent, of, some_joints

from kinacc.deployment.export import urdf
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState

ARMS = robot.shipped()


@pytest.mark.parametrize("size", [0.0, 1.0])
@pytest.mark.parametrize("name", ARMS)
def test_modified_dh_reaches_the_same_poses(name, size):
    arm = bent(robot.load(name), size=size)
    q_rad = arm.robot.dh_joints(some_joints(arm.robot))
    first, parameters, last = urdf.modified_dh(of(arm), None)
    base, end = (frame(*x, Rotation.from_matrix(turn)) for turn, x in (first, last))
    ends = []
    for row in q_rad:
        step = base
        for (alpha, a, theta, d), q, slides in zip(
            parameters, row, arm.model.prismatic, strict=True
        ):
            step = step @ rot_x(alpha) @ trans(a, 0, 0) @ rot_z(theta + q * (not slides))
            step = step @ trans(0, 0, d + q * slides)
        ends.append(step @ end)
    assert_close(arm.pose(JointState(q_rad)), of_matrices(ends))


@pytest.mark.skipif(not importlib.util.find_spec("pybotics"), reason="pybotics is not installed")
@pytest.mark.parametrize("name", ARMS)
def test_pybotics_reaches_the_same_poses(name):
    arm = bent(robot.load(name))
    q_rad = arm.robot.dh_joints(some_joints(arm.robot))
    theirs = urdf.to_pybotics(of(arm), "flange")
    ends = [theirs.fk(row) for row in q_rad]
    assert_close(arm.pose(JointState(q_rad), "base", "flange"), of_matrices(ends))
