"""Campaigns whose frame drifts or jumps: what is read, what is said, and whether bounds hold."""

import math

import numpy as np
import pytest

from kinacc.assess.adaptive import Candidates
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.statement import CANDIDATES
from kinacc.errors import InputError

POINTS, BUDGET = 40, 110


def errors(rng):
    """One pose far out of 40, noise 1 mm."""
    way = rng.normal(size=(POINTS, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    size = np.abs(rng.normal(size=POINTS))
    size[rng.integers(POINTS)] = 12.0
    return way * size[:, None]


def run(rng, errors_mm, change_mm=lambda time: 0.0 * time, stop=BUDGET, noise=None, **settings):
    """A campaign of 110 readings, its change along a random direction; rows in the order read."""
    campaign = SearchAndConfirm(BUDGET, **settings).begin(
        Candidates(np.tile(np.eye(3) if noise is None else noise, (POINTS, 1, 1)))
    )
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    rows = []
    while len(rows) < stop and (row := campaign.next()) is not None:
        seen = rng.normal(size=3) if noise is None else rng.multivariate_normal(np.zeros(3), noise)
        campaign.record(row, errors_mm[row] + seen + change_mm(len(rows) / BUDGET) * way)
        rows.append(row)
    return campaign, rows


def said(campaign):
    return next(each for each in campaign.statements() if each.target == CANDIDATES)


def test_reference_poses_are_read_in_their_places_within_the_budget():
    rng = np.random.default_rng(1)
    campaign, rows = run(rng, errors(rng), references=20)
    assert len(rows) == BUDGET
    assert rows[:10] == [0, 1, 2, 3, 4] * 2
    assert rows[-5:] == [0, 1, 2, 3, 4]
    assert tuple(rows[: len(campaign.visit())]) == campaign.visit()
    assert set(campaign.visit()) == set(range(POINTS))
    assert [campaign.ledger.count[row] >= 5 for row in range(5)] == [True] * 5


def test_what_is_read_at_planned_places_does_not_hang_on_readings():
    places = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        campaign, rows = run(rng, errors(rng) * seed, references=12)
        places.append([(at, rows[at]) for at in sorted(campaign.plan.row_at)])
    assert all(each == places[0] for each in places)


def test_a_campaign_that_drifted_states_no_bounds_and_says_why():
    rng = np.random.default_rng(2)
    campaign, _ = run(rng, errors(rng), lambda time: 8.0 * time, references=20)
    answer = said(campaign)
    assert answer.withheld.code == "drift"
    assert math.isnan(answer.upper_mm)
    assert math.isnan(answer.lower_mm)
    assert answer.value_mm > 0.0
    assert abs(answer.withheld.numbers["size"] - 8.0) < 3.0 * answer.withheld.numbers["deviation"]


def test_a_tripod_that_was_moved_withholds_bounds():
    rng = np.random.default_rng(3)
    campaign, _ = run(rng, errors(rng), lambda time: 9.0 * (time > 0.55), references=20)
    assert said(campaign).withheld.code == "step"
    about = said(campaign).withheld.numbers
    assert about["after"] <= 0.55 * BUDGET < about["before"]


def test_uncorrected_bounds_fail_where_nobody_looks_for_a_drift():
    rng, missed = np.random.default_rng(4), 0
    for _ in range(40):
        sizes = errors(rng)
        campaign, _ = run(rng, sizes, lambda time: 4.0 * time)
        largest = float(np.linalg.norm(sizes, axis=1).max())
        missed += not said(campaign).lower_mm <= largest <= said(campaign).upper_mm
    assert missed > 20


def test_a_campaign_told_again_says_the_same():
    rng = np.random.default_rng(7)
    campaign, _ = run(rng, errors(rng), references=8)
    again = campaign.settings.begin(campaign.ledger.candidates)
    for row, reading, covariance in campaign.ledger.readings:
        assert again.next() == row
        again.record(row, np.array(reading), covariance)
    assert again.statements() == campaign.statements()


def test_more_revisits_than_readings_are_refused():
    with pytest.raises(InputError, match="references"):
        SearchAndConfirm(25, references=20)
