"""Joints that reach wanted poses: round trips, postures, limits, and rows that have none."""

from dataclasses import replace

import numpy as np
import pytest
from pose_checks import movement
from small_arms import BASE, calibrated, joints, moved

from kinacc.deployment.compensate import PoseStatus, compensate
from kinacc.deployment.predict import predict
from kinacc.deployment.record import nominal
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import robot
from kinacc.kinematics.model import JointState


def left(arm, q_rad, wanted, frame="base"):
    """What the forward model says is left of the wanted poses, mm and rad."""
    seen = predict(arm, q_rad, None, frame).pose
    return np.linalg.norm(movement(wanted, seen).reshape(-1, 2, 3), axis=2).max(axis=0)


@pytest.mark.parametrize("name", ["mh180", "ur10"])
@pytest.mark.parametrize("model", ["dh", "vec"])
def test_joints_come_back_from_their_own_poses(name, model):
    arm, q_rad = calibrated(name, model), joints(name, 30, seed=4)
    wanted = predict(arm, q_rad, None, "instrument").pose
    found = compensate(arm, wanted, q_rad + 0.03, None, "instrument")
    assert (found.status <= PoseStatus.EXTRAPOLATED).all()
    off, turn = left(arm, found.q_rad, wanted, "instrument")
    assert off < 1e-6
    assert turn < 1e-9
    moved = np.abs(found.q_rad - q_rad).max(axis=1)
    assert np.median(moved) < 1e-8
    assert moved.max() < 1e-4  # the wrist of a nearly singular posture is known less well


def test_a_posture_outside_the_limits_is_left_for_another_and_that_is_said():
    arm, q_rad = nominal(robot.load("mh180")), joints("mh180", 1)
    q_rad[0] = [0.1, 0.2, 0.3, 0.2, 1.0, 0.4]
    wanted = predict(arm, q_rad).pose
    # The same pose with the wrist flipped: joint 5 mirrored.
    flipped = compensate(arm, wanted, np.array([0.1, 0.2, 0.3, 0.2 + np.pi, -1.0, 0.4 - np.pi]))
    assert flipped.status[0] == PoseStatus.CONVERGED
    assert flipped.q_rad[0, 4] == pytest.approx(-1.0, abs=1e-6)
    near = compensate(arm, wanted, q_rad)
    assert near.q_rad[0] == pytest.approx(q_rad[0], abs=1e-9)
    fifth = np.arange(6) == 4
    tight = replace(arm.robot, q_max_rad=np.where(fifth, 0.9, arm.robot.q_max_rad))
    found = compensate(replace(arm, robot=tight), wanted, q_rad)
    assert found.status[0] == PoseStatus.OTHER_POSTURE
    assert found.q_rad[0, 4] < 0.0
    assert left(arm, found.q_rad, wanted)[0] < 1e-6
    tighter = replace(tight, q_min_rad=np.where(fifth, -0.9, arm.robot.q_min_rad))
    found = compensate(replace(arm, robot=tighter), wanted, q_rad)
    assert found.status[0] == PoseStatus.OUTSIDE_LIMITS
    assert found.offending[0].tolist() == fifth.tolist()
    assert np.isnan(found.q_rad).all()


def test_joints_given_beyond_the_measured_range_keep_their_posture_in_a_dh_model():
    arm, q_rad = calibrated("mh180", "dh"), np.array([[0.1, 0.2, 0.3, 0.2, 0.5, 0.4]])
    wanted = predict(arm, q_rad).pose
    beyond = np.array([[0.1, 0.2, 0.3, 0.2 + np.pi, -0.5, 0.4 - np.pi]])
    # Too far from it to be that posture at once, and nearer to it than to the measured one.
    found = compensate(arm, wanted, beyond + np.array([0.0, 0.0, 0.0, -0.5, 0.0, 0.5]))
    assert found.status[0] == PoseStatus.EXTRAPOLATED
    np.testing.assert_allclose(found.q_rad, beyond, atol=0.02)
    assert compensate(arm, wanted).status[0] == PoseStatus.CONVERGED


