"""Largest sizes, nearest points and boundaries of looks, found again by searching for them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal, norm

from kinacc.assess.ellipsoid import BallDistances, largest_size
from kinacc.assess.invalidation_calibrated import boundary


def turned(variances, seed=1):
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return axes @ np.diag(variances) @ axes.T


def searched_size(mean, covariance, deviations):
    """The largest |x| on the ellipsoid, climbed from many directions."""
    root = np.linalg.cholesky(covariance)

    def size(u):
        return -np.linalg.norm(mean + deviations * root @ (u / np.linalg.norm(u)))

    starts = np.random.default_rng(2).normal(size=(12, 3))
    return max(-minimize(size, start, tol=1e-14).fun for start in starts)


CASES = [
    ([0.3, -0.2, 0.5], [0.01, 0.01, 0.01]),
    ([0.3, -0.2, 0.5], [0.01, 0.04, 0.09]),
    ([3.0, 2.0, 1.0], [1e-4, 1e-2, 1.0]),
    ([1e-6, 2e-6, -1e-6], [0.01, 0.04, 0.09]),
    ([40.0, -10.0, 5.0], [1e-6, 1e-6, 1e-2]),
    ([0.02, 0.0, 0.01], [0.5, 0.5, 0.01]),
]


@pytest.mark.parametrize(("mean", "variances"), CASES)
@pytest.mark.parametrize("deviations", [0.5, 1.645, 4.0])
def test_the_largest_size_is_that_of_the_farthest_point(mean, variances, deviations):
    covariance = turned(variances)
    found = largest_size(np.array(mean), covariance, deviations)
    assert found == pytest.approx(searched_size(np.array(mean), covariance, deviations), rel=1e-6)


def test_the_largest_size_about_hardly_a_reading_is_along_the_widest_axis():
    covariance = turned([0.04, 0.09, 0.25])
    assert largest_size(np.full(3, 1e-9), covariance, 2.0) == pytest.approx(1.0, rel=1e-7)
    # A reading across the widest axis: (y s2 / (s2 - s1))^2 + what is left of the deviations there.
    mean, variance = np.array([0.1, 0.0, 0.0]), np.diag([0.01, 0.02, 0.25])
    step = 0.01 * 0.1 / 0.24
    along = np.sqrt((4.0 - step**2 / 0.01) * 0.25)
    wanted = np.hypot(0.1 + step, along)
    assert largest_size(mean, variance, 2.0) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(("mean", "variances"), CASES)
@pytest.mark.parametrize("share", [0.2, 0.9, 1.1])
def test_the_distance_to_a_ball_is_that_of_its_nearest_point(mean, variances, share):
    reading, covariance = np.array(mean), turned(variances, 3)
    radius, weight = share * np.linalg.norm(reading), np.linalg.inv(covariance)
    distances = BallDistances(np.stack([reading, 2 * reading]), np.stack([covariance] * 2))
    found, farther = distances.beyond(radius)
    assert farther > found
    if share > 1.0:
        assert found == 0.0
        return

    def distance(u):
        gap = reading - radius * u / np.linalg.norm(u)
        return np.sqrt(gap @ weight @ gap)

    starts = [reading, *np.random.default_rng(4).normal(size=(12, 3))]
    nearest = min(minimize(distance, start, tol=1e-12).fun for start in starts)
    assert found == pytest.approx(nearest, rel=1e-6)


@pytest.mark.parametrize("error", [0.01, 0.05, 0.2])
def test_the_boundary_of_two_looks_errs_on_the_safe_side_and_hardly(error):
    """The mean of two readings and the first of them are correlated by the root of a half."""
    at = boundary(2, error)
    both = multivariate_normal([0.0, 0.0], [[1.0, np.sqrt(0.5)], [np.sqrt(0.5), 1.0]])
    beyond = 2.0 * norm.sf(at) - both.cdf([-at, -at])
    assert 0.9 * error < beyond < error
    assert at < boundary(2, error, False)


def test_boundaries_of_one_look_and_of_unequal_noise_are_known():
    assert boundary(1, 0.05) == pytest.approx(norm.isf(0.05))
    assert boundary(4, 0.05, False) == pytest.approx(norm.isf(0.0125))
    assert norm.isf(0.05) < boundary(2, 0.05) < boundary(3, 0.05) < boundary(4, 0.05, False)
