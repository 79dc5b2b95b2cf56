"""Limits and campaigns in which some readings go wrong: what holds, what is named and withheld."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize
from scipy.stats import norm
from simulated_campaigns import away, conducted, equal

from kinacc.assess.limits import (
    boundary,
    clip_of,
    guarded_lower_mm,
    guarded_upper_mm,
)
from kinacc.assess.search_and_confirm import SearchAndConfirm

POINTS, BUDGET, LARGEST = 60, 120, 6.0
RATE = 0.02


@pytest.mark.parametrize("rate", [0.001, 0.01, 0.05])
def test_the_clip_is_the_one_by_which_a_wrong_reading_harms_least(rate):
    # Huber's minimax asymptotic variance over all symmetric wrong readings.
    def variance(clip):
        inside = norm.cdf(clip) - norm.cdf(-clip)
        second = quad(lambda x: x * x * norm.pdf(x), -clip, clip)[0] + clip**2 * (1.0 - inside)
        return ((1.0 - rate) * second + rate * clip**2) / ((1.0 - rate) * inside) ** 2

    best = clip_of(rate)
    assert variance(best) < min(variance(0.9 * best), variance(1.1 * best))


@pytest.mark.parametrize("count", [3, 5, 20])
@pytest.mark.parametrize("even", [True, False])
def test_the_limit_is_the_largest_over_all_directions(count, even):
    rng, clip, wanted = np.random.default_rng([count, even]), clip_of(0.01), -2.6 * math.sqrt(count)
    readings = np.array([4.0, 0.0, 0.0]) + rng.normal(size=(count, 3))
    readings[-1] += (0.0, 9.0, 0.0)
    root = np.eye(3) + (0.0 if even else 0.4) * rng.normal(size=(count, 3, 3))
    covariances = root @ np.swapaxes(root, 1, 2)

    def limit(direction):
        unit = direction / np.linalg.norm(direction)
        along = readings @ unit
        sigma = np.sqrt([unit @ each @ unit for each in covariances])

        def excess(size):
            return np.clip((along - size) / sigma, -clip, clip).sum() - wanted

        return brentq(excess, along.min() - 20 * sigma.max(), along.max() + 20 * sigma.max())

    begins = sorted(rng.normal(size=(400, 3)), key=limit)[-3:]
    climbed = [minimize(lambda x: -limit(x), each, method="Nelder-Mead").fun for each in begins]
    found = guarded_upper_mm(readings, covariances, 2.6, 0.01)
    assert found == pytest.approx(-min(climbed), rel=1e-3)
    in_unit = guarded_upper_mm(9.0 * readings, 81.0 * covariances, 2.6, 0.01)
    assert in_unit == pytest.approx(9.0 * found)
    assert guarded_upper_mm(readings[:2], covariances[:2], 9.0, 0.01) == math.inf


def test_the_lower_limit_holds_whatever_wrong_readings_say():
    rng = np.random.default_rng(2)
    z = boundary((40,), 0.05, rate=0.05).z[0]
    above = 0
    for _ in range(2000):
        # All at the point with the largest error, 3 mm: nothing is given away.
        along = 3.0 + 0.5 * rng.normal(size=40)
        along[rng.random(40) < 0.05] = 1e6
        above += guarded_lower_mm(along, np.full(40, 0.5), z, 0.05) > 3.0
    assert 0.03 < above / 2000 < 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / 2000)


def run(seed, wrong, tied=6, **settings):
    """A campaign of 60 points, ``tied`` of them with the largest error, 6; noise 1.

    ``wrong(rng, number, error)``: what is added to a reading.
    """
    rng = np.random.default_rng(seed)
    errors = away(rng, np.r_[np.full(tied, LARGEST), rng.uniform(0, 2, POINTS - tied)])
    return conducted(rng, rng.permutation(errors), BUDGET, partial(wrong, rng), **settings)


def along(rate, size):
    """Large errors look smaller, the worst for the upper bound, or larger, for the lower one."""
    return lambda rng, _, error: size * (rng.random() < rate) * error / np.linalg.norm(error)


def slipped(*numbers):
    return lambda _, number, error: np.array([0.0, 0.0, 14.0]) * (number in numbers)


@pytest.mark.parametrize(
    ("wrong", "rate", "tied"),
    [(along(0.1, -10.0), 0.1, 1), (along(0.02, 10.0), 0.02, 6)],
    ids=["inwards", "outwards"],
)
def test_bounds_hold_as_stated_where_some_readings_go_wrong(wrong, rate, tied):
    campaigns, too_low, too_high = 12, 0, 0
    for seed in range(campaigns):
        said = run(seed, wrong, tied=tied, wrong_rate=rate).statements()[1]
        assert said.withheld is None
        assert said.confidence == pytest.approx(0.95 - rate)
        too_low += said.upper_mm < LARGEST
        too_high += said.lower_mm > LARGEST
    most = campaigns * (0.05 + rate) + 3.0 * math.sqrt(campaigns * (0.05 + rate) * (0.95 - rate))
    assert max(too_low, too_high) <= most


def test_as_many_large_readings_as_can_be_wrong_raise_no_lower_bound():
    lower = []
    for numbers in ((), (0,), (0, 1)):
        campaign = run(3, slipped(*numbers), tied=30, wrong_rate=RATE)
        assert campaign.looks.wrong >= 2
        lower.append(campaign.looks.largest_lower_mm(np.ones(POINTS)))
    assert 0.0 < max(lower) < LARGEST


@pytest.mark.parametrize("rate", [0.001, 0.05])
def test_more_readings_are_hardly_ever_wrong_than_are_counted_on(rate):
    campaign = SearchAndConfirm(BUDGET, wrong_rate=rate).begin(equal(110))
    chances = [math.comb(BUDGET, k) * rate**k * (1.0 - rate) ** (BUDGET - k)
               for k in range(BUDGET + 1)]  # fmt: skip
    counted_on = campaign.looks.wrong
    assert sum(chances[counted_on + 1 :]) <= 0.5 * campaign.single_error
    assert sum(chances[counted_on:]) > 0.5 * campaign.single_error


@pytest.mark.parametrize("guard", [{}, {"wrong_rate": RATE}], ids=["plain", "guarded"])
def test_a_target_that_slipped_once_is_named_and_without_a_guard_no_bound_is_stated(guard):
    campaign = run(4, slipped(90), **guard)
    (named,) = campaign.suspicious()
    assert (named.number, named.row) == (90, campaign.ledger.readings[89][0])
    codes = [each.code for each in campaign.alarms()]
    assert codes == ["wrong_readings"] if guard else codes[0] == "wrong_readings"
    for said in campaign.statements():
        assert said.value_mm > 0.0
        if guard:
            assert said.lower_mm <= LARGEST <= said.upper_mm
            continue
        assert said.withheld.code == "wrong_readings"
        assert said.withheld.numbers == {"readings": 1, "number": 90}
        assert math.isnan(said.upper_mm)
        assert math.isnan(said.lower_mm)


def test_where_all_is_noise_hardly_any_reading_is_named():
    assert sum(bool(run(seed, slipped()).suspicious()) for seed in range(30)) <= 1
