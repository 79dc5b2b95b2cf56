"""Inverse of arms of every kind: verified, complete, named, within limits."""

from __future__ import annotations

from dataclasses import replace

import arms
import numpy as np
import pytest

from kinacc.errors import InputError
from kinacc.geometry import Pose
from kinacc.kinematics import dh, inverse, robot, vec
from kinacc.kinematics.inverse import Status, kernels, limits, numeric, search
from kinacc.kinematics.inverse.chain_rows import rows_of, targets_of

UR10, IIWA = robot.load("ur10"), robot.load("iiwa14")
SEARCHED = [
    arms.OFFSET_WRIST,
    arms.GENERAL,
    arms.STANFORD,
    arms.SCARA,
    arms.FIVE,
    arms.ON_A_TRACK,
    arms.OFFSET_ELBOW,
]


def few(arm: robot.Robot) -> int:
    return 12 if arm.dh.joints == 7 else 200


@pytest.mark.parametrize("arm", [UR10, IIWA, *SEARCHED], ids=lambda arm: arm.name)
def test_what_is_found_is_verified_and_the_start_is_among_it(arm):
    q = arms.joints_within(arm, few(arm))
    pose = dh.forward(arm.dh, q)
    solved = inverse.solve(arm, arm.dh, pose)
    assert solved.branches == inverse.branches_of(arm)
    assert len(set(solved.branches)) == len(solved.branches)
    arms.assert_verified(arm.dh, pose, solved)
    assert arms.share_missed(arm, q, solved) <= 0.01
    inside = solved.status == Status.FOUND
    assert limits.within_limits(arm, solved.q_rad[inside]).all()
    outside = solved.status == Status.OUTSIDE_LIMITS
    assert not limits.within_limits(arm, solved.q_rad[outside]).any()
    assert not (solved.status == Status.NOT_CONVERGED).any()


@pytest.mark.parametrize(
    "arm", [UR10, IIWA, arms.OFFSET_WRIST, arms.STANFORD], ids=lambda arm: arm.name
)
def test_calibrated_arms_are_found_too(arm):
    model = arms.calibrated(arm)
    q = arms.joints_within(arm, few(arm))
    pose = dh.forward(model, q)
    solved = inverse.solve(arm, model, pose)
    arms.assert_verified(model, pose, solved)
    assert arms.share_missed(arm, q, solved) <= 0.01


@pytest.mark.parametrize("arm", [UR10, arms.OFFSET_WRIST, arms.GENERAL], ids=lambda arm: arm.name)
def test_a_dense_multistart_finds_nothing_more(arm):
    q = arms.joints_within(arm, 6, seed=3)
    pose = dh.forward(arm.dh, q)
    solved = inverse.solve(arm, arm.dh, pose)
    rows, targets = rows_of(arm.dh), targets_of(pose)
    for row in range(len(q)):
        start = np.random.default_rng(row).uniform(-np.pi, np.pi, (2000, 6))
        goal = np.repeat(targets[[row]], len(start), axis=0)
        kernels.refine(rows, goal, start, 60, 1e-9)
        there = dh.forward(arm.dh, start)
        hit = np.abs(there.position_mm - pose.position_mm[row]).max(axis=1) < 1e-7
        hit &= np.abs(there.rotation - pose.rotation[row]).max(axis=(1, 2)) < 1e-9
        listed = solved.q_rad[row][np.isfinite(solved.q_rad[row, :, 0])]
        distance = arms.apart(arm, start[hit][:, None], listed[None])
        assert hit.sum() > 50
        assert distance.min(axis=1).max() < 1e-4
        assert np.unique(distance.argmin(axis=1)).size == len(listed)


