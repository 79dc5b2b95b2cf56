"""Whether a pose lies where the calibration was measured, where joints were measured together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_arms import calibrated, joints, measured, measured_at, results_of

from kinacc.deployment.applicability import is_measured_there, position_std_mm, share_of_box
from kinacc.deployment.folder import calibration
from kinacc.deployment.predict import predict
from kinacc.kinematics.model import JointState


@pytest.mark.parametrize("model", ["dh", "vec"])
def test_a_gap_between_two_clusters_of_poses_is_not_where_it_was_measured(model):
    rng, middle = np.random.default_rng(5), np.deg2rad([-50.0, -90.0, 30.0, -60.0, -60.0, 10.0])
    sides = np.where(rng.random(200) < 0.5, -0.85, 0.85)[:, None]
    seen = measured_at("ur10", middle + sides + rng.uniform(-0.35, 0.35, (200, 6)))
    found = calibration(results_of("ur10", seen, model == "vec"), model, "ur10")
    found = replace(found, fitted=JointState(seen.q_rad))
    between = middle + rng.uniform(-0.3, 0.3, (100, 6))
    assert not found.outside_range(between).any()
    assert not is_measured_there(found, JointState(between)).any()
    assert is_measured_there(found, JointState(seen.q_rad)).mean() == pytest.approx(0.99)


def test_a_box_that_was_measured_everywhere_is_where_it_was_measured():
    found = replace(calibrated("ur10"), fitted=JointState(measured("ur10").q_rad))
    low, high = joints("ur10", 2000).min(axis=0), joints("ur10", 2000).max(axis=0)
    assert share_of_box(found, low, high) > 0.9
    beyond = found.robot.dh_joints(np.stack([low, high + 1.0]))
    assert not is_measured_there(found, JointState(beyond))[1]


def test_what_the_poses_left_open_counts_with_a_millimetre_of_each_direction():
    """Joint 5 stood still, so that poses with another joint 5 are known less well."""
    still = joints("ur10", 80)
    still[:, 4] = -1.0
    arm = calibration(results_of("ur10", measured_at("ur10", still), False), "dh", "ur10")
    there = predict(arm, joints("ur10", 20, seed=9), frame="instrument")
    at = JointState(arm.robot.dh_joints(joints("ur10", 20, seed=9)))
    assert (there.undetermined[:, 0] > 1.0).any()
    wanted = np.hypot(there.std_position_mm, there.undetermined[:, 0])
    np.testing.assert_allclose(position_std_mm(arm, at), wanted, rtol=1e-9)
