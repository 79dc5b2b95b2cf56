"""Limits on sizes and points of ellipsoids against closed forms, 50 digits and slow searches."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from scipy.special import chndtr, ndtri
from scipy.stats import ncx2

from kinacc.assess import population
from kinacc.assess.ellipsoid import BallDistances, largest_size
from kinacc.assess.limits import lower_limit_mm, reading_below, size_at, upper_limit_mm
from kinacc.assess.size_kernels import reading_densities


def random_covariance(rng: np.random.Generator, condition: float) -> np.ndarray:
    """Covariance in random axes whose eigenvalues span ``condition``; 0.1 mm in the widest."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    variance = 0.01 * np.array([1.0, condition ** -rng.uniform(), 1.0 / condition])
    return (axes * variance) @ axes.T


@pytest.mark.parametrize("a", [0.0, 1e-5, 1e-3, 0.1, 1.0, 4.0, 30.0])
def test_size_of_a_reading_is_noncentral_chi(a):
    x = np.linspace(0.05, a + 6.0, 60)
    ours = [reading_below(each, a) for each in x]
    assert ours == pytest.approx(chndtr(x**2, 3, a**2).tolist(), abs=1e-9)


def test_size_of_a_reading_against_an_integral_of_fifty_digits():
    mpmath.mp.dps = 50
    for x, a in [(0.5, 2.0), (3.0, 3.5), (6.0, 9.0), (0.2, 1e-3)]:

        def density(r, a=a):
            near, far = (mpmath.exp(-((r + side * a) ** 2) / 2) for side in (-1, 1))
            return r * (near - far) / (mpmath.mpf(a) * mpmath.sqrt(2 * mpmath.pi))

        exact = float(mpmath.quad(density, [0, x]))
        assert reading_below(x, a) == pytest.approx(exact, rel=1e-9, abs=2e-12)


@pytest.mark.parametrize("probability", [0.95, 0.5, 0.05, 1e-4])
def test_size_at_inverts_the_probability_and_is_zero_where_no_size_is_as_likely(probability):
    for x in np.linspace(0.01, 12.0, 40):
        a = size_at(x, probability)
        if a > 0.0:
            assert reading_below(x, a) == pytest.approx(probability, abs=1e-9)
        else:
            assert reading_below(x, 0.0) <= probability


def test_with_equal_noise_the_nearest_point_is_the_candidate_of_eq_21():
    reading = np.array([0.3, -0.4, 1.2])
    distances = BallDistances(reading[None], 0.04 * np.eye(3)[None])
    assert distances.beyond(0.65) == pytest.approx(0.65 / 0.2)


def test_largest_size_of_an_ellipsoid_against_a_dense_search():
    rng = np.random.default_rng(4)
    around = rng.normal(size=(200_000, 3))
    around /= np.linalg.norm(around, axis=1)[:, None]
    for case in range(30):
        covariance = random_covariance(rng, 10.0 ** rng.uniform(0, 4))
        mean = rng.normal(size=3) * rng.uniform(0, 1)
        if case % 3 == 0:  # no component along the widest axis
            widest = np.linalg.eigh(covariance)[1][:, -1]
            mean -= (mean @ widest) * widest
        support = around @ mean + 2.0 * np.sqrt(
            np.einsum("ni,ij,nj->n", around, covariance, around)
        )
        found = largest_size(mean, covariance, 2.0)
        assert found >= support.max() - 1e-12
        assert found == pytest.approx(support.max(), rel=1e-3)


@pytest.mark.parametrize("ratio", [1.0, 3.0, 30.0])
def test_limits_miss_as_seldom_as_they_say_whatever_the_direction(ratio):
    rng = np.random.default_rng(5)
    covariance = 0.01 * np.diag([1.0, 1.0 / ratio, 1.0 / ratio**2])
    noise = 0.1 if ratio == 1.0 else covariance
    draws, allowed = 1000, 0.05
    worst_upper = worst_lower = 0
    for direction in ([1, 0, 0], [0, 0, 1], [0.6, 0.0, 0.8]):
        for size in (0.05, 0.3):
            error = size * np.array(direction, dtype=float)
            means = error + rng.multivariate_normal(np.zeros(3), covariance, draws)
            worst_upper = max(
                worst_upper, sum(upper_limit_mm(m, noise, allowed) < size for m in means)
            )
            worst_lower = max(
                worst_lower, sum(lower_limit_mm(m, noise, allowed) > size for m in means)
            )
    most = allowed * draws + 4 * math.sqrt(allowed * draws)
    assert worst_upper < most
    assert worst_lower < most


def test_far_from_zero_the_upper_limit_is_the_one_of_a_normal_reading():
    mean = np.array([100.0, 0.0, 0.0])
    z = -float(ndtri(0.05))
    assert upper_limit_mm(mean, 0.2, 0.05) == pytest.approx(100 + 0.2 * z, abs=1e-3)
    unequal = np.diag([0.04, 0.01, 0.09])
    assert upper_limit_mm(mean, unequal, 0.05) == pytest.approx(100 + 0.2 * z, abs=2e-3)


def test_densities_of_readings_are_noncentral_chi_up_to_a_factor():
    x, noise = np.array([0.05, 0.4, 1.3]), np.array([0.1, 0.3, 0.05])
    true = np.linspace(0.01, 1.5, 40)
    ours = reading_densities(x, noise, true)
    for row in range(3):
        exact = ncx2.pdf((x[row] / noise[row]) ** 2, 3, (true / noise[row]) ** 2)
        assert ours[row] == pytest.approx(exact / exact.max(), rel=1e-6, abs=1e-15)


def test_a_reading_of_no_size_has_the_density_of_a_small_one():
    true = np.linspace(0.01, 1.5, 40)
    zero, small = reading_densities(np.array([0.0, 1e-6]), np.full(2, 0.2), true)
    assert zero == pytest.approx(np.exp(-0.5 * (true**2 - true[0] ** 2) / 0.2**2), rel=1e-9)
    assert zero == pytest.approx(small, rel=1e-4)


def test_the_largest_size_is_told_where_one_reading_is_as_predicted_to_the_last_digit():
    noise_mm = np.full(4, 0.05)
    with_zero = population.largest_size(np.array([0.0, 0.3, 0.2, 0.5]), noise_mm, 0).quantile_mm(
        0.5
    )
    near_zero = population.largest_size(np.array([1e-5, 0.3, 0.2, 0.5]), noise_mm, 0).quantile_mm(
        0.5
    )
    assert with_zero == pytest.approx(near_zero, rel=1e-3)
