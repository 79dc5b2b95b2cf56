"""VEC fits: travel directions, and the joint range the polynomials are of."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from oracles.kinematics import MEASURED_RAD

from kinacc.calibration import frames, vec_fit
from kinacc.calibration.observations import full_poses
from kinacc.calibration.vec_estimator import VECEstimator
from kinacc.calibration.vec_fit import Prior
from kinacc.config.schema import defaults
from kinacc.kinematics import dh, robot, vec

WEIGHT = 500.0
ARM = robot.load("mh180")
LOW, HIGH = MEASURED_RAD


def test_an_unknown_direction_is_the_mean_of_both():
    """Constants of eps_z and of both offsets are one: none of it may be lost at s = 0."""
    empty = vec.without_errors(ARM.dh, LOW, HIGH, 1)
    q = np.random.default_rng(9).uniform(LOW, HIGH, (300, 6))
    true = replace(empty, direction_offsets_rad=np.full((6, 2), 4e-4))
    s = np.random.default_rng(10).choice([-1, 1], q.shape).astype(np.int8)
    s[:, 5] = np.where(np.arange(300) % 3, s[:, 5], 0)  # joint 6 also seen standing still
    seen = full_poses(q, vec.pose(true, q, s), s)
    model = vec_fit.fit(
        seen,
        empty,
        prior=Prior(1.0, 1e-3, 1.0, 1e-3),
        rotation_weight_mm_per_rad=WEIGHT,
        frames=frames.FrameParameters.none(frames.known()),
    ).model
    np.testing.assert_allclose(vec.pose(model, q, s).position_mm, seen.position_mm, atol=1e-3)
    np.testing.assert_allclose(model.direction_offsets_rad[:5].sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(model.direction_offsets_rad[5], 4e-4, atol=2e-6)
    still = np.zeros_like(s)
    still[:, 5] = 1
    alike = vec.pose(true, q, np.ones_like(s)).position_mm  # both directions are the same
    np.testing.assert_allclose(vec.pose(model, q, still).position_mm, alike, atol=1e-3)


@pytest.mark.parametrize("wanted", ["data", "limits", "stated"])
def test_the_joint_range_is_that_of_the_data_of_the_limits_or_the_one_stated(wanted):
    arm = robot.load("fanuc_lrmate200id")  # its joint 3 turns with joint 2
    q_rad = arm.dh_joints(np.random.default_rng(3).uniform(-0.8, 0.9, (50, 6)))
    settings = defaults()["calibration"]
    stated = [[-10.0 - n, 20.0 + n] for n in range(6)]
    settings["vec"] |= {
        "joint_range": stated if wanted == "stated" else wanted, "joint_range_margin_deg": 3.0
    }  # fmt: skip
    every = full_poses(q_rad, dh.forward(arm.dh, q_rad))
    found = np.rad2deg(VECEstimator.of(settings, arm, every).joint_range_rad)
    box = np.deg2rad(stated) if wanted == "stated" else np.stack([arm.q_min_rad, arm.q_max_rad], 1)
    corners = np.rad2deg(arm.dh_joints(np.array(list(product(*box)))))
    if wanted == "data":
        margin = np.array([[-3.0], [3.0]])
        corners = margin + np.rad2deg([q_rad.min(axis=0), q_rad.max(axis=0)])
    np.testing.assert_allclose(found, [corners.min(axis=0), corners.max(axis=0)], atol=1e-9)
