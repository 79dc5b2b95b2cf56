"""What poses tell of an arm: directions nobody sees are those of the fit, in its words."""

import numpy as np
import paper_settings as paper
import pytest

from kinacc.calibration import dh_fit
from kinacc.calibration.blind_words import sentences
from kinacc.calibration.observations import full_poses
from kinacc.deployment.planning import candidates
from kinacc.deployment.planning.information import information
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot

TOOL = Pose(exp_so3(np.array([0.1, -0.3, 0.2])), np.array([40.0, 15.0, 120.0]))


@pytest.mark.parametrize(("name", "hayati"), [("mh180", ()), ("ur10", (2, 3)), ("irb120", ())])
def test_the_rank_is_that_of_a_fit_to_the_same_poses(name, hayati):
    arm = robot.load(name)
    joints = candidates.spread(arm, 120)
    told = information(arm, joints, paper.experiment(TOOL, hayati_joints=hayati))
    q_dh = joints @ arm.joint_map.T
    seen = compose(dh.forward(arm.dh, q_dh), TOOL)
    fit = dh_fit.fit(
        full_poses(q_dh, seen),
        arm.dh,
        free=dh_fit.free_parameters(6, hayati),
        rotation_weight_mm_per_rad=500.0,
        threshold=1e-3,
    )
    assert told.rank == 12 + fit.solution.spectrum.rank
    assert told.rows.shape == (120, 6, told.rank)


def test_rows_times_displacement_are_the_movement_of_the_pose():
    """Norms survive the projection: a determined displacement moves poses by what rows say."""
    arm = robot.load("mh180")
    joints = candidates.spread(arm, 50)
    told = information(arm, joints, paper.experiment(TOOL, frames_estimated=False))
    step = np.zeros(30)
    step[2 + 5] = 1e-4  # a of joint 2, mm
    low, high = (
        compose(
            dh.forward(dh.with_vector(arm.dh, dh.to_vector(arm.dh) + sign * step), joints), TOOL
        )
        for sign in (-1, 1)
    )
    moved = np.linalg.norm(high.position_mm - low.position_mm, axis=1) / 2e-4
    column = told.names.index("j2.a_mm")
    stacked = told.rows.reshape(-1, told.rank)
    values = np.linalg.svd(stacked, compute_uv=False)
    np.testing.assert_allclose(values, told.values[: told.rank], rtol=1e-9)
    assert column == 6
    np.testing.assert_allclose(moved, 1.0, atol=1e-9)  # a is a shift of the whole rest of the arm


def test_what_no_candidate_shows_is_said_as_of_a_fit():
    arm = robot.load("mh180")
    told = information(arm, candidates.spread(arm, 100), paper.experiment(TOOL))
    assert tuple(sentences(told.left_open)) == (
        "theta of joint 1 cannot be told from a turn of the base about the axis of joint 1",
        "d of joint 1 cannot be told from a shift of the base along the axis of joint 1",
        "d of joint 2 and d of joint 3 appear only as their difference",
        "theta of joint 6 cannot be told from a turn of the tool about z of the last frame",
        "d of joint 6 cannot be told from a shift of the tool along z of the last frame",
        "a of joint 6 cannot be told from a shift of the tool along x of the last frame",
        "alpha of joint 6 cannot be told from a turn of the tool about x of the last frame",
    )


def test_what_other_candidates_would_show_is_said_to_be_so():
    arm = robot.load("mh180")
    joints = candidates.spread(arm, 100)
    joints[:, 3] = 0.3
    said = sentences(information(arm, joints, paper.experiment(TOOL)).left_open)
    weak = [words for words in said if "others may" in words]
    assert weak
    assert all("joint 3" in words or "joint 4" in words for words in weak)
    assert "d of joint 2 and d of joint 3 appear only as their difference" in said


def test_a_point_on_the_last_axis_shows_no_turn_of_it():
    arm = robot.load("ur10")
    on_axis = Pose(np.eye(3), np.array([0.0, 0.0, 100.0]))
    told = information(
        arm, candidates.spread(arm, 100), paper.experiment(on_axis, orientation=False)
    )
    assert "theta of joint 6 changes no measured pose" in sentences(told.left_open)


def test_candidates_are_where_they_were_asked_to_be():
    arm = robot.load("mh180")

    def inside(position_mm):
        return (position_mm[:, 2] > 0.0) & (position_mm[:, 0] > 800.0)

    joints = candidates.spread(arm, 60, None, inside, TOOL)
    tool = compose(dh.forward(arm.dh, joints), TOOL).position_mm
    assert inside(tool).all()
    assert (joints >= arm.q_min_rad).all()
    assert (joints <= arm.q_max_rad).all()
    assert len(np.unique(joints, axis=0)) == 60
    with pytest.raises(InputError, match="only 0 of"):
        candidates.spread(arm, 10, None, lambda position_mm: position_mm[:, 0] > 9000.0)
    low, high = arm.q_min_rad.copy(), arm.q_max_rad.copy()
    low[2], high[2] = 4.0, 5.0
    with pytest.raises(InputError, match="joint 3"):
        candidates.spread(arm, 10, (low, high))
