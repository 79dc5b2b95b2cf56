"""Inverse solutions against forward kinematics by 4x4 loop and a brute-force search."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import inverse as brute
from oracles import kinematics as oracle

from kinacc import geometry, robot
from kinacc.inverse import closed_form

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
    solutions, reached = closed_form.solve(arm, as_pose(target))
    for solution in solutions[0][reached[0]]:
        gap = brute.pose_error(target, oracle.dh_forward(oracle.MH180, solution))
        assert np.abs(gap[:3]).max() < 1e-6
        assert np.abs(gap[3:]).max() < 1e-8
    # The six-fold start stands in the list unless the wrist is aligned, where it is not unique.
    if abs(np.sin(q[4])) > 1e-3:
        assert any(brute.same_turn(q, found) for found in solutions[0][reached[0]])


@pytest.mark.parametrize("seed", [1, 3, 7])
def test_closed_form_finds_all_that_brute_force_finds(arm, seed):
    rng = np.random.default_rng(seed)
    target = oracle.dh_forward(oracle.MH180, rng.uniform(LOW, HIGH))
    solutions, reached = closed_form.solve(arm, as_pose(target))
    found = brute.all_solutions(
        lambda q: brute.dh_step(oracle.MH180, q), target, rng.uniform(-np.pi, np.pi, (120, 6))
    )
    assert len(found) == reached.sum()
    for q in found:
        assert any(brute.same_turn(q, other) for other in solutions[0][reached[0]])
