"""Poses and slopes of models in floats, against the same formulas in 50 digits."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from oracles import fifty_digits as oracle
from test_error_models import COUNT, dh_example, vec_example

from kinacc.kinematics.model import JointState

RNG = np.random.default_rng(9)
AT = JointState(RNG.uniform(-1.9, 1.9, (COUNT, 6)), RNG.integers(-1, 2, (COUNT, 6)))


def exactly(values):
    return np.vectorize(mp.mpf, otypes=[object])(values)


def pose_of(model, row):
    """The pose of a model in 50 digits."""
    dh, q = model.dh, exactly(AT.q_rad[row])
    parts = (dh.theta_offset_rad, dh.d_mm, dh.a_mm, dh.alpha_rad, dh.beta_rad)
    table = exactly(np.column_stack(parts))
    if model.kind == "dh":
        return oracle.dh_pose(table, q)
    errors = exactly(model.coefficients), exactly(model.direction_offsets_rad)
    return oracle.vec_pose(
        table, *errors, exactly(model.q_min_rad), exactly(model.q_max_rad), q, AT.s[row]
    )


@pytest.mark.parametrize("example", [dh_example, vec_example])
def test_poses_and_slopes_are_those_of_50_digits(example):
    model, row = example(), 3
    poses, slopes = model.linearised(AT)
    seen = np.vstack([np.column_stack([poses.rotation[row], poses.position_mm[row]]), [0, 0, 0, 1]])
    with mp.workdps(oracle.DIGITS):
        away = np.array(oracle.moved(mp.matrix(seen.tolist()), pose_of(model, row)), dtype=float)
        assert np.abs(away[:3]).max() < 5e-12
        assert np.abs(away[3:]).max() < 5e-15
        for i in RNG.choice(model.start.size, 25, replace=False):
            step = 1e-10 * np.eye(model.start.size)[i]
            after, before = (model.with_parameters(model.start + way * step) for way in (1, -1))
            by = mp.mpf(after.start[i]) - mp.mpf(before.start[i])  # as the floats have it
            way = oracle.moved(pose_of(after, row), pose_of(before, row))
            slope = np.array([each / by for each in way], dtype=float)
            np.testing.assert_allclose(slopes[row, :, i], slope, rtol=1e-13, atol=3e-12)
