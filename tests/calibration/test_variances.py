"""Position and rotation residuals have variances of their own, and so has what follows."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration import fitting, uncertainty, variances
from kinacc.calibration.constraints import free_parameters
from kinacc.calibration.observations import full_poses
from kinacc.deployment.predict import predict
from kinacc.deployment.record import Calibration
from kinacc.geometry import Pose, compose, exp_so3, log_so3
from kinacc.kinematics import dh, robot

WEIGHT = 500.0
TOOL = Pose(exp_so3(np.array([-0.4, 0.2, 0.7])), np.array([30.0, -20.0, 150.0]))
STD_MM = 0.02


def joints(arm, count, seed):
    share = np.random.default_rng(seed).uniform(0.2, 0.8, (count, 6))
    return arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)


def measured(arm, q_rad, std_rad, seed):
    seen = compose(dh.forward(arm.dh, q_rad), TOOL)
    noise = np.random.default_rng(seed).normal(size=(len(q_rad), 6))
    turned = exp_so3(noise[:, 3:] * std_rad) @ seen.rotation
    return full_poses(q_rad, Pose(turned, seen.position_mm + STD_MM * noise[:, :3]))


def fitted(arm, observations):
    return fitting.fit(
        observations,
        arm.dh,
        free=free_parameters(6),
        rotation_weight_mm_per_rad=WEIGHT,
        threshold=1e-3,
    )


@pytest.mark.parametrize("std_rad", [1e-5, 2e-4], ids=["rotations known well", "known badly"])
def test_predictions_are_off_by_as_much_as_is_said(std_rad):
    """Mean square of true error over standard deviation is 1, of positions and of rotations."""
    arm = robot.load("mh180")
    q_rad, q_far = joints(arm, 60, 1), joints(arm, 100, 2)
    true = compose(dh.forward(arm.dh, q_far), TOOL)
    squares = []
    for seed in range(20):
        fit = fitted(arm, measured(arm, q_rad, std_rad, seed))
        known = uncertainty.of_fit(fit, ("tool",))
        frames = fit.frames.base, {"tool": fit.frames.tool}
        said = predict(
            Calibration("arm", arm, "dh", fit.model, *frames, known),
            q_far,
            None,
            "instrument",
            "tool",
        )
        off = log_so3(said.pose.rotation @ np.swapaxes(true.rotation, 1, 2))
        away = np.concatenate([said.pose.position_mm - true.position_mm, off], axis=1)
        squares.append(np.mean((away / said.std) ** 2, axis=0))
    squares = np.array(squares).reshape(20, 2, 3).mean(axis=2)
    error = squares.std(axis=0, ddof=1) / np.sqrt(20)
    assert np.all(np.abs(squares.mean(axis=0) - 1.0) < 3.5 * error)
    assert error.max() < 0.15


def test_variances_are_unbiased_where_one_kind_of_error_is_far_larger():
    rng = np.random.default_rng(0)
    columns = np.linalg.qr(rng.normal(size=(40, 12)))[0]
    turned = np.arange(40) % 2 == 1
    std = np.where(turned, 1.0, 0.05)
    parts = np.stack([columns[kind].T @ columns[kind] for kind in (~turned, turned)])
    rest, kinds = np.eye(40) - columns @ columns.T, (~turned, turned)
    expected = [[np.sum(rest[np.ix_(one, other)] ** 2) for other in kinds] for one in kinds]
    found = []
    for _ in range(400):
        error = std * rng.normal(size=40)
        left = rest @ error
        costs = np.array([np.sum(left[kind] ** 2) for kind in kinds])
        solved = np.linalg.solve(expected, costs)
        here = variances.of_kinds(costs, np.array([20.0, 20.0]), parts, 1.0)
        if np.all(solved > 0.0):
            np.testing.assert_allclose(here, solved)
        assert np.all(here > 0.0)
        found.append(solved)
    mean, error = np.mean(found, axis=0), np.std(found, axis=0) / np.sqrt(400)
    assert np.all(np.abs(mean - [0.0025, 1.0]) < 4 * error)
