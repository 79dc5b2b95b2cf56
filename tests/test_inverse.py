"""Closed form, refinement, limits and turns of the inverse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import dh, inverse, robot, vec
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse import BRANCHES, Status, closed_form, limits, newton

ARM = robot.load("mh180")
# Table II of the paper, q5 offset read as -3.141.
TABLE_II = DHModel(
    [0.001, -1.568, 0.001, -3.142, -3.141, 0.002],
    [-1.157, -0.898, 0.066, -1226.154, -0.104, -224.698],
    [323.453, 1151.356, 299.501, 0.029, 0.026, 0.028],
    [-1.573, 3.140, -1.571, -1.571, -1.571, 3.142],
    np.zeros(6),
)
# A FANUC R-2000iC/165F as its measured data set describes it: other signs, offsets and twists.
FANUC = DHModel(
    np.deg2rad([0, -90, 0, 0, 0, 0]),
    [670, 0, 0, 1280, 0, 215],
    [312, 1075, 225, 0, 0, 0],
    np.deg2rad([-90, 0, -90, 90, -90, 0]),
    np.zeros(6),
)


def sideways(model: DHModel) -> DHModel:
    """The arm with a shoulder offset and a tilted, shifted flange."""
    return replace(
        model,
        d_mm=model.d_mm + np.array([0, 80, 25, 0, 0, 0]),
        a_mm=model.a_mm + np.array([0, 0, 0, 0, 0, 40]),
        beta_rad=np.array([0, 0, 0, 0, 0, 0.3]),
    )


def random_joints(seed: int, count: int, lower=None, upper=None) -> np.ndarray:
    lower = ARM.q_min_rad if lower is None else lower
    upper = ARM.q_max_rad if upper is None else upper
    return np.random.default_rng(seed).uniform(lower, upper, (count, 6))


def pick(pose: Pose, rows: np.ndarray) -> Pose:
    return Pose(pose.rotation[rows], pose.position_mm[rows])


def apart(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Largest difference (...) of joints (..., k) but for whole turns."""
    difference = first - second
    return np.abs(difference - 2 * np.pi * np.rint(difference / (2 * np.pi))).max(axis=-1)


def gap(goal: Pose, actual: Pose) -> tuple[float, float]:
    return (
        np.abs(goal.position_mm - actual.position_mm).max(initial=0.0),
        np.abs(goal.rotation - actual.rotation).max(initial=0.0),
    )


# --- closed form ----------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [ARM.dh, FANUC, sideways(ARM.dh), sideways(FANUC)])
def test_every_branch_returns_to_the_pose_and_the_start_is_among_them(model):
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (2000, 6))
    pose = dh.forward(model, q)
    found, reached = closed_form.solve(closed_form.recognise(model), pose)
    rows, columns = np.nonzero(reached)
    position, rotation = gap(pick(pose, rows), dh.forward(model, found[rows, columns]))
    assert position < 1e-8
    assert rotation < 1e-12
    nearest = np.where(reached, apart(found, q[:, None]), np.inf).min(axis=1)
    assert np.quantile(nearest, 0.99) < 1e-9
    assert (
        nearest.max() < 1e-6
    )  # beside a singular posture the angles lose digits, the pose does not


def test_branches_are_told_apart_by_what_their_names_say():
    q = random_joints(2, 500)
    pose = dh.forward(ARM.dh, q)
    found, reached = closed_form.solve(closed_form.recognise(ARM.dh), pose)
    for number, name in enumerate(BRANCHES):
        rows = reached[:, number]
        joints = found[rows, number]
        frames = dh.chain(ARM.dh, joints).position_mm
        facing = np.stack([np.cos(joints[:, 0]), np.sin(joints[:, 0])], axis=1)
        outward = np.einsum("ni,ni->n", facing, frames[:, 5, :2])
        shoulder, elbow, centre = frames[:, 1], frames[:, 2], frames[:, 5]
        reach = np.einsum("ni,ni->n", facing, (centre - shoulder)[:, :2])
        lift = np.einsum("ni,ni->n", facing, (elbow - shoulder)[:, :2])
        above = reach * (elbow - shoulder)[:, 2] - (centre - shoulder)[:, 2] * lift
        front, up, noflip = ("front" in name), ("up" in name), ("noflip" in name)
        assert (outward[np.abs(outward) > 1e-6] > 0).all() == front
        assert ((above > 0) == (up == front)).all()
        assert ((joints[:, 4] > 0) == noflip).all()


def test_a_choice_of_branches_is_that_part_of_all_of_them():
    pose = dh.forward(ARM.dh, random_joints(3, 50))
    arm = closed_form.recognise(ARM.dh)
    everything, reached = closed_form.solve(arm, pose)
    chosen = ("back-down-flip", "front-up-noflip")
    part, part_reached = closed_form.solve(arm, pose, chosen)
    columns = [BRANCHES.index(name) for name in chosen]
    assert np.array_equal(part, everything[:, columns])
    assert np.array_equal(part_reached, reached[:, columns])


