"""Pinocchio and pybotics: forward kinematics equal to the calibrated model's."""

import importlib.util

import numpy as np
import pinocchio as pin
import pytest
from oracles.kinematics import rot_x, rot_z, trans
from test_export_urdf import assert_same, bent, of, some_joints

from kinacc.deployment.export import urdf
from kinacc.geometry import Pose
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState

ARMS = robot.shipped()


def matrix(pose):
    full = np.eye(4)
    full[:3, :3], full[:3, 3] = pose.rotation, pose.position_mm
    return full


@pytest.mark.parametrize("size", [0.0, 1.0])
@pytest.mark.parametrize("name", ARMS)
def test_modified_dh_reaches_the_same_poses(name, size):
    arm = bent(robot.load(name), size=size)
    q_rad = arm.robot.dh_joints(some_joints(arm.robot))
    base, parameters, end = urdf.modified_dh(of(arm), None)
    ends = []
    for row in q_rad:
        step = matrix(base)
        for (alpha, a, theta, d), q, slides in zip(
            parameters, row, arm.model.prismatic, strict=True
        ):
            step = step @ rot_x(alpha) @ trans(a, 0, 0) @ rot_z(theta + q * (not slides))
            step = step @ trans(0, 0, d + q * slides)
        ends.append(step @ matrix(end))
    ends = np.array(ends)
    assert_same(arm.pose(JointState(q_rad)), Pose(ends[:, :3, :3], ends[:, :3, 3]))


@pytest.mark.skipif(not importlib.util.find_spec("pybotics"), reason="pybotics is not installed")
@pytest.mark.parametrize("name", ARMS)
def test_pybotics_reaches_the_same_poses(name):
    arm = bent(robot.load(name))
    q_rad = arm.robot.dh_joints(some_joints(arm.robot))
    theirs = urdf.to_pybotics(of(arm), "flange")
    ends = np.array([theirs.fk(row) for row in q_rad])
    assert_same(
        arm.pose(JointState(q_rad), "base", "flange"), Pose(ends[:, :3, :3], ends[:, :3, 3])
    )


def test_pinocchio_has_the_calibrated_arm():
    arm = bent(robot.load("irb120"))
    model = urdf.to_pinocchio(of(arm))
    data = model.createData()
    for q in some_joints(arm.robot):
        pin.framesForwardKinematics(model, data, q)
        tool = data.oMf[model.getFrameId("tool")]
        ours = arm.pose(JointState(arm.robot.dh_joints(q[None])))
        assert ours.position_mm[0] == pytest.approx(1e3 * tool.translation, abs=1e-9)
        assert ours.rotation[0] == pytest.approx(tool.rotation, abs=1e-9)
