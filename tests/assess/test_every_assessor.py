"""Every assessor that chooses as it goes: one interface, honest bounds, an independent answer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import binom, chi2, ncx2, norm
from simulated_campaigns import away, equal

from kinacc.assess.adaptive import Candidates, Ledger
from kinacc.assess.region_share import RegionShare
from kinacc.assess.registry import ADAPTIVE
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.single_shot import SingleShot
from kinacc.assess.statement import (
    ACCEPT,
    CANDIDATES,
    MEASURED,
    REJECT,
    UNDECIDED,
    Reason,
    Statement,
    decide,
)
from kinacc.assess.world import conduct, drawn_world, key_of
from kinacc.errors import InputError

BOUNDING = [SingleShot, SearchAndConfirm]
LIVE = [kind(40) for kind in ADAPTIVE.values()]


def field(points: int) -> np.ndarray:
    """Errors of 0.2 to 1 mm, larger ones rarer."""
    rng = np.random.default_rng(5)
    return away(rng, 1.0 - 0.8 * rng.uniform(size=points) ** 0.5)


@pytest.mark.parametrize("assessor", LIVE, ids=lambda each: each.name)
@pytest.mark.parametrize("points", [1, 2, 15, 60])
def test_every_assessor_keeps_its_budget_and_says_something_at_the_end(assessor, points):
    campaign = conduct(assessor, drawn_world(field(points), 0.1, key_of(1), 40))
    said = campaign.statements()
    assert said[0].value_mm > 0.0 or said[0].withheld
    assert not said[0].withheld or type(assessor) not in BOUNDING
    assert campaign.ledger.taken <= assessor.measurements
    for each in said:
        if not each.withheld and not math.isnan(each.upper_mm):
            assert each.lower_mm <= each.upper_mm
            assert each.confidence == 0.95
    assert campaign.next() is None


@pytest.mark.parametrize(
    "wrong",
    [
        (0, [math.nan, 0.0, 0.0], None),
        (0, [0.0, 0.0], None),
        (30, [0.0, 0.0, 0.0], None),
        (-1, [0.0, 0.0, 0.0], None),
        (0, [0.1, 0.0, 0.0], np.diag([1.0, 1.0, -1.0])),
    ],
)
def test_a_reading_that_cannot_be_used_changes_nothing(wrong):
    campaign = SearchAndConfirm(40).begin(equal(30))
    with pytest.raises(InputError):
        campaign.record(*wrong)
    assert (campaign.ledger.taken, campaign.next()) == (0, 0)


@pytest.mark.parametrize(
    ("covariance", "said"),
    [
        (np.zeros((2, 3, 3)), "point 0: is no covariance"),
        (np.stack([np.eye(3), np.diag([1.0, 1.0, -1e-3])]), "point 1: is no covariance"),
        (np.array([[[1.0, 0.9, 0], [0, 1, 0], [0, 0, 1]]]), "point 0: is no covariance"),
        (np.full((1, 3, 3), np.nan), "point 0: is no covariance"),
        (np.eye(3), "point 2: is no covariance"),
    ],
)
def test_covariances_that_are_none_are_refused_with_their_point(covariance, said):
    with pytest.raises(InputError, match=said):
        Candidates(covariance)


def test_unequal_noise_is_weighted_as_least_squares_would():
    ledger = Ledger(equal(2))
    rng = np.random.default_rng(6)
    readings = rng.normal(size=(5, 3))
    spreads = [np.diag(rng.uniform(0.5, 2.0, 3)) + 0.2 for _ in readings]
    spreads[0] = 0.01 * np.eye(3)
    for reading, spread in zip(readings, spreads, strict=True):
        ledger.record(1, reading, spread)
    inverses = [np.linalg.inv(each) for each in spreads]
    total = np.linalg.inv(sum(inverses))
    weighted = sum(each @ reading for each, reading in zip(inverses, readings, strict=True))
    assert ledger.mean_mm[1] == pytest.approx(total @ weighted)
    assert ledger.noise(1) == pytest.approx(total)
    assert ledger.noise_mm[1] == pytest.approx(math.sqrt(np.diag(total).mean()))


# Share of 400 bounds that 95 % confidence may fall to by chance in a test of many.
LEAST, DRAWS = 0.95 - 3.5 * math.sqrt(0.05 * 0.95 / 400), 400


@pytest.mark.parametrize(
    "sizes", [np.r_[1.0, np.full(11, 1e-3)], np.ones(12)], ids=["one large", "all large"]
)
def test_the_bound_on_the_measured_points_holds(sizes):
    # One large error is the hardest for the upper limit: no other point's noise comes to its aid;
    # many are the hardest for the lower one.
    errors, held = away(np.random.default_rng(5), sizes), np.zeros(2)
    for draw in range(DRAWS):
        order = np.random.default_rng([draw, 3]).permutation(12)
        readings = drawn_world(errors[order], 0.2, key_of(4, draw), 20)
        said = conduct(SearchAndConfirm(20), readings).statements()[0]
        held += said.upper_mm >= 1.0, said.lower_mm <= 1.0
    assert held.min() >= DRAWS * LEAST


@pytest.mark.parametrize("sigma", [0.001, 0.5])
def test_the_share_of_the_region_keeps_its_confidence(sigma):
    rng = np.random.default_rng(4)
    pool = rng.normal(size=(4000, 3)) * rng.uniform(0.1, 0.5, (4000, 1))
    truth = np.quantile(np.linalg.norm(pool, axis=1), 0.9)
    held, ledger = np.zeros(2), Ledger(equal(80, sigma))
    ledger.visited, ledger.spread_mm2 = list(range(80)), ledger.candidates.covariance_mm2
    for _ in range(DRAWS):
        ledger.mean_mm = pool[rng.integers(0, 4000, 80)] + sigma * rng.normal(size=(80, 3))
        (said,) = RegionShare(80).state(ledger)
        held += said.upper_mm >= truth, said.lower_mm <= truth
    assert held.min() >= DRAWS * LEAST


def test_bounds_on_a_share_are_the_readings_that_binomial_counts_allow():
    campaign = RegionShare(200).begin(Candidates(np.tile(np.diag([0.04, 0.09, 0.01]), (200, 1, 1))))
    for row in range(200):
        campaign.record(row, [1.0 + row, 0.0, 0.0])
    (said,) = campaign.statements()
    numbers = np.arange(1, 201)  # of largest readings
    upper = numbers[binom.cdf(numbers - 1, 200, 0.1 * norm.cdf(1.0)) <= 0.05].max()
    lower = numbers[binom.sf(numbers - 1, 200, 0.1 + 0.9 * 0.01) <= 0.05].min()
    # Of the largest noise, one standard deviation more; less by a length that 1 % exceed.
    assert said.upper_mm == pytest.approx(201 - upper + 0.3)
    assert said.lower_mm == pytest.approx(201 - lower - 0.3 * math.sqrt(chi2.isf(0.01, 3)))
    assert said.value_mm == pytest.approx(180.1)


def test_a_share_of_the_region_needs_the_points_that_it_names():
    errors = np.random.default_rng(2).normal(size=(200, 3))
    stated = {}
    for count in range(25, 60):
        world = drawn_world(errors[:count], 0.01, key_of(1), 1)
        (said,) = conduct(RegionShare(count), world).statements()
        stated[count] = said.withheld is None
        if said.withheld is not None:
            needed = said.withheld.numbers["needed"]
    fewest = min(count for count, is_stated in stated.items() if is_stated)
    assert fewest == needed
    # Exact readings take 29: 0.9 to the power of 29 is below 0.05; noise a few more.
    assert 29 <= fewest <= 40


@pytest.mark.parametrize(
    ("said", "tolerance", "verdict", "reason"),
    [
        (Statement(MEASURED, 0.9, 0.8, 1.2, 0.95), 1.2, ACCEPT, "within"),
        (Statement(MEASURED, 0.9, 0.8, 1.2, 0.95), 1.0, UNDECIDED, "between"),
        (Statement(MEASURED, 0.9, 0.8, 1.2, 0.95), 0.85, UNDECIDED, "between"),
        (Statement(MEASURED, 0.9, 0.8, 1.2, 0.95), 0.7, REJECT, "beyond"),
        (Statement(MEASURED, 1.1, 0.9, 1.0, 0.95), 1.3, UNDECIDED, "contradict"),
        (Statement(MEASURED, 0.9, 1.2, 1.0, 0.95), 0.8, UNDECIDED, "contradict"),
        (Statement(CANDIDATES, 0.9, 0.8, 1.0, 0.95, excepted=3), 1.2, UNDECIDED, "some_excepted"),
        (Statement(CANDIDATES, 0.9, 0.8, 1.0, 0.95, excepted=3), 0.7, REJECT, "beyond"),
        (Statement(CANDIDATES, 0.9, withheld=Reason("suspects")), 1.0, UNDECIDED, "suspects"),
    ],
)
def test_a_tolerance_is_held_to_both_bounds(said, tolerance, verdict, reason):
    found = decide(said, tolerance)
    assert (found.verdict, found.reason.code) == (verdict, reason)
    above_mm = said.upper_mm - said.value_mm
    assert found.guard_band_mm == pytest.approx(above_mm, nan_ok=True)
    for wrong in (0.0, math.nan, math.inf):
        with pytest.raises(InputError, match="tolerance"):
            decide(said, wrong)


def test_the_lower_bound_of_single_readings_counts_every_point():
    campaign = SingleShot(40).begin(equal(40))
    for row in range(40):
        campaign.record(row, [0.1 * row, 0.0, 0.0])
    for lower_mm in (campaign.statements()[0].lower_mm, campaign.point_limits()[39][0]):
        assert ncx2.sf(1521.0, 3, 100.0 * lower_mm**2) == pytest.approx(0.05 / 40, rel=1e-3)
    upper_mm = campaign.point_limits()[39][1]
    assert ncx2.cdf(1521.0, 3, 100.0 * upper_mm**2) == pytest.approx(0.05, rel=1e-3)
