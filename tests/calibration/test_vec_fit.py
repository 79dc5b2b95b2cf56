"""VEC fits: the gauge nobody can see, poses found again, travel directions, base and tool."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinacc.calibration import frames, vec_fit
from kinacc.calibration.observations import full_poses
from kinacc.calibration.vec_fit import Prior
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import robot, vec

WEIGHT = 500.0
ARM = robot.load("mh180")
LOW, HIGH = np.deg2rad([(-10, 70), (-30, 54), (-74, 18), (-170, 170), (-120, 120), (-170, 170)]).T
PRIOR = Prior(1.0, 1e-3, 1.0, 1e-3)


def joints(count, seed=0):
    return np.random.default_rng(seed).uniform(LOW, HIGH, (count, 6))


def true_model(order=5, seed=1):
    empty = vec.without_errors(ARM.dh, LOW, HIGH, order)
    spread = Prior(0.2, 0.3e-3, 0.7, 2e-4).std(empty)
    return empty.with_parameters(spread * np.random.default_rng(seed).normal(size=spread.size))


def empty_model(order=5):
    return vec.without_errors(ARM.dh, LOW, HIGH, order)


@pytest.mark.parametrize("order", [1, 5])
def test_full_poses_leave_ten_directions_exactly_null(order):
    """A turn about and a shift along every inner axis may stand before or behind the joint."""
    q = joints(300)
    seen = full_poses(q, vec.pose(empty_model(order), q))
    found = vec_fit.gauge(seen, empty_model(order), frames.known(), WEIGHT)
    assert found.values.size == 36 * (order + 1)
    assert found.rank == found.values.size - 10
    assert found.gap > 1e6


def test_poses_between_the_measured_ones_are_predicted():
    true = true_model()
    q = joints(500, 2)
    rng = np.random.default_rng(3)
    seen = vec.pose(true, q)
    seen = Pose(
        exp_so3(5e-5 * rng.normal(size=(500, 3))) @ seen.rotation,
        seen.position_mm + 0.025 * rng.normal(size=(500, 3)),
    )
    found = vec_fit.fit(
        full_poses(q, seen),
        empty_model(),
        prior=PRIOR,
        rotation_weight_mm_per_rad=WEIGHT,
        frames=frames.known(),
        frames_free=False,
    )
    assert np.sqrt(found.solution.variance) == pytest.approx(0.025, rel=0.05)
    new = joints(300, 4)
    error = vec.pose(found.model, new).position_mm - vec.pose(true, new).position_mm
    # 206 coefficients from 3,000 residuals of 0.025 mm: about 0.01 mm per axis is left.
    assert np.sqrt(np.mean(error**2)) < 0.012
    # What nobody can see keeps the uncertainty of the prior, what is seen does not.
    assert np.nanmax(found.std / found.prior_std) <= 1.0 + 1e-9
    assert np.nanmin(found.std / found.prior_std) < 0.1


def test_an_unknown_direction_is_the_mean_of_both():
    """Constants of eps_z and of both offsets are one: none of it may be lost at s = 0."""
    true = replace(empty_model(1), direction_offsets_rad=np.full((6, 2), 4e-4))
    q = joints(300, 9)
    s = np.random.default_rng(10).choice([-1, 1], q.shape).astype(np.int8)
    s[:, 5] = np.where(np.arange(300) % 3, s[:, 5], 0)  # joint 6 also seen standing still
    seen = full_poses(q, vec.pose(true, q, s), s)
    found = vec_fit.fit(
        seen,
        empty_model(1),
        prior=PRIOR,
        rotation_weight_mm_per_rad=WEIGHT,
        frames=frames.known(),
        frames_free=False,
    )
    fitted = vec.pose(found.model, q, s)
    np.testing.assert_allclose(fitted.position_mm, seen.position_mm, atol=1e-3)
    np.testing.assert_allclose(found.model.direction_offsets_rad[:5].sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(found.model.direction_offsets_rad[5], 4e-4, atol=2e-6)
    still = np.zeros_like(s)
    still[:, 5] = 1
    moved = vec.pose(found.model, q, still).position_mm
    np.testing.assert_allclose(moved, fitted_at(true, q), atol=1e-3)


def fitted_at(true, q):
    """Positions of a model whose offsets are the same in both directions."""
    return vec.pose(true, q, np.ones_like(q, dtype=np.int8)).position_mm