def test_a_vec_model_gives_no_joints_outside_its_range():
    arm = calibrated("mh180", "vec")
    by_dh = calibrated("mh180", "dh")
    q_rad = joints("mh180", 1)
    for turned in (arm.fitted_range_rad[1][0] + 0.05, 2.9):  # nearly there, and turned away
        q_rad[0, 0] = turned
        found = compensate(arm, predict(by_dh, q_rad).pose, q_rad)
        assert found.status[0] == PoseStatus.OUTSIDE_RANGE
        assert found.offending[0, 0]
        assert np.isnan(found.q_rad).all()


def test_each_pose_is_reached_in_its_own_directions_of_travel():
    arm, q_rad = calibrated("mh180", "vec"), joints("mh180", 6, seed=4)
    offsets = [name for name in arm.model.names if name.endswith(("minus", "plus"))]
    errors = 1e-3 * np.random.default_rng(1).normal(size=len(offsets))
    arm = moved(arm, dict(zip(offsets, errors, strict=True)))
    s = np.sign(np.random.default_rng(2).normal(size=q_rad.shape))
    wanted = arm.pose(JointState(q_rad, s))
    found = compensate(arm, wanted, q_rad + 0.03, s)
    np.testing.assert_allclose(found.q_rad, q_rad, rtol=0, atol=1e-5)
    assert np.abs(compensate(arm, wanted, q_rad + 0.03).q_rad - q_rad).max() > 1e-4


def test_the_base_is_the_same_under_dh_and_vec():
    """Base and tool of a VEC fit may drift against each other where no measured pose shows it."""
    arms = [calibrated("mh180", model) for model in ("dh", "vec")]
    arms = [replace(arm, robot=replace(arm.robot, base=BASE)) for arm in arms]
    q_rad = joints("mh180", 5)
    own = compose(invert(arms[0].base), arms[1].pose(JointState(q_rad), "instrument"))
    own = compose(BASE, own)
    seen = arms[1].pose(JointState(q_rad), "base")
    np.testing.assert_allclose(seen.position_mm, own.position_mm, rtol=0, atol=1e-9)
    std = [predict(arms[1], q_rad, None, frame).std_position_mm for frame in ("base", "instrument")]
    np.testing.assert_allclose(std[0], std[1], rtol=1e-9)


def test_a_pose_out_of_reach_has_no_joints():
    far = Pose(np.eye(3)[None], np.array([[9000.0, 0.0, 0.0]]))
    with pytest.raises(InputError, match="no number in row 0"):
        compensate(calibrated("mh180", "dh"), far._replace(position_mm=np.full((1, 3), np.nan)))
    found = compensate(calibrated("mh180", "dh"), far)
    assert found.status.tolist() == [PoseStatus.NOT_REACHED]
    assert np.isnan(found.q_rad).all()


def test_whole_turns_stay_near_the_joints_given():
    arm, q_rad = nominal(robot.load("mh180")), joints("mh180", 1)
    q_rad[0] = [0.1, 0.2, 0.3, np.deg2rad(350.0), 1.0, np.deg2rad(-350.0)]
    wanted = predict(arm, q_rad).pose
    found = compensate(arm, wanted, q_rad + 0.01)
    assert found.q_rad[0] == pytest.approx(q_rad[0], abs=1e-8)


def test_seven_axes_stay_where_they_are_asked_to():
    arm, q_rad = nominal(robot.load("iiwa14")), joints("iiwa14", 10)
    wanted = predict(arm, q_rad).pose
    found = compensate(arm, wanted, q_rad + 0.05)
    assert (found.status == PoseStatus.CONVERGED).all()
    assert left(arm, found.q_rad, wanted)[0] < 1e-6
    assert np.abs(found.q_rad - q_rad).max() < 0.5
