"""Inverse solutions against forward kinematics by 4x4 loop and a brute-force search."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import inverse as brute
from oracles import kinematics as oracle

from kinacc import geometry
from kinacc.kinematics import dh, inverse, robot, vec
from kinacc.kinematics.inverse import closed_form

LOW, HIGH = np.radians(oracle.MH180_LIMITS_DEG).T


def as_pose(*frames: np.ndarray) -> geometry.Pose:
    stack = np.array(frames)
    return geometry.Pose(stack[:, :3, :3], stack[:, :3, 3])


@pytest.fixture(scope="module")
def arm():
    return closed_form.recognise(robot.load("mh180").dh)


@settings(max_examples=150)
@given(seed=st.integers(0, 2**32 - 1))
def test_every_closed_form_solution_reaches_the_pose_and_one_is_the_start(arm, seed):
    q = np.random.default_rng(seed).uniform(LOW, HIGH)
    target = oracle.dh_forward(oracle.MH180, q)
    solutions, reached = arm.solve(as_pose(target))
    for solution in solutions[0][reached[0]]:
        gap = brute.pose_error(target, oracle.dh_forward(oracle.MH180, solution))
        assert np.abs(gap[:3]).max() < 1e-6
        assert np.abs(gap[3:]).max() < 1e-8
    # The six-fold start stands in the list unless the wrist is aligned, where it is not unique.
    if abs(np.sin(q[4])) > 1e-3:
        assert any(brute.same_turn(q, found) for found in solutions[0][reached[0]])


@pytest.mark.parametrize("seed", [1, 3])
def test_closed_form_finds_all_that_brute_force_finds(arm, seed):
    rng = np.random.default_rng(seed)
    target = oracle.dh_forward(oracle.MH180, rng.uniform(LOW, HIGH))
    solutions, reached = arm.solve(as_pose(target))
    found = brute.all_solutions(
        lambda q: brute.dh_step(oracle.MH180, q), target, rng.uniform(-np.pi, np.pi, (90, 6))
    )
    assert len(found) == reached.sum()
    for q in found:
        assert any(brute.same_turn(q, other) for other in solutions[0][reached[0]])


# --- calibrated arms ------------------------------------------------------------------------------


def calibrated(seed: int):
    """A DH table a few tenths of a millimetre and a milliradian off nominal, as Table II is."""
    rng = np.random.default_rng(seed)
    return np.array(oracle.MH180) + rng.normal(size=(6, 5)) * [1e-3, 0.7, 0.7, 1e-3, 3e-4]


def vec_case(seed: int):
    rng = np.random.default_rng(seed)
    scale = np.array([[0.3]] * 3 + [[3e-4]] * 3) / np.arange(1, 7)
    return (
        np.array(oracle.MH180),
        rng.normal(size=(6, 6, 6)) * scale,
        LOW,
        HIGH,
        rng.normal(size=(6, 2)) * 1e-4,
    )


def vec_model(case) -> vec.VECModel:
    table, series, low, high, offsets = case
    return vec.VECModel(dh.DHModel(*table.T), low, high, series, offsets)


def has_joints(solutions: inverse.Solutions) -> np.ndarray:
    return ~np.isnan(solutions.q_rad).any(axis=-1)


def assert_good(solutions, index, target, forward) -> None:
    """All joints reach the pose; those called found keep the limits and take the nearest turn."""
    for q, status in zip(solutions.q_rad[index], solutions.status[index], strict=True):
        if np.isnan(q).any():
            assert status != inverse.Status.FOUND
            continue
        gap = brute.pose_error(target, forward(q))
        assert np.linalg.norm(gap[:3]) <= 1e-6
        assert np.linalg.norm(gap[3:]) <= 1e-8
        inside = bool(((q >= LOW) & (q <= HIGH)).all())
        if status == inverse.Status.FOUND:
            assert inside
            assert np.abs(q).max() <= np.pi + 1e-9
        elif status == inverse.Status.OUTSIDE_LIMITS:
            assert not inside


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1))
def test_dh_solutions_reach_the_pose_and_the_start_is_among_them(seed):
    table, rng = calibrated(seed), np.random.default_rng(seed)
    joints = rng.uniform(LOW, HIGH, (6, 6))
    joints[:, [0, 3, 5]] = rng.uniform(-3.1, 3.1, (6, 3))
    frames = [oracle.dh_forward(table, q) for q in joints]
    solutions = inverse.solve(robot.load("mh180"), dh.DHModel(*table.T), as_pose(*frames))
    for i, (q, frame) in enumerate(zip(joints, frames, strict=True)):
        assert_good(solutions, i, frame, lambda x: oracle.dh_forward(table, x))
        wrist = (oracle.dh_frames(table, q)[4])[:2, 3]
        if abs(np.sin(q[4])) > 0.05 and np.linalg.norm(wrist) > 20 and not stretched(q):
            found = solutions.status[i] == inverse.Status.FOUND
            assert any(brute.same_turn(q, x) for x in solutions.q_rad[i][found])


def stretched(q: np.ndarray) -> bool:
    """Elbow so close to straight that its two solutions may merge or vanish."""
    elbow = np.linalg.det(
        brute.geometric_jacobian(oracle.dh_frames(oracle.MH180, q)[:4])[[0, 1, 2]]
    )
    return abs(elbow) < 1e7


@pytest.mark.parametrize("seed", [0, 1])
def test_vec_solutions_reach_the_projected_pose_and_the_start_is_among_them(seed):
    case, rng = vec_case(seed), np.random.default_rng(seed)
    s = rng.integers(-1, 2, 6)
    joints = rng.uniform(LOW, HIGH, (20, 6))
    joints[:, [0, 3, 5]] = rng.uniform(-3.0, 3.0, (20, 3))
    joints[:, 4] = rng.choice([-1, 1], 20) * rng.uniform(0.3, 2, 20)

    def forward(q):
        return oracle.projected(oracle.vec_forward(*case, q, s))

    frames = [forward(q) for q in joints]
    solutions = inverse.solve(robot.load("mh180"), vec_model(case), as_pose(*frames), travel=s)
    for i, q in enumerate(joints):
        assert_good(solutions, i, frames[i], forward)
        assert any(brute.same_turn(q, x) for x in solutions.q_rad[i][has_joints(solutions)[i]])


@pytest.mark.parametrize("seed", [11, 12])
def test_calibrated_arm_has_all_solutions_that_brute_force_finds(seed):
    table, rng = calibrated(seed), np.random.default_rng(seed)
    q = rng.uniform(LOW, HIGH)
    target = oracle.dh_forward(table, q)
    solutions = inverse.solve(robot.load("mh180"), dh.DHModel(*table.T), as_pose(target))
    listed = solutions.q_rad[0][has_joints(solutions)[0]]
    starts = rng.uniform(-np.pi, np.pi, (90, 6))
    found = brute.all_solutions(lambda x: brute.dh_step(table, x), target, starts)
    assert len(found) >= 4
    for each in found:
        assert any(brute.same_turn(each, other) for other in listed)