def test_the_search_agrees_with_the_closed_form_of_parallel_axes():
    pose = dh.forward(UR10.dh, arms.joints_within(UR10, 300, seed=8))
    closed = inverse.solve(UR10, UR10.dh, pose)
    table = search.table_of(UR10.dh, *limits.dh_limits(UR10))
    found = search.search(table, pose)
    assert (found.error_mm[np.isfinite(found.error_mm)] < 1e-6).all()
    for row in range(300):
        listed = closed.q_rad[row][np.isfinite(closed.q_rad[row, :, 0])]
        mine = found.q_rad[row][np.isfinite(found.error_mm[row])]
        distance = arms.apart(UR10, listed[:, None], mine[None])
        assert distance.min(axis=0).max() < 1e-4  # the search invents nothing
        if len(mine) != len(listed):  # and misses only beside a singular wrist
            assert np.abs(np.sin(listed[:, 4])).min() < 0.02


@pytest.mark.parametrize("arm", [UR10, arms.OFFSET_WRIST, arms.STANFORD], ids=lambda a: a.name)
def test_branches_do_not_depend_on_the_batch_and_follow_a_path(arm):
    start, end = arms.joints_within(arm, 2, seed=4)
    q = start + np.linspace(0.0, 0.02, 15)[:, None] * (end - start)
    pose = dh.forward(arm.dh, q)
    whole = inverse.solve(arm, arm.dh, pose)
    alone = inverse.solve(arm, arm.dh, arms.pick(pose, [7]))
    assert np.array_equal(alone.status[0], whole.status[7])
    found = np.isfinite(alone.q_rad[0])
    assert np.abs(alone.q_rad[0] - whole.q_rad[7])[found].max() < 1e-9
    near = arms.apart(arm, whole.q_rad, q[:, None])
    column = np.nanargmin(np.where(np.isnan(near), np.inf, near), axis=1)
    assert (column == column[0]).all()


def test_some_branches_are_that_part_of_all():
    pose = dh.forward(UR10.dh, arms.joints_within(UR10, 40))
    everything = inverse.solve(UR10, UR10.dh, pose)
    chosen = ("back-down-flip", "front-up-noflip")
    part = inverse.solve(UR10, UR10.dh, pose, chosen)
    columns = [everything.branches.index(name) for name in chosen]
    assert np.array_equal(part.q_rad, everything.q_rad[:, columns], equal_nan=True)
    with pytest.raises(InputError, match="has no branch front"):
        inverse.solve(UR10, UR10.dh, pose, ("front",))


def test_the_freedom_of_seven_axes_is_sampled_where_it_is_asked_for():
    grid = np.deg2rad([-20.0, 35.0])
    q = arms.joints_within(IIWA, 5)
    q[:, 0] = grid[1]
    solved = inverse.solve(IIWA, IIWA.dh, dh.forward(IIWA.dh, q), grid_rad=grid)
    assert solved.branches[0].startswith("q1=-20deg ")
    assert {name.split()[0] for name in solved.branches} == {"q1=-20deg", "q1=35deg"}
    for column, name in enumerate(solved.branches):
        first = solved.q_rad[:, column, 0]
        value = grid[0] if name.startswith("q1=-20") else grid[1]
        assert np.allclose(first[np.isfinite(first)], value, atol=0)
    assert arms.share_missed(IIWA, q, solved) == 0.0
    assert np.rad2deg(numeric.grid_of(IIWA)) == pytest.approx(np.arange(-150, 151, 30))


def test_coupled_joints_keep_the_limits_of_what_is_reported():
    coupling = np.eye(6)
    coupling[2, 1] = 1.0
    arm = replace(arms.OFFSET_WRIST, joint_map=coupling, q_min_rad=np.full(6, -1.0))
    solved = inverse.solve(arm, arm.dh, dh.forward(arm.dh, arms.joints_within(arm, 40)))
    inside = solved.status == Status.FOUND
    reported = limits.reported_joints(arm, solved.q_rad[inside])
    assert limits.within(reported, arm.q_min_rad, arm.q_max_rad).all()


