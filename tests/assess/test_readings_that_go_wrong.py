"""Limits that hold although readings go wrong, against slow searches, integrals and draws."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize
from scipy.stats import binom, norm

from kinacc.assess.wrong_readings import (
    _around,
    at_most_wrong,
    clip_of,
    guarded_boundary,
    guarded_lower_mm,
    guarded_stages,
    guarded_upper_mm,
    sizes_at,
)

RATE = 0.01
COUNTS = (1, 3, 5, 7, 9, 12, 15, 19, 24, 30, 38, 48, 60)
SHARES = tuple(np.diff([0.0, *(0.05 * (0.1 + 0.9 * k / 60) for k in COUNTS)]))


def scores(along, size, sigma):
    return np.clip((along - size) / sigma, -clip_of(RATE), clip_of(RATE)).sum()


def limit_along(direction, readings, covariances, wanted):
    """Largest size whose scores sum to at least ``wanted``, by a root search."""
    along = readings @ direction
    sigma = np.sqrt([direction @ each @ direction for each in covariances])
    wide = 20.0 * sigma.max()
    ends = along.min() - wide, along.max() + wide
    return brentq(lambda size: scores(along, size, sigma) - wanted, *ends, xtol=1e-12)


@pytest.mark.parametrize("rate", [0.001, 0.01, 0.05])
def test_the_clip_is_the_one_by_which_a_wrong_reading_harms_least(rate):
    # Huber's minimax asymptotic variance over all symmetric wrong readings.
    def variance(clip):
        inside = norm.cdf(clip) - norm.cdf(-clip)
        second = quad(lambda x: x * x * norm.pdf(x), -clip, clip)[0] + clip**2 * (1.0 - inside)
        return ((1.0 - rate) * second + rate * clip**2) / ((1.0 - rate) * inside) ** 2

    best = clip_of(rate)
    assert variance(best) < min(variance(0.9 * best), variance(1.1 * best))


@pytest.mark.parametrize("error", [0.02, 0.05, 0.2])
def test_two_scores_sum_to_so_little_as_seldom_as_an_integral_says(error):
    clip = clip_of(RATE)

    def below(total):  # of one score
        if total < -clip or total >= clip:
            return float(total >= clip)
        return RATE + (1.0 - RATE) * norm.cdf(total)

    def both_below(total):
        inside = quad(lambda x: norm.pdf(x) * below(total - x), -clip, clip, limit=200)[0]
        ends = norm.cdf(-clip) * (below(total + clip) + below(total - clip))
        return RATE * below(total + clip) + (1.0 - RATE) * (inside + ends)

    z = guarded_stages((2,), (error,), RATE)[0]
    assert both_below(-z * math.sqrt(2.0)) <= error
    assert both_below(-z * math.sqrt(2.0) + 0.05) > error


def test_a_point_read_again_and_again_is_underrated_as_seldom_as_stated():
    z = np.array(guarded_boundary(COUNTS, SHARES, RATE))
    rng = np.random.default_rng(1)
    walks = 20_000
    noise = rng.normal(size=(walks, COUNTS[-1]))
    wrong = rng.random((walks, COUNTS[-1])) < RATE
    score = np.where(wrong, -clip_of(RATE), np.clip(noise, -clip_of(RATE), clip_of(RATE)))
    sums = np.cumsum(score, axis=1)[:, np.array(COUNTS) - 1]
    crossed = sums < -z * np.sqrt(COUNTS)
    crossed[:, 0] = wrong[:, 0] | (noise[:, 0] < -z[0])
    said = 0.05 + RATE
    assert abs(crossed.any(axis=1).mean() - said) < 3.0 * math.sqrt(said * (1 - said) / walks)


def test_without_wrong_readings_to_come_the_guard_costs_nothing():
    plain = norm.isf(0.05)
    assert guarded_stages((50,), (0.05,), 1e-9)[0] == pytest.approx(plain, rel=0.005)
    assert guarded_stages((50,), (0.05,), RATE)[0] < 1.06 * plain


@pytest.mark.parametrize("count", [1, 3, 5, 20])
@pytest.mark.parametrize("even", [True, False])
def test_the_limit_is_the_largest_over_all_directions(count, even):
    rng = np.random.default_rng([count, even])
    readings = np.array([4.0, 0.0, 0.0]) + rng.normal(size=(count, 3))
    if count > 1:
        readings[-1] += (0.0, 9.0, 0.0)
    root = np.eye(3) + (0.0 if even else 0.4) * rng.normal(size=(count, 3, 3))
    covariances = root @ np.swapaxes(root, 1, 2)

    def limit(direction):
        unit = direction / np.linalg.norm(direction)
        if count == 1:  # the first reading counts in full
            return unit @ readings[0] + 2.6 * math.sqrt(unit @ covariances[0] @ unit)
        return limit_along(unit, readings, covariances, -2.6 * math.sqrt(count))

    begins = sorted(rng.normal(size=(400, 3)), key=limit)[-3:]
    climbed = [minimize(lambda x: -limit(x), each, method="Nelder-Mead").fun for each in begins]
    found = guarded_upper_mm(readings, covariances, 2.6, RATE)
    assert found == pytest.approx(-min(climbed), rel=1e-3)


def searched(readings, covariances, deviations):
    """As the compiled search, all directions of a round at once, roots by sorted bends."""
    count = len(readings)
    number = min(max(4000 // count, 24), 200)
    tried, apart = (
        np.vstack([readings.mean(axis=0), _around(number)]),
        math.sqrt(4 * math.pi / number),
    )
    for _ in range(7):
        tried = tried / np.linalg.norm(tried, axis=1)[:, None]
        sigma = np.sqrt(np.einsum("qi,kij,qj->qk", tried, covariances, tried))
        sizes = sizes_at(tried @ readings.T, sigma, clip_of(RATE), -deviations * math.sqrt(count))
        best = tried[np.argsort(-sizes)[:3]]
        tried = np.vstack([best, (best[:, None] + apart * _around(12)).reshape(-1, 3)])
        apart *= 0.5
    return sizes.max()


@pytest.mark.parametrize("count", [2, 3, 5, 20, 180])
@pytest.mark.parametrize("even", [True, False])
def test_the_compiled_search_finds_what_one_over_arrays_does(count, even):
    rng = np.random.default_rng([7, count, even])
    root = np.eye(3) + (0.0 if even else 0.4) * rng.normal(size=(count, 3, 3))
    covariances = root @ np.swapaxes(root, 1, 2)
    for largest in (0.0, 0.5, 8.0):
        readings = np.array([largest, 0.0, 0.0]) + rng.normal(size=(count, 3))
        readings[0] += (0.0, -9.0, 0.0)
        found = guarded_upper_mm(readings, covariances, 2.2, RATE)
        assert found == pytest.approx(searched(readings, covariances, 2.2), rel=1e-12)


def test_few_readings_allow_no_limit_where_wrong_ones_could_explain_all():
    readings = np.ones((2, 3))
    assert guarded_upper_mm(readings, np.repeat(np.eye(3)[None], 2, 0), 9.0, RATE) == math.inf


@pytest.mark.parametrize("wrong", [(), (0,), (3, 7)])
def test_a_limit_hardly_follows_readings_that_are_far_off(wrong):
    rng = np.random.default_rng(5)
    readings = np.array([6.0, 0.0, 0.0]) + rng.normal(size=(30, 3))
    even = np.repeat(np.eye(3)[None], 30, 0)
    plain = guarded_upper_mm(readings, even, 2.5, RATE)
    for to in itertools.product((-1e3, 1e3), repeat=len(wrong)):
        moved = readings.copy()
        moved[list(wrong), 0] = to
        # A mean would move by 33 mm for each, from a limit of about 6.5 mm.
        assert abs(guarded_upper_mm(moved, even, 2.5, RATE) - plain) < 0.25 * len(wrong) + 1e-9


def test_the_lower_limit_holds_whatever_wrong_readings_say():
    rng = np.random.default_rng(2)
    z = guarded_stages((40,), (0.05,), 0.05)[0]
    above = 0
    for _ in range(2000):
        # All at the point with the largest error, 3 mm: nothing is given away.
        along = 3.0 + 0.5 * rng.normal(size=40)
        along[rng.random(40) < 0.05] = 1e6
        above += guarded_lower_mm(along, np.full(40, 0.5), z, 0.05) > 3.0
    assert 0.03 < above / 2000 < 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / 2000)


@pytest.mark.parametrize("readings", [1, 50, 200])
def test_so_many_wrong_readings_are_exceeded_seldom(readings):
    found = at_most_wrong(readings, RATE, 0.005)
    assert binom.sf(found, readings, RATE) <= 0.005
    assert found == 0 or binom.sf(found - 1, readings, RATE) > 0.005
