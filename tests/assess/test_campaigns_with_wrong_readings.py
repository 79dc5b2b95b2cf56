"""Campaigns in which some readings go wrong: what is named, what is withheld, what still holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from kinacc.assess.adaptive import Candidates
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.errors import InputError

POINTS, BUDGET = 60, 120
RATE = 0.02


def errors(rng, tied):
    """Some equal errors of 6 times the noise, all others smaller."""
    way = rng.normal(size=(POINTS, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    return rng.permutation(
        way * np.r_[np.full(tied, 6.0), rng.uniform(0, 2, POINTS - tied)][:, None]
    )


def run(seed, wrong, measurements=BUDGET, stop=BUDGET, tied=6, tested=1.0, **settings):
    """A campaign and the largest error; ``wrong(number, rng, error)``: a shift (3,) or None.

    ``tested``: what the noise, 1, is taken for.
    """
    rng = np.random.default_rng(seed)
    error, numbers = errors(rng, tied), iter(range(1, stop + 1))
    even = np.tile(tested**2 * np.eye(3), (POINTS, 1, 1))
    campaign = SearchAndConfirm(measurements, **settings).begin(Candidates(even))
    for number in numbers:
        if (row := campaign.next()) is None:
            break
        shift = wrong(number, rng, error[row])
        campaign.record(row, error[row] + rng.normal(size=3) + (0.0 if shift is None else shift))
    return campaign, 6.0


def at_random(rate):
    def shift(number, rng, error):
        way = rng.normal(size=3)
        return 10.0 * way / np.linalg.norm(way) if rng.random() < rate else None

    return shift


def along(rate, size):
    """Large errors look smaller, the worst for the upper bound, or larger, for the lower one."""

    def shift(number, rng, error):
        return size * error / np.linalg.norm(error) if rng.random() < rate else None

    return shift


@pytest.mark.parametrize(
    ("wrong", "rate", "tied"),
    [(at_random(0.02), 0.02, 6), (along(0.1, -10.0), 0.1, 1), (along(0.02, 10.0), 0.02, 6)],
    ids=["at random", "inwards", "outwards"],
)
def test_bounds_hold_as_stated_where_some_readings_go_wrong(wrong, rate, tied):
    campaigns, too_low, too_high = 12, 0, 0
    for seed in range(campaigns):
        campaign, largest = run(seed, wrong, tied=tied, wrong_rate=rate)
        said = campaign.statements()[1]
        assert said.withheld is None
        assert said.confidence == pytest.approx(0.95 - rate)
        too_low += said.upper_mm < largest
        too_high += said.lower_mm > largest
    most = campaigns * (0.05 + rate) + 3.0 * math.sqrt(campaigns * (0.05 + rate) * (0.95 - rate))
    assert max(too_low, too_high) <= most


@pytest.mark.parametrize("low", [0.02, 0.5])
def test_a_guard_takes_the_upper_limit_of_a_noise_that_was_tested_before(low):
    """The test of 60 degrees of freedom found less noise than there is, by chance."""
    tested = math.sqrt(chi2.ppf(low, 60) / 60)
    settings = {"noise": "estimated", "noise_freedom": 60, "wrong_rate": RATE, "tied": 1}
    missed = 0
    for seed in range(12):
        campaign, largest = run(seed, at_random(RATE), tested=tested, **settings)
        said = campaign.statements()[1]
        assert said.noise.code == "noise_limited"
        most = math.sqrt(60 / chi2.ppf(0.01, 60))
        assert said.noise.numbers == {"factor": pytest.approx(most), "freedom": 60}
        assert tested * most > 1.0
        assert said.confidence == pytest.approx(0.95 - RATE)
        missed += not said.lower_mm <= largest <= said.upper_mm
    assert missed <= 3


def test_the_guard_is_no_excuse_for_a_wide_bound():
    plain, guarded = [], []
    for seed in range(6):
        for widths, settings in ((plain, {}), (guarded, {"wrong_rate": RATE})):
            campaign, largest = run(seed, lambda *_: None, **settings)
            said = campaign.statements()[1]
            widths.append((said.upper_mm - largest, largest - said.lower_mm))
    upper, lower = np.mean(guarded, axis=0) / np.mean(plain, axis=0)
    assert upper < 1.35
    assert lower < 1.5


def test_a_target_that_slipped_once_is_named_and_without_a_guard_no_bound_is_stated():
    slip = {90: np.array([0.0, 0.0, 14.0])}
    campaign, _ = run(4, lambda number, *_: slip.get(number))
    (named,) = campaign.suspicious()
    assert named.number == 90
    assert named.row == campaign.ledger.readings[89][0]
    for said in campaign.statements():
        assert said.withheld.code == "wrong_readings"
        assert said.withheld.numbers == {"readings": 1, "number": 90}
        assert math.isnan(said.upper_mm)
        assert math.isnan(said.lower_mm)
        assert said.value_mm > 0.0


def test_with_a_guard_the_slip_is_named_and_bounds_are_stated():
    slip = {90: np.array([0.0, 0.0, 14.0])}
    campaign, largest = run(4, lambda number, *_: slip.get(number), wrong_rate=RATE)
    assert [each.number for each in campaign.suspicious()] == [90]
    assert [each.code for each in campaign.alarms()] == ["wrong_readings"]
    said = campaign.statements()[1]
    assert said.lower_mm <= largest <= said.upper_mm


def test_a_single_reading_far_off_bounds_nothing_from_below_where_it_may_be_wrong():
    far = {7: np.array([40.0, 0.0, 0.0])}
    for rate, is_believed in ((0.0, True), (RATE, False)):
        campaign, largest = run(
            2, lambda number, *_: far.get(number), POINTS, POINTS, wrong_rate=rate
        )
        said = campaign.statements()[0]
        assert (said.lower_mm > largest) == is_believed
        assert said.upper_mm > largest


def test_a_reference_pose_read_wrong_once_is_no_moved_tripod_and_a_moved_tripod_is_one():
    away = np.array([0.0, 0.0, 12.0])
    settings = {"wrong_rate": RATE, "references": 20}
    campaign, _ = run(5, lambda *_: None, **settings)
    number = sorted(campaign.plan.row_at)[12] + 1
    campaign, _ = run(5, lambda at, *_: away if at == number else None, **settings)
    assert campaign.statements()[1].withheld is None
    campaign, _ = run(5, lambda at, *_: away if at > 80 else None, **settings)
    assert campaign.statements()[1].withheld.code == "step"


def test_single_points_have_no_lower_limit_where_any_reading_may_be_wrong():
    campaign, _ = run(3, at_random(RATE), wrong_rate=RATE)
    assert {lower for lower, _ in campaign.point_limits().values()} == {0.0}


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"wrong_rate": 0.3}, "from 0 to 0.1"),
        ({"wrong_rate": -0.1}, "from 0 to 0.1"),
        ({"wrong_rate": 0.01, "noise": "estimated"}, "0 where the campaign estimates the noise"),
    ],
)
def test_a_guard_that_cannot_be_kept_is_refused(settings, told):
    with pytest.raises(InputError, match=told):
        SearchAndConfirm(BUDGET, **settings)


def test_noise_twice_as_large_as_stated_is_said_and_no_reading_is_blamed():
    def twice(number, rng, error):
        return math.sqrt(3.0) * rng.normal(size=3)  # with the noise stated, twice that

    said = [run(seed, twice)[0] for seed in range(6)]
    codes = [{each.code for each in campaign.alarms()} for campaign in said]
    assert all("scatter" in each for each in codes)
    assert sum("wrong_readings" in each for each in codes) == 0
