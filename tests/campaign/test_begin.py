"""What a campaign keeps of its candidates: modelled positions, their slopes, and their frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from campaign_on_disk import make_plan, mh180

from kinacc.assess.registry import ADAPTIVE
from kinacc.campaign import begin
from kinacc.campaign.instrument import instruments
from kinacc.campaign.plan import Limits
from kinacc.campaign.state import Reading, covariance_mm2, error_mm
from kinacc.deployment.planning import spread
from kinacc.deployment.record import Residual, nominal
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState

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


def planned(arm, limits):
    """A plan of six readings at as many points, in the instrument's frame."""
    points = begin.points_of(arm, spread(arm.robot, 6), [str(number) for number in range(6)])
    assessor = ADAPTIVE["single_shot"](measurements=6)
    used = instruments(["tracker=0.05", "camera=0.01,0.02,0.05"], "instrument")
    return begin.plan_of(arm, points, assessor, used, limits, None, "drawn")


def shifted(x_mm, y_mm, z_mm, turn_rad):
    return Pose(exp_so3(np.array([0.3, -0.5, 1.0]) * turn_rad), np.array([x_mm, y_mm, z_mm]))


@pytest.mark.parametrize("anchored", [False, True])
def test_readings_as_the_calibration_predicts_them_have_no_error(anchored):
    """A VEC model fitted with its base keeps the robot's base of the DH model of the same data."""
    arm = nominal(robot.load("irb120"))
    station = shifted(-2300.0, 1700.0, -640.0, 1.1)
    arm = replace(arm, base=compose(station, shifted(0.4, -1.2, 0.7, 2e-3)))
    if anchored:
        arm = replace(arm, anchor=replace(arm, base=station))
    plan = planned(arm, Limits(3e-4, 5.0))
    at = JointState(plan.points.joints @ arm.robot.joint_map.T)
    seen = arm.pose(at, frame="instrument").position_mm
    readings = [Reading(point, place, "camera") for point, place in enumerate(seen)]
    np.testing.assert_allclose([error_mm(plan, each) for each in readings], 0.0, atol=1e-9)
    turn = (station if anchored else arm.base).rotation
    by_camera = turn.T @ np.diag([1e-4, 4e-4, 25e-4]) @ turn
    np.testing.assert_allclose(covariance_mm2(plan, readings[0]), by_camera, atol=1e-12)


def test_candidates_that_cannot_be_measured_against_the_model_are_named():
    arm = mh180()
    joints = spread(arm.robot, 4)
    with pytest.raises(InputError, match="all 3 are at the same joints"):
        begin.points_of(arm, joints[[0, 0, 0]], ["a", "b", "c"])
    joints[2, 1] += 9.0
    with pytest.raises(InputError) as refused:
        begin.points_of(arm, joints, ["a", "a", "far", "line\nfeed"])
    where = [problem.where for problem in refused.value.problems]
    assert where == ["candidates far", "candidates, pose", "candidates"]
    assert "joint 2 outside the limits" in refused.value.problems[0].what


def test_many_candidates_are_driven_to_in_an_order_with_less_travel():
    plan = make_plan(points=420, budget=500)

    def travel(route):
        return np.abs(np.diff(plan.points.joints[route], axis=0)).max(axis=1).sum()

    assert sorted(plan.route) == sorted(plan.order)
    assert travel(plan.route) < 0.6 * travel(plan.order)


@pytest.mark.parametrize(("left_mm", "limit_mm"), [(None, 50.5), (0.1, 5.5), (1.0, 20.5)])
def test_a_reading_is_implausible_far_beyond_the_errors_of_the_calibration(left_mm, limit_mm):
    arm = nominal(robot.load("irb120"))
    if left_mm is not None:
        arm = replace(arm, residual=Residual(left_mm, 1e-4, "validation"))
    assert planned(arm, Limits()).limits.implausible_mm == pytest.approx(limit_mm)
