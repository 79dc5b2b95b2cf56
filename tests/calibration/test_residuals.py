"""Residual statistics and errors against closed forms; cross-validation row by row."""

from __future__ import annotations

from dataclasses import replace

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


def fit_of(model, shift_mm=(0.0, 0.0, 0.0)):
    """A model whose base is moved in the instrument's frame."""
    base = Pose(BASE.rotation, BASE.position_mm + shift_mm)
    return Fit(model, Frames(stacked([base]), stacked([TOOL])))


def fitted(shift_mm=(0.0, 0.0, 0.0)):
    """All three models the nominal arm, the base of DH moved."""
    empty = vec.without_errors(ARM.dh, np.full(6, -1.0), np.full(6, 1.0), 1)
    plain = fit_of(ARM.dh)
    return {"vec": fit_of(empty), "dh": fit_of(ARM.dh, shift_mm), "nominal": plain}


def measured(shift_mm, turn_rad):
    """Readings off by a shift and a turn, both given in the robot base."""
    clean = compose(dh.forward(ARM.dh, Q), TOOL)
    off = Pose(exp_so3(turn_rad) @ clean.rotation, clean.position_mm + shift_mm)
    return full_poses(Q, compose(BASE, off))


def test_errors_are_measured_minus_model_in_the_robot_base():
    shift, turn = np.array([0.5, -0.2, 0.1]), np.array([1e-3, -2e-3, 5e-4])
    found = residuals.errors(fitted(), measured(shift, turn))
    for name in ("vec_vs_measured", "dh_vs_measured", "nominal_vs_measured"):
        np.testing.assert_allclose(found[name].position_mm, np.tile(shift, (COUNT, 1)), atol=1e-9)
        np.testing.assert_allclose(found[name].rotation_rad, np.tile(turn, (COUNT, 1)), atol=1e-12)
    np.testing.assert_allclose(found["dh_vs_vec"].position_mm, 0.0, atol=1e-9)


def test_every_row_is_judged_by_a_model_that_has_not_seen_its_fold():
    fold = np.array([0, 1, 2, -1] * 3)
    seen = replace(measured(np.zeros(3), np.zeros(3)), fold=fold, pose=np.arange(COUNT))
    shown = {}

    def refit(train, number):
        shown[number] = set(train.pose.tolist())
        return fitted((10.0 * (number + 1), 0.0, 0.0))  # tells the models of the folds apart

    held_out, trained = residuals.cross_validated(seen, refit, [0, 1, 2], ["vec", "dh", "nominal"])
    size = np.linalg.norm(held_out["dh_vs_measured"].position_mm, axis=1)
    for number in range(3):
        rows = np.flatnonzero(fold == number)
        assert shown[number].isdisjoint(rows.tolist())
        assert len(shown[number]) == COUNT - len(rows)
        np.testing.assert_allclose(size[rows], 10.0 * (number + 1), atol=1e-9)
        assert len(trained[number]["dh_vs_measured"].position_mm) == COUNT - len(rows)
    assert np.isnan(size[fold < 0]).all()
    assert list(held_out) == [
        "vec_vs_measured", "dh_vs_vec", "dh_vs_measured", "nominal_vs_measured",
    ]  # fmt: skip


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