def test_results_do_not_depend_on_the_size_of_the_batch():
    pose = dh.forward(TABLE_II, random_joints(4, 3000))
    whole = inverse.solve(ARM, TABLE_II, pose)
    rows = np.array([0, 1, 2047, 2048, 2999])
    alone = inverse.solve(ARM, TABLE_II, pick(pose, rows))
    assert np.array_equal(alone.status, whole.status[rows])
    same = alone.status == Status.FOUND
    assert np.abs(alone.q_rad[same] - whole.q_rad[rows][same]).max() < 1e-12


def test_out_of_reach_is_said_and_not_solved():
    pose = Pose(np.eye(3)[None], np.array([[5000.0, 0.0, 0.0]]))
    assert not closed_form.solve(closed_form.recognise(ARM.dh), pose)[1].any()
    solved = inverse.solve(ARM, TABLE_II, pose)
    assert (solved.status == Status.OUT_OF_REACH).all()
    assert np.isnan(solved.q_rad).all()


def test_stretched_and_aligned_arms_are_reached():
    straight = np.arctan2(1225.0, 300.0)
    q = np.array([[0.3, 0.2, straight, 0.4, 0.5, 0.6], [0.3, 0.2, 0.1, 0.4, 0.0, 0.6], [0.0] * 6])
    pose = dh.forward(ARM.dh, q)
    found, reached = closed_form.solve(closed_form.recognise(ARM.dh), pose)
    assert reached[:, :4].all()
    for branch in range(4):
        position, rotation = gap(pose, dh.forward(ARM.dh, found[:, branch]))
        assert position < 1e-4  # at full stretch a rounding error of the pose costs its square root
        assert rotation < 1e-7


def test_arms_without_a_closed_form_are_told_apart_with_the_reasons():
    assert inverse.closed_form_of(robot.load("iiwa14")) is None
    assert "wrist is not spherical" in str(closed_form.missing_properties(robot.load("ur10").dh))
    assert closed_form.recognise(TABLE_II) is None
    assert closed_form.missing_properties(ARM.dh) == []


# --- refinement -----------------------------------------------------------------------------------


def test_rotation_error_is_the_rotation_vector_even_half_a_turn_away():
    rng = np.random.default_rng(0)
    vector = rng.normal(size=(200, 3))
    vector *= (np.linspace(0, 3.14, 200) / np.linalg.norm(vector, axis=1))[:, None]
    start = exp_so3(rng.normal(size=(200, 3)))
    zero = np.zeros((200, 3))
    error = newton.pose_error(Pose(exp_so3(vector) @ start, zero), Pose(start, zero))
    assert np.abs(error[:, 3:] - vector).max() < 1e-9


def test_calibrated_arm_keeps_only_verified_solutions_and_finds_the_true_joints():
    q = random_joints(1, 3000)
    pose = dh.forward(TABLE_II, q)
    solved = inverse.solve(ARM, TABLE_II, pose)
    rows, columns = np.nonzero(np.isfinite(solved.q_rad[..., 0]))
    error = newton.pose_error(pick(pose, rows), dh.forward(TABLE_II, solved.q_rad[rows, columns]))
    assert np.linalg.norm(error[:, :3], axis=1).max() < 1e-6
    assert np.linalg.norm(error[:, 3:], axis=1).max() < 1e-9
    distance = np.where(np.isnan(solved.q_rad[..., 0]), np.inf, apart(solved.q_rad, q[:, None]))
    # Doubly singular postures may be missed: 10 of 20,000 random ones were.
    assert np.mean(distance.min(axis=1) > 1e-4) < 0.002


@pytest.mark.parametrize("where", ["wrist", "elbow"])
def test_branches_near_singular_postures_are_verified_or_dropped_and_few_are_dropped(where):
    q = random_joints(7, 2000)
    offset = np.random.default_rng(8).uniform(-0.02, 0.02, 2000)
    if where == "wrist":
        q[:, 4] = offset
    else:
        q[:, 2] = np.arctan2(1225.0, 300.0) + offset
    pose = dh.forward(TABLE_II, q)
    solved = inverse.solve(ARM, TABLE_II, pose)
    rows, columns = np.nonzero(np.isfinite(solved.q_rad[..., 0]))
    error = newton.pose_error(pick(pose, rows), dh.forward(TABLE_II, solved.q_rad[rows, columns]))
    assert np.linalg.norm(error[:, :3], axis=1).max() < 1e-6
    distance = np.where(np.isnan(solved.q_rad[..., 0]), np.inf, apart(solved.q_rad, q[:, None]))
    missed = np.mean(distance.min(axis=1) > 1e-3)
    assert missed < 0.01
    assert np.mean(solved.status == Status.NOT_CONVERGED) < 0.02


def test_the_nominal_arm_misses_nothing_its_closed_form_has():
    pose = dh.forward(ARM.dh, random_joints(9, 5000))
    reached = closed_form.solve(closed_form.recognise(ARM.dh), pose)[1]
    solved = inverse.solve(ARM, ARM.dh, pose)
    assert not (solved.status == Status.NOT_CONVERGED).any()
    assert np.array_equal(np.isfinite(solved.q_rad[..., 0]), reached)


