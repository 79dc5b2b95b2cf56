"""The models against a plain 4x4 loop; their slopes are held to them in ``kinematics``."""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracles import kinematics as oracle
from pose_checks import assert_same, of_matrices

from kinacc.kinematics import chain, dh, vec
from kinacc.kinematics.model import JointState


def dh_table(rng, joints):
    length = rng.uniform(-1500, 1500, (joints, 2))
    angle = rng.uniform(-math.pi, math.pi, (joints, 3))
    return np.column_stack([angle[:, :1], length, angle[:, 1:]])


# --- DH, eqs. 1-4 ---------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(15))
def test_dh_chain_equals_the_plain_loop(seed):
    rng = np.random.default_rng(seed)
    table, q = dh_table(rng, 5), rng.uniform(-2 * math.pi, 2 * math.pi, (2, 5))
    expected = of_matrices([oracle.dh_frames(table, row) for row in q])
    assert_same(dh.chain(dh.DHModel(*table.T), q), expected, 1e-9, 1e-12)


# --- VEC, eqs. 5-6 --------------------------------------------------------------------------------


@pytest.mark.parametrize("joints", range(1, 8))
@pytest.mark.parametrize("order", range(8))
def test_vec_forward_equals_the_plain_loop(joints, order):
    """Errors up to ten times those of a real arm, so that second-order slips show.

    Some joints are at a limit of their range or in its middle, and travel either way or not."""
    rng = np.random.default_rng([joints, order])
    table, low = dh_table(rng, joints), rng.uniform(-4, 0, joints)
    high = low + rng.uniform(1.5, 8, joints)
    size = np.array([5.0] * 3 + [0.02] * 3)[:, None]
    series = size * rng.uniform(-1, 1, (joints, 6, order + 1))
    offsets, s = rng.uniform(-0.01, 0.01, (joints, 2)), rng.integers(-1, 2, joints)
    place = np.where(rng.random(joints) < 0.3, rng.integers(0, 3, joints) / 2, rng.random(joints))
    q = low + (high - low) * place
    model = vec.VECModel(dh.DHModel(*table.T), low, high, series, offsets)
    expected = oracle.vec_forward(table, series, low, high, offsets, q, s)
    printed = chain.to_pose(model.walk(JointState(q[None], s[None])).end)
    assert_same(printed, of_matrices(expected[None]), 1e-9, 1e-12)
    pose = vec.pose(model, q[None], s[None])
    assert_same(pose, of_matrices(oracle.projected(expected)[None]), 1e-9, 1e-12)
