"""What a budget can state, said before it is spent, against chances counted by hand or drawn."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import paper_settings as paper
import pytest

from kinacc.assess.adaptive import Candidates, first_points
from kinacc.assess.registry import RECOMMENDED
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.simulate import noisy, truth_mm
from kinacc.assess.statement import CANDIDATES, MEASURED, Reason, Statement


@pytest.mark.parametrize(
    ("measurements", "points", "share", "first"),
    [(150, 100, 0.6, 100), (149, 100, 0.6, 60), (40, 100, 0.6, 24), (41, 100, 0.6, 25),
     (1, 100, 0.6, 1), (1, 1, 0.6, 1), (50, 40, 0.5, 20), (60, 40, 0.5, 40)],
)  # fmt: skip
def test_the_first_visit_is_a_share_or_everything_where_the_budget_is_half_as_large_again(
    measurements, points, share, first
):
    assert first_points(measurements, points, share) == first


def test_a_budget_too_small_to_speak_of_all_candidates_is_told_what_would_do():
    """The recommended assessor, 95 %: two of a hundred may be missed; else all but a few."""

    def said(measurements):
        return paper.assessor(RECOMMENDED, measurements=measurements).shortfall(100, 6)

    assert said(98) is None
    for few in (97, 60, 12):
        seen = paper.assessor(RECOMMENDED, measurements=few).visit(100)
        missed = [Fraction(comb(100 - k, seen), comb(100, seen)) for k in range(1, 101 - seen)]
        left = next(k for k, chance in enumerate(missed) if chance <= Fraction(25, 1000))
        assert said(few) == Reason("excepted_ahead", {"enough": 98, "excepted": left})


def test_statements_are_held_to_what_they_speak_of():
    size = np.array([0.2, 0.9, 0.4])
    assert truth_mm(Statement(CANDIDATES, 1.0), size, [0, 2]) == 0.9
    assert truth_mm(Statement(MEASURED, 1.0), size, [0, 2]) == 0.4
    assert np.isnan(truth_mm(Statement(MEASURED, 1.0), size, None))


def test_noisy_readings_are_the_errors_and_noise_of_the_covariance_asked_for():
    errors = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    root = np.array([[0.3, 0.0, 0.0], [0.1, 0.2, 0.0], [0.0, 0.05, 0.1]])
    read = noisy(errors, root, 4000, 3, 1)
    readings = np.array([read(0, visit) for visit in range(4000)])
    np.testing.assert_allclose(readings.mean(axis=0), errors[0], atol=0.02)
    np.testing.assert_allclose(np.cov(readings.T), root @ root.T, atol=0.006)
    again = noisy(errors, root, 4000, 3, 1)
    np.testing.assert_array_equal(again(1, 7), read(1, 7))
    assert not np.array_equal(read(1, 7), read(1, 8))
    assert not np.array_equal(noisy(errors, root, 4000, 3, 2)(1, 7), read(1, 7))


def test_a_bound_on_readings_of_unequal_noise_takes_each_ones_own_covariance():
    """Two points read alike; the one whose noise is wide leaves more room above."""

    def bound(covariances):
        candidates = Candidates(np.array(covariances))
        campaign = paper.assessor("invalidation_calibrated", measurements=4).begin(candidates)
        while (row := campaign.next()) is not None:
            campaign.record(row, np.array([1.0, 0.0, 0.0]))
        return campaign.statements()[0].upper_mm

    narrow, wide = 1e-4 * np.eye(3), np.diag([0.04, 1e-4, 1e-4])
    across = np.diag([1e-4, 1e-4, 0.04])
    assert bound([narrow, wide]) > bound([narrow, narrow]) + 0.1
    assert bound([narrow, narrow]) < bound([narrow, across]) < bound([narrow, wide])


def test_few_points_of_many_speak_of_all_but_those_that_all_can_be_missed():
    candidates = Candidates.with_equal_noise(np.full(100, 0.01))
    campaign = SearchAndConfirm(12).begin(candidates)
    errors = np.random.default_rng(6).normal(size=(100, 3))
    while (row := campaign.next()) is not None:
        campaign.record(row, errors[row])
    measured, everywhere = campaign.statements()
    seen = len(campaign.ledger.visited)
    hidden = [Fraction(comb(100 - k, seen), comb(100, seen)) for k in range(1, 101 - seen)]
    crowd = next(k for k, chance in enumerate(hidden, 1) if chance <= Fraction(25, 1000))
    assert everywhere.withheld is None
    assert everywhere.excepted == crowd - 1
    assert everywhere.upper_mm > 0.0
    assert measured.withheld is None
    assert measured.lower_mm <= measured.value_mm <= measured.upper_mm
