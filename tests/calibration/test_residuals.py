"""Residual statistics and errors against closed forms."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from kinacc.calibration import residuals
from kinacc.calibration.fitting import Fit
from kinacc.calibration.frames import Frames, stacked
from kinacc.calibration.observations import full_poses
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot, vec

ARM = robot.load("mh180")
BASE = Pose(exp_so3(np.array([0.3, -1.0, 2.0])), np.array([900.0, 100.0, -50.0]))
TOOL = Pose(exp_so3(np.array([0.1, 0.2, 0.3])), np.array([5.0, -6.0, 120.0]))
COUNT = 12
Q = np.random.default_rng(0).uniform(-0.5, 0.5, (COUNT, 6))


def test_errors_are_measured_minus_model_in_the_robot_base():
    """Of three models that are the nominal arm; readings are off in the robot base."""
    empty = vec.without_errors(ARM.dh, np.full(6, -1.0), np.full(6, 1.0), 1)
    frames = Frames(stacked([BASE, TOOL]), 1)
    models = {"vec": empty, "dh": ARM.dh, "nominal": ARM.dh}
    fits = {name: Fit(model, frames) for name, model in models.items()}
    shift, turn = np.array([0.5, -0.2, 0.1]), np.array([1e-3, -2e-3, 5e-4])
    clean = compose(dh.forward(ARM.dh, Q), TOOL)
    off = Pose(exp_so3(turn) @ clean.rotation, clean.position_mm + shift)
    found = residuals.errors(fits, full_poses(Q, compose(BASE, off)))
    for name in ("vec_vs_measured", "dh_vs_measured", "nominal_vs_measured"):
        wanted = np.tile([*shift, *1e3 * turn], (COUNT, 1))
        np.testing.assert_allclose(found[name], wanted, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found["dh_vs_vec"], 0.0, atol=1e-9)


def test_bias_is_the_mean_error_in_every_region_of_a_joint():
    rng, angle = np.random.default_rng(1), np.linspace(-1.0, 2.0, 31)
    vectors, region = rng.normal(size=(31, 3)), np.minimum(np.arange(31) // 5, 5)
    table = pd.DataFrame(vectors, columns=["ex_mm", "ey_mm", "ez_mm"])
    table = table.assign(comparison="dh_vs_measured", estimate="train", row=np.arange(31)[::-1])
    found = list(residuals.bias(table, angle[::-1, None]))
    assert [row[5] for row in found] == [5, 5, 5, 5, 5, 6]
    for number, (*names, joint, low, high, _, x, y, z, sx, sy, sz, rms) in enumerate(found):
        part = vectors[region == number]
        assert (*names, joint) == ("dh_vs_measured", "train", 1)
        assert (low, high) == pytest.approx((0.5 * number - 1.0, 0.5 * number - 0.5))
        assert (x, y, z) == pytest.approx(part.mean(axis=0))
        assert (sx, sy, sz) == pytest.approx(stats.sem(part))
        assert rms == pytest.approx(np.linalg.norm(part) / np.sqrt(len(part)))
