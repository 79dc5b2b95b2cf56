"""A robot written as text reads back to the same arm."""

from dataclasses import replace

import numpy as np
import pytest

from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import robot
from kinacc.kinematics.dh import PARAMETERS

SCARA = """
convention: modified
dh:
  - {theta_offset_deg: 3, d_mm: 400, a_mm: 0, alpha_deg: 180, limits_deg: [-140, 140], sign: -1}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 350, alpha_deg: 0, limits_deg: [-145, 145], name: elbow}
  - {joint: prismatic, theta_offset_deg: 0, d_mm: 5, a_mm: 250, alpha_deg: 0, limits_mm: [0, 200]}
  - {theta_offset_deg: 0, d_mm: 50, a_mm: 0, alpha_deg: 0, limits_deg: [-360, 360]}
tool: {position_mm: [1, 2, 3], rpy_deg: [10, 20, 30]}
"""
COUPLED = replace(
    robot.load("irb120"),
    joint_map=np.eye(6) + np.diag([0, 0, 0, 0, 0.25], -1),
    base=Pose(exp_so3(np.array([0.1, -2.0, 0.3])), np.array([1.0, -2.5, 3.0])),
)
ARMS = [*map(robot.load, robot.shipped()), robot.of_text(SCARA, "scara.yaml"), COUPLED]


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_an_arm_reads_back(arm):
    back = robot.of_text(robot.as_yaml(arm), "text")
    for name in (*PARAMETERS, "prismatic"):
        np.testing.assert_array_equal(getattr(back.dh, name), getattr(arm.dh, name), name)
    for name in ("q_min_rad", "q_max_rad", "joint_map"):
        np.testing.assert_array_equal(getattr(back, name), getattr(arm, name), name)
    for name in ("base", "flange", "tool"):
        for own, made in zip(getattr(arm, name), getattr(back, name), strict=True):
            np.testing.assert_allclose(made, own, rtol=0, atol=1e-14, err_msg=name)
    assert (back.name, back.source, back.date) == (arm.name, arm.source, arm.date)
    assert back.joint_names == (arm.joint_names or tuple(f"joint {i + 1}" for i in range(6)))
