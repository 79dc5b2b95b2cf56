"""What poses tell of an arm: directions nobody sees are those of the fit, in readable words."""

import numpy as np
import pytest

from kinacc import robot
from kinacc.calibrated.blind import in_words
from kinacc.calibration import dh_fit
from kinacc.calibration.observations import full_poses
from kinacc.errors import InputError
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.models import dh
from kinacc.planning import candidates
from kinacc.planning.information import Experiment, information

TOOL = Pose(exp_so3(np.array([0.1, -0.3, 0.2])), np.array([40.0, 15.0, 120.0]))


@pytest.mark.parametrize(("name", "hayati"), [("mh180", ()), ("ur10", (2, 3)), ("irb120", ())])
def test_the_rank_is_that_of_a_fit_to_the_same_poses(name, hayati):
    arm = robot.load(name)
    joints = candidates.spread(arm, 120)
    told = information(arm, joints, Experiment(TOOL, hayati_joints=hayati))
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
    assert len(told.excluded) == len(told.names) - told.rank
    assert told.rows.shape == (120, 6, told.rank)


def test_rows_times_displacement_are_the_movement_of_the_pose():
    """Norms survive the projection: a determined displacement moves poses by what rows say."""
    arm = robot.load("mh180")
    joints = candidates.spread(arm, 50)
    told = information(arm, joints, Experiment(TOOL, frames_estimated=False))
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


def test_words_name_the_parameters_that_cannot_be_told_apart():
    arm = robot.load("mh180")
    told = information(arm, candidates.spread(arm, 100), Experiment(TOOL))
    said = {frozenset(part.split()[0] for part in _parts(words)) for words in told.excluded}
    assert frozenset({"j2.d", "j3.d"}) in said
    assert frozenset({"base.rz", "j1.theta_offset"}) in said
    assert frozenset({"base.z", "j1.d"}) in said
    assert len(told.excluded) == 7


def _parts(words):
    return words.replace(" with ", ", ").split(", ")


def test_words_do_not_depend_on_how_the_space_is_mixed():
    names = ("j1.d_mm", "base.z_mm", "j1.theta_offset_rad", "base.rz_rad", "j2.a_mm")
    plain = np.array([[1.0, -1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0, 0.0]]) / np.sqrt(2.0)
    angle = 0.7
    mixed = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]) @ plain
    for space in (plain, mixed):
        parts = {frozenset(_parts(words)) for words in in_words(space, names)}
        stems = {frozenset(part.split()[0] for part in each) for each in parts}
        assert stems == {
            frozenset({"j1.d", "base.z"}),
            frozenset({"j1.theta_offset", "base.rz"}),
        }


def test_a_point_on_the_last_axis_shows_no_turn_of_it():
    arm = robot.load("ur10")
    on_axis = Pose(np.eye(3), np.array([0.0, 0.0, 100.0]))
    told = information(arm, candidates.spread(arm, 100), Experiment(on_axis, orientation=False))
    assert any(words == "j6.theta_offset +1 mrad" for words in told.excluded)


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
