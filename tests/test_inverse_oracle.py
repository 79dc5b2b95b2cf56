"""Inverse solutions against forward kinematics by 4x4 loop and a brute-force search."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import inverse as brute
from oracles import kinematics as oracle

from kinacc import geometry
from kinacc.kinematics import dh, inverse, robot
from kinacc.kinematics.inverse import closed_form

LOW, HIGH = np.radians(oracle.MH180_LIMITS_DEG).T


def as_pose(*frames: np.ndarray) -> geometry.Pose:
    stack = np.array(frames)
    return geometry.Pose(stack[:, :3, :3], stack[:, :3, 3])


@pytest.fixture(scope="module")
def arm():
    return closed_form.recognise(robot.load("mh180").dh)


def test_closed_form_finds_all_that_brute_force_finds(arm):
    rng = np.random.default_rng(1)
    target = oracle.dh_forward(oracle.MH180, rng.uniform(LOW, HIGH))
    solutions, reached = arm.solve(as_pose(target))
    found = brute.all_solutions(
        lambda q: brute.dh_step(oracle.MH180, q), target, rng.uniform(-np.pi, np.pi, (90, 6))
    )
    assert len(found) == reached.sum()
    for q in found:
        assert any(brute.same_turn(q, other) for other in solutions[0][reached[0]])


def test_calibrated_arm_has_all_solutions_that_brute_force_finds():
    """Of a DH table a few tenths of a millimetre and a milliradian off nominal, as Table II is."""
    rng = np.random.default_rng(11)
    table = np.array(oracle.MH180) + rng.normal(size=(6, 5)) * [1e-3, 0.7, 0.7, 1e-3, 3e-4]
    target = oracle.dh_forward(table, rng.uniform(LOW, HIGH))
    solutions = inverse.solve(robot.load("mh180"), dh.DHModel(*table.T), as_pose(target))
    listed = solutions.q_rad[0][np.isfinite(solutions.q_rad[0]).all(axis=-1)]
    starts = rng.uniform(-np.pi, np.pi, (90, 6))
    found = brute.all_solutions(lambda x: brute.dh_step(table, x), target, starts)
    assert len(found) >= 4
    for each in found:
        assert any(brute.same_turn(each, other) for other in listed)
