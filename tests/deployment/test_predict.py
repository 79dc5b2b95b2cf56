"""Predicted poses, what the fit knows of them, and what it does not."""

import numpy as np
import pytest
from small_arms import BASE, TOOL, calibrated, joints, truth

from kinacc.calibration.frames import MOTIONS
from kinacc.calibration.uncertainty import is_angle
from kinacc.deployment.predict import predict
from kinacc.deployment.record import nominal
from kinacc.deployment.sensitivity import sensitivity
from kinacc.geometry import Pose, compose, exp_so3, log_so3
from kinacc.kinematics import dh, robot
from kinacc.kinematics.model import JointState


def moved(arm, names, step):
    """The calibration with its named parameters displaced by ``step`` (P,) in mm and rad."""
    from dataclasses import replace

    of = dict(zip(names, step, strict=True))

    def frame(pose, name):
        motion = np.array([of.get(f"{name}.{each}", 0.0) for each in MOTIONS])
        return Pose(exp_so3(motion[3:]) @ pose.rotation, pose.position_mm + motion[:3])

    vector = arm.model.start + [of.get(name, 0.0) for name in arm.model.names]
    model = arm.model.with_parameters(vector)
    targets = {name: frame(pose, name) for name, pose in arm.targets.items()}
    return replace(arm, model=model, base=frame(arm.base, "base"), targets=targets)


@pytest.mark.parametrize("model", ["dh", "vec"])
@pytest.mark.parametrize("frame", ["base", "instrument"])
@pytest.mark.parametrize("point", ["tool", "flange"])
def test_sensitivities_are_the_finite_differences_of_the_pose(model, frame, point):
    arm = calibrated("mh180", model)
    q_rad = joints("mh180", 3, seed=8)
    slopes = sensitivity(arm, JointState(q_rad), frame, point)
    names = arm.known.names
    for column in np.linspace(0, len(names) - 1, 30).astype(int):
        size = 1e-6 if is_angle(names[column]) else 1e-3
        step = size * np.eye(len(names))[column]
        low, high = (
            moved(arm, names, sign * step).pose(JointState(q_rad), frame, point) for sign in (-1, 1)
        )
        shift = (high.position_mm - low.position_mm) / (2 * size)
        turn = log_so3(high.rotation @ np.swapaxes(low.rotation, 1, 2)) / (2 * size)
        np.testing.assert_allclose(slopes[:, :3, column], shift, rtol=1e-5, atol=2e-4)
        np.testing.assert_allclose(slopes[:, 3:, column], turn, rtol=1e-5, atol=1e-8)


def test_predictions_are_as_far_off_as_they_say():
    """Forty calibrations of one arm: errors over standard deviations have unit variance."""
    q_rad = joints("mh180", 12, seed=21)
    wanted = compose(BASE, compose(dh.forward(truth("mh180"), q_rad), TOOL)).position_mm
    scores = []
    for seed in range(100, 140):
        found = predict(calibrated("mh180", "dh", 60, seed), q_rad, None, "instrument")
        scores.append((found.pose.position_mm - wanted) / found.std[:, :3])
    assert np.mean(np.square(scores)) == pytest.approx(1.0, abs=0.25)


def test_undetermined_directions_show_where_the_frame_is_a_convention():
    arm, q_rad = calibrated("mh180", "dh"), joints("mh180", 5)
    # From the instrument to the tool everything was measured; where the base stands was not.
    assert predict(arm, q_rad, None, "instrument").undetermined[:, 0].max() < 0.02
    assert predict(arm, q_rad, None, "base").undetermined[:, 0].min() > 0.5


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


@pytest.mark.parametrize("model", ["dh", "vec"])
@pytest.mark.parametrize("frame", ["base", "instrument"])
@pytest.mark.parametrize("point", ["tool", "flange"])
def test_joint_jacobians_are_the_finite_differences_of_the_pose(model, frame, point):
    arm, step = calibrated("mh180", model), 1e-6
    q_rad = joints("mh180", 4, seed=9)
    s = np.sign(np.random.default_rng(5).normal(size=q_rad.shape))
    slopes = arm.joint_jacobian(JointState(q_rad, s), frame, point)
    for joint in range(q_rad.shape[1]):
        moved = step * np.eye(q_rad.shape[1])[joint]
        low, high = (
            arm.pose(JointState(q_rad + sign * moved, s), frame, point) for sign in (-1, 1)
        )
        shift = (high.position_mm - low.position_mm) / (2 * step)
        turn = log_so3(high.rotation @ np.swapaxes(low.rotation, 1, 2)) / (2 * step)
        np.testing.assert_allclose(slopes[:, :3, joint], shift, atol=1e-5)
        np.testing.assert_allclose(slopes[:, 3:, joint], turn, atol=1e-8)


def test_reported_joints_go_through_the_joint_map():
    arm = nominal(robot.load("fanuc_r2000ic_165f"))
    q_rad = joints("fanuc_r2000ic_165f", 4)
    wanted = robot.forward(arm.robot, q_rad).position_mm
    np.testing.assert_allclose(predict(arm, q_rad).pose.position_mm, wanted, atol=1e-9)