@pytest.mark.parametrize("arm", [UR10, arms.STANFORD], ids=lambda arm: arm.name)
def test_a_vec_model_is_inverted_over_its_range(arm):
    low, high = limits.dh_limits(arm)
    low, high = np.maximum(low, np.where(arm.dh.prismatic, low, -3.0)), np.minimum(high, 2000.0)
    high = np.where(arm.dh.prismatic, high, np.minimum(high, 3.0))
    plain = vec.without_errors(arm.dh, low, high, 3)
    noise = np.random.default_rng(2).normal(size=plain.coefficients.shape)
    model = replace(plain, coefficients=noise * np.array([0.1] * 3 + [1e-4] * 3)[:, None])
    q = np.random.default_rng(3).uniform(low, high, (60, 6))
    pose = vec.pose(model, q)
    solved = inverse.solve(arm, model, pose, fitted_range_rad=(low, high))
    rows, columns = np.nonzero(solved.status == Status.FOUND)
    reached = vec.pose(model, solved.q_rad[rows, columns])
    assert np.abs(reached.position_mm - pose.position_mm[rows]).max() < 1e-6
    assert limits.within(solved.q_rad[rows, columns], low, high).all()
    assert arms.share_missed(arm, q, solved) <= 0.02


def test_out_of_reach_is_said():
    pose = Pose(np.eye(3)[None], np.array([[9000.0, 0.0, 0.0]]))
    for arm in (UR10, IIWA, arms.OFFSET_WRIST, arms.STANFORD):
        solved = inverse.solve(arm, arm.dh, pose)
        assert (solved.status == Status.OUT_OF_REACH).all()
        assert np.isnan(solved.q_rad).all()


def test_machining_branches_face_the_work_with_the_elbow_up():
    assert inverse.machining_branches(UR10) == ("front-up-noflip", "front-up-flip")
    assert inverse.machining_branches(arms.OFFSET_WRIST)[:2] == (
        "front-up-noflip",
        "front-up-flip",
    )
    assert inverse.machining_branches(IIWA) == inverse.branches_of(IIWA)


def test_an_elbow_is_up_above_the_floor_even_where_axis_1_points_down():
    turned = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    arm = replace(robot.load("mh180"), base=turned)
    q = np.deg2rad([[10.0, 20.0, -35.0, 30.0, 60.0, 20.0], [10.0, 60.0, -120.0, 30.0, 60.0, 20.0]])
    for joints in q:
        frames = dh.chain(arm.dh, joints[None]).position_mm[0]
        shoulder, elbow, wrist = (frames[row, [0, 2]] for row in (1, 2, 4))
        reach = wrist - shoulder
        aside = reach[0] * (elbow - shoulder)[1] - reach[1] * (elbow - shoulder)[0]
        solved = inverse.solve(arm, arm.dh, dh.forward(arm.dh, joints[None]))
        near = np.linalg.norm(np.nan_to_num(solved.q_rad[0], nan=9.0) - joints, axis=1).argmin()
        worked_in = solved.branches[near] in inverse.machining_branches(arm)
        assert worked_in == (aside < 0.0)  # above the line to the wrist once turned over


# --- compiled and plain ---------------------------------------------------------------------------


def test_compiled_steps_are_those_of_the_models():
    for arm in (arms.GENERAL, arms.STANFORD):
        q = arms.joints_within(arm, 5)
        frames = dh.chain(arm.dh, q)
        rows = rows_of(arm.dh)
        axes, origins, end = np.empty((6, 3)), np.empty((6, 3)), np.empty((3, 4))
        for row in range(5):
            kernels.end_of(rows, q[row], axes, origins, end)
            assert np.allclose(end[:, 3], frames.position_mm[row, -1], atol=1e-9)
            assert np.allclose(end[:, :3], frames.rotation[row, -1], atol=1e-12)
            assert np.allclose(axes, frames.rotation[row, :-1, :, 2], atol=1e-12)
            assert np.allclose(origins, frames.position_mm[row, :-1], atol=1e-9)


def test_compiled_refinement_is_the_plain_one():
    arm = arms.STANFORD
    q = arms.joints_within(arm, 3)
    targets, rows = targets_of(dh.forward(arm.dh, q)), rows_of(arm.dh)
    fast, plain = q + 0.05, q + 0.05
    kernels.refine(rows, targets, fast, 40, 1e-9)
    kernels.refine.py_func(rows, targets, plain, 40, 1e-9)
    assert np.allclose(fast, plain, atol=1e-6)
    assert arms.apart(arm, fast, q).max() < 1e-6
