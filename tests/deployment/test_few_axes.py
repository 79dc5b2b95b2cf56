"""Arms of four and five axes: their point is put where it is wanted, turned as near as can be."""

from dataclasses import replace

import numpy as np
import pytest
from pose_checks import movement
from small_arms import bent

from kinacc.deployment.compensate import FEW_AXES_TURN_RAD, PoseStatus, compensate
from kinacc.deployment.record import nominal
from kinacc.geometry import Pose, rotation_x
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState

SCARA = """
dh:
  - {theta_offset_deg: 0, d_mm: 300, a_mm: 350, alpha_deg: 0, limits_deg: [-140, 140]}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 250, alpha_deg: 180, limits_deg: [-145, 145]}
  - {joint: prismatic, theta_offset_deg: 0, d_mm: 0, a_mm: 0, alpha_deg: 0, limits_mm: [0, 200]}
  - {theta_offset_deg: 0, d_mm: 50, a_mm: 0, alpha_deg: 0, limits_deg: [-360, 360]}
tool: {position_mm: [40, 30, 20]}
"""
FIVE = """
dh:
  - {theta_offset_deg: 0, d_mm: 300, a_mm: 50, alpha_deg: -90, limits_deg: [-160, 160]}
  - {theta_offset_deg: -90, d_mm: 0, a_mm: 400, alpha_deg: 0, limits_deg: [-90, 120]}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 350, alpha_deg: 0, limits_deg: [-140, 140]}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 0, alpha_deg: 90, limits_deg: [-120, 120]}
  - {theta_offset_deg: 0, d_mm: 120, a_mm: 0, alpha_deg: 0, limits_deg: [-180, 180]}
tool: {position_mm: [10, 0, 60]}
"""
BENT = {"scara": [0.4, 1.0, 90.0, -0.6], "five": [0.3, -0.2, 0.9, 0.5, -0.7]}


def real_arm(name):
    """The arm as described, with axes askew by a milliradian and lengths off by tenths of a mm."""
    plain = nominal(robot.of_text({"scara": SCARA, "five": FIVE}[name], name))
    return plain, replace(plain, model=bent(plain.robot.dh, 4), choice="dh")


def program(name, count=12):
    spread = np.where(np.array(BENT[name]) > 10.0, 60.0, 0.35)
    return BENT[name] + spread * np.random.default_rng(1).uniform(-1, 1, (count, len(spread)))


@pytest.mark.parametrize("name", ["scara", "five"])
def test_the_point_is_exact_and_no_joint_turns_it_nearer(name):
    plain, arm = real_arm(name)
    q = program(name)
    wanted = plain.pose(JointState(q))
    found = compensate(arm, wanted, q)
    assert (found.status == PoseStatus.CONVERGED).all()
    there = arm.pose(JointState(found.q_rad))
    shift, left = np.split(movement(wanted, there), 2, axis=1)
    assert np.linalg.norm(shift, axis=1).max() < 1e-6
    turn = np.linalg.norm(left, axis=1)
    np.testing.assert_allclose(turn, found.rotation_error_rad, rtol=0, atol=1e-9)
    assert turn.max() > 1e-4  # the plain arm's orientation is out of the real one's reach
    # To first order nothing that leaves the point where it is turns it nearer.
    unit = np.where(arm.robot.dh.prismatic, 1e3, 1.0)
    slopes = arm.joint_jacobian(JointState(found.q_rad))
    for row in range(len(q)):
        free = np.linalg.svd(slopes[row, :3] * unit)[2][3:] * unit
        assert np.abs(left[row] @ slopes[row, 3:] @ free.T).max() < 1e-8


def test_another_orientation_than_the_arm_takes_is_not_reached():
    plain, arm = real_arm("scara")
    q = program("scara", 2)
    wanted = plain.pose(JointState(q))
    tipped = Pose(wanted.rotation @ rotation_x(0.3), wanted.position_mm)
    found = compensate(arm, tipped, q)
    assert (found.status == PoseStatus.NOT_REACHED).all()
    assert np.isnan(found.q_rad).all()
    assert (found.rotation_error_rad > FEW_AXES_TURN_RAD).all()