def test_refinement_reports_what_it_could_not_reach():
    start = np.zeros((1, 6))
    goal = Pose(np.eye(3)[None], np.array([[9000.0, 0.0, 0.0]]))
    refined = newton.refine(
        lambda q: dh.forward(ARM.dh, q), lambda q: dh.joint_jacobian(ARM.dh, q), goal, start
    )
    assert not refined.converged[0]
    assert refined.position_error_mm[0] > 1000


# --- limits and turns -----------------------------------------------------------------------------

BOX = np.deg2rad([-360.0] * 6), np.deg2rad([360.0] * 6)


@given(st.lists(st.floats(-12.0, 12.0), min_size=6, max_size=6))
def test_turns_change_joints_by_whole_turns_and_go_nearest_to_zero(angles):
    q = np.array([angles])
    taken = limits.take_turns(q, BOX)
    assert np.allclose(np.rint((taken - q) / (2 * np.pi)), (taken - q) / (2 * np.pi), atol=1e-9)
    assert (np.abs(taken) <= np.pi + 1e-9).all()


def test_turns_prefer_the_fitted_range_then_stay_within_limits():
    q = np.deg2rad([[0, 0, 0, -170.0, 0, 100.0]])
    preferred = (
        np.deg2rad([-90.0] * 3 + [150.0, -90, -300]),
        np.deg2rad([90.0] * 3 + [250.0, 90, -200]),
    )
    taken = np.rad2deg(limits.take_turns(q, BOX, preferred))
    assert np.allclose(taken, [[0, 0, 0, 190.0, 0, -260.0]])
    narrow = np.deg2rad([-180.0] * 6), np.deg2rad([180.0] * 6)
    assert np.allclose(
        np.rad2deg(limits.take_turns(q, narrow, preferred)), [[0, 0, 0, -170, 0, 100]]
    )


def test_half_a_turn_is_plus_half_a_turn_whatever_the_rounding():
    q = np.array([[-np.pi, np.pi, -np.pi - 1e-13, np.pi + 1e-13, 3 * np.pi, -3 * np.pi]])
    assert np.allclose(limits.take_turns(q, BOX), np.pi)


def test_reported_joints_carry_signs_and_couplings():
    coupling = np.diag([1.0, 1, 1, -1, 1, 1])
    coupling[2, 1] = -1.0  # joint 3 is reported against the horizontal
    arm = replace(ARM, joint_map=coupling)
    reported = random_joints(1, 20)
    q = arm.dh_joints(reported)
    assert np.allclose(limits.reported_joints(arm, q), reported)
    assert limits.within_limits(arm, q).all()
    assert limits.uncoupled(arm).tolist() == [True, False, False, True, True, True]
    lower, upper = limits.dh_limits(arm)
    assert np.isinf(lower[1:3]).all()
    assert np.isclose(upper[3], -arm.q_min_rad[3])


def test_solutions_outside_limits_and_fitted_range_say_so():
    q = random_joints(6, 400)
    pose = dh.forward(TABLE_II, q)
    fitted = np.deg2rad([-60.0] * 3 + [-180.0] * 3), np.deg2rad([60.0] * 3 + [180.0] * 3)
    solved = inverse.solve(ARM, TABLE_II, pose, fitted_range_rad=fitted)
    assert set(np.unique(solved.status)) >= {
        Status.FOUND,
        Status.OUTSIDE_LIMITS,
        Status.OUTSIDE_RANGE,
    }
    for status, kept, inside in (
        (Status.FOUND, True, True),
        (Status.OUTSIDE_LIMITS, False, None),
        (Status.OUTSIDE_RANGE, True, False),
    ):
        joints = solved.q_rad[solved.status == status]
        assert (limits.within_limits(ARM, joints) == kept).all()
        if inside is not None:
            assert (limits.within(joints, *fitted) == inside).all()


def test_a_vec_arm_is_solved_on_the_turn_that_is_kept():
    lower, upper = (
        np.deg2rad([-30, -40, -90, 100, -130, -180]),
        np.deg2rad([80, 70, 30, 300, 130, 180]),
    )
    empty = vec.without_errors(TABLE_II, lower, upper, 3)
    noise = np.random.default_rng(2).normal(size=empty.coefficients.shape)
    scale = np.array([0.2] * 3 + [2e-4] * 3)[:, None]
    model = replace(empty, coefficients=noise * scale)
    q = random_joints(4, 200, lower, upper)
    q = q[np.abs(q[:, 4]) > 0.1]
    pose = vec.pose(model, q)
    solved = inverse.solve(ARM, model, pose, fitted_range_rad=(lower, upper))
    rows, columns = np.nonzero(solved.status == Status.FOUND)
    joints = solved.q_rad[rows, columns]
    assert limits.within(joints, lower, upper).all()
    error = newton.pose_error(pick(pose, rows), vec.pose(model, joints))
    assert np.linalg.norm(error[:, :3], axis=1).max() < 1e-6
    distance = np.where(np.isnan(solved.q_rad), 9.0, np.abs(solved.q_rad - q[:, None])).max(axis=2)
    assert (distance.min(axis=1) < 1e-6).mean() > 0.98
