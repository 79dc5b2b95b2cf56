"""Predicted poses, what the fit knows of them, and what it does not."""

from dataclasses import replace

import numpy as np
import pytest
from pose_checks import movement
from small_arms import BASE, calibrated, joints, moved

from kinacc.calibration.uncertainty import unit_of
from kinacc.deployment.applicability import sensitivity
from kinacc.deployment.predict import predict
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState


def slope(pose_at, step):
    """Central difference (n, 6) of poses ``pose_at(step)`` by ``step``, mm and rad."""
    return movement(pose_at(-step), pose_at(step)) / (2 * step)


@pytest.mark.parametrize("model", ["dh", "vec"])
@pytest.mark.parametrize("frame", ["base", "instrument"])
@pytest.mark.parametrize("point", ["tool", "flange"])
def test_slopes_are_the_finite_differences_of_the_pose(model, frame, point):
    arm, q_rad = calibrated("mh180", model), joints("mh180", 3, seed=8)
    arm = replace(arm, robot=replace(arm.robot, base=BASE))
    state = JointState(q_rad, np.sign(np.random.default_rng(5).normal(size=q_rad.shape)))
    slopes, names = sensitivity(arm, state, frame, point), arm.known.names
    for column in np.linspace(0, len(names) - 1, 30).astype(int):
        name = names[column]
        found = slope(
            lambda step, name=name: moved(arm, {name: step}).pose(state, frame, point),
            1e-6 if unit_of(name) == "rad" else 1e-3,
        )
        np.testing.assert_allclose(slopes[:, :3, column], found[:, :3], rtol=1e-5, atol=2e-4)
        np.testing.assert_allclose(slopes[:, 3:, column], found[:, 3:], rtol=1e-5, atol=1e-8)
    slopes = arm.joint_jacobian(state, frame, point)
    for joint, unit in enumerate(np.eye(6)):
        found = slope(
            lambda step, unit=unit: arm.pose(state.moved(q_rad + step * unit), frame, point), 1e-6
        )
        np.testing.assert_allclose(slopes[:, :3, joint], found[:, :3], atol=1e-5)
        np.testing.assert_allclose(slopes[:, 3:, joint], found[:, 3:], atol=1e-8)


def test_undetermined_directions_show_where_the_frame_is_a_convention():
    arm, q_rad = calibrated("mh180", "dh"), joints("mh180", 5)
    # From the instrument to the tool everything was measured; where the base stands was not.
    assert predict(arm, q_rad, None, "instrument").undetermined[:, 0].max() < 0.02
    found = predict(arm, q_rad, None, "base")
    assert found.undetermined[:, 0].min() > 0.5
    table = replace(found, std=np.full((5, 6), 2e-3)).table()
    turns = table[["std_orientation_mrad", "undetermined_mrad"]]
    np.testing.assert_allclose(turns, [[12.0**0.5, 1.0]] * 5, rtol=1e-4)


def test_a_vec_model_says_nothing_outside_its_range_and_dh_says_so():
    q_rad = joints("mh180", 3)
    q_rad[1, 2] = robot.load("mh180").q_max_rad[2] - 0.01
    found = predict(calibrated("mh180", "vec"), q_rad)
    assert found.outside.tolist() == [[False] * 6, [False, False, True, False, False, False],
                                      [False] * 6]  # fmt: skip
    for values in (found.pose.position_mm, found.std, found.std_position_mm, found.undetermined):
        assert np.isnan(values[1]).all()
        assert np.isfinite(values[[0, 2]]).all()
    extrapolated = predict(calibrated("mh180", "dh"), q_rad)
    assert np.isfinite(extrapolated.pose.position_mm).all()
    assert extrapolated.outside[1, 2]
