"""What a campaign keeps of its candidates: modelled positions and their slopes."""

from __future__ import annotations

import numpy as np

from kinacc import robot
from kinacc.calibrated.record import nominal
from kinacc.campaign import begin
from kinacc.planning.candidates import spread

COUPLED_AND_SLIDING = """
name: coupled
joint_map: [[1, 0, 0, 0], [0, 1, 0, 0], [0, -1, 1, 0], [0, 0, 0, 1]]
dh:
  - {theta_offset_deg: 0, d_mm: 400, a_mm: 25, alpha_deg: -90, limits_deg: [-140, 140]}
  - {theta_offset_deg: -90, d_mm: 0, a_mm: 500, alpha_deg: 0, limits_deg: [-90, 90]}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 35, alpha_deg: -90, limits_deg: [-90, 90]}
  - {joint: prismatic, theta_offset_deg: 0, d_mm: 5, a_mm: 250, alpha_deg: 20, limits_mm: [0, 200]}
"""


def test_slopes_are_the_finite_differences_of_the_modelled_position():
    arm = nominal(robot.of_text(COUPLED_AND_SLIDING, "coupled.yaml"))
    assert (arm.robot.joint_map != np.eye(4)).any()
    joints = spread(arm.robot, 6)
    label = [str(number) for number in range(6)]
    found = begin.points_of(arm, joints, label)
    for joint, step in enumerate(np.where(arm.robot.dh.prismatic, 1e-3, 1e-6)):
        moved = step * np.eye(4)[joint]
        low, high = (
            begin.points_of(arm, joints + sign * moved, label).modelled_mm for sign in (-1, 1)
        )
        apart = (high - low) / (2 * step)
        np.testing.assert_allclose(found.slope[:, :, joint], apart, atol=1e-5)
