"""Limits on sizes and counts against closed forms, 50 digits and slow searches."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import chndtr, ndtri
from scipy.stats import chi2, ncx2

from kinacc.assess.adaptive import Candidates
from kinacc.assess.limits import (
    largest_size,
    lower_limit_mm,
    reading_below,
    upper_limit_mm,
    visit_mm,
)
from kinacc.assess.search_and_confirm import SearchAndConfirm, excepted


@pytest.mark.parametrize("a", [0.0, 1e-5, 1e-3, 0.1, 1.0, 4.0, 30.0])
def test_size_of_a_reading_is_noncentral_chi(a):
    x = np.linspace(0.05, a + 6.0, 60)
    ours = [reading_below(each, a) for each in x]
    assert ours == pytest.approx(chndtr(x**2, 3, a**2).tolist(), abs=1e-9)


@pytest.mark.parametrize("ratio", [1.0, 30.0])
def test_limits_miss_as_seldom_as_they_say_whatever_the_direction(ratio):
    rng = np.random.default_rng(5)
    covariance = 0.01 * np.diag([1.0, 1.0 / ratio, 1.0 / ratio**2])
    noise = 0.1 if ratio == 1.0 else covariance
    draws, allowed = 1000, 0.05
    missed = []
    for direction in ([1, 0, 0], [0, 0, 1]):
        for size in (0.05, 0.3):
            error = size * np.array(direction, dtype=float)
            means = error + rng.multivariate_normal(np.zeros(3), covariance, draws)
            missed.append(sum(upper_limit_mm(m, noise, allowed) < size for m in means))
            missed.append(sum(lower_limit_mm(m, noise, allowed) > size for m in means))
    assert max(missed) < allowed * draws + 4 * math.sqrt(allowed * draws)


def test_the_lower_limit_under_equal_noise_given_as_a_matrix_is_off_by_chi_of_three():
    mean, noise = np.array([3.0, -4.0, 12.0]), 0.2
    limit = 13.0 - noise * math.sqrt(chi2.ppf(0.95, 3))
    assert lower_limit_mm(mean, noise**2 * np.eye(3), 0.05) == pytest.approx(limit, abs=1e-9)


def turned(variances, seed=1):
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return axes @ np.diag(variances) @ axes.T


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
    covariance, mean = turned(variances), np.array(mean)
    root = np.linalg.cholesky(covariance)

    def size(u):
        return -np.linalg.norm(mean + deviations * root @ (u / np.linalg.norm(u)))

    starts = np.random.default_rng(2).normal(size=(4, 3))  # there are two maxima at most
    searched = max(-minimize(size, start, tol=1e-14).fun for start in starts)
    assert largest_size(mean, covariance, deviations) == pytest.approx(searched, rel=1e-6)


def test_what_95_percent_of_visits_keep_is_noncentral_chi_and_far_off_normal():
    size = np.array([0.0, 0.3, 0.8, 59.9, 60.1, 1e6, np.nan])
    found = visit_mm(size, 0.2)
    wanted = 0.2 * np.sqrt(ncx2.ppf(0.95, 3, (size[1:3] / 0.2) ** 2))
    assert found[1:3] == pytest.approx(wanted, rel=1e-9)
    assert found[3:6] - size[3:6] == pytest.approx(0.2 * ndtri(0.95), rel=3e-3)
    assert np.isnan(found[6])
    assert visit_mm(0.8, 0.0) == 0.8


@pytest.mark.parametrize(("points", "seen"), [(9, 4), (10, 8), (12, 5), (12, 11)])
@pytest.mark.parametrize("error", [0.025, 0.2])
def test_all_but_so_many_points_is_right_over_all_subsets_that_can_be_read(points, seen, error):
    def missed(largest):
        """Share of all subsets that hold none of the largest points."""
        subsets = [set(each) for each in combinations(range(points), seen)]
        return np.mean([not each & set(range(largest)) for each in subsets])

    left = excepted(points, seen, error)
    assert missed(left + 1) <= error
    assert left == 0 or missed(left) > error


def test_noise_twice_as_large_is_a_covariance_four_times_as_large():
    rng = np.random.default_rng(8)
    root = 0.2 * rng.normal(size=(4, 3, 3)) + 0.3 * np.eye(3)
    covariance, readings = root @ np.swapaxes(root, 1, 2), rng.normal(size=(4, 3)) + 2.0
    limits = []
    for scale, factor in ((1.0, 2.0), (4.0, 1.0)):
        campaign = SearchAndConfirm(8).begin(Candidates(scale * covariance))
        for point, reading in enumerate(readings):
            campaign.record(point, reading)
        limits.append(campaign.looks.lower_limits_mm(np.full(4, factor)))
    assert limits[0].max() > 0.0
    np.testing.assert_allclose(*limits, rtol=1e-9)
