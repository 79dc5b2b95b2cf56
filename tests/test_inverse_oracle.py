"""Inverse solutions against forward kinematics by 4x4 loop and a brute-force search."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import inverse as brute
from oracles import kinematics as oracle

from kinacc import geometry
from kinacc.kinematics import dh, inverse, robot

LOW, HIGH = np.radians(oracle.MH180_LIMITS_DEG).T


@pytest.mark.parametrize("off", [0.0, 1.0])
def test_an_arm_has_all_solutions_that_brute_force_finds(off):
    """Nominal, in closed form, and a few tenths of a millimetre off, as Table II is."""
    rng = np.random.default_rng(11)
    table = np.array(oracle.MH180)
    table += off * rng.normal(size=(6, 5)) * [1e-3, 0.7, 0.7, 1e-3, 3e-4]
    target = oracle.dh_forward(table, rng.uniform(LOW, HIGH))
    pose = geometry.Pose(target[None, :3, :3], target[None, :3, 3])
    solutions = inverse.solve(robot.load("mh180"), dh.DHModel(*table.T), pose)
    listed = solutions.q_rad[0][np.isfinite(solutions.q_rad[0]).all(axis=-1)]
    starts = rng.uniform(-np.pi, np.pi, (90, 6))
    found = brute.all_solutions(table, target, starts)
    assert len(found) >= 4
    for q in found:
        assert any(brute.same_turn(q, other) for other in listed)
