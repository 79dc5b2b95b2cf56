"""Bounds with known noise: how near the readings after the visit bring them, and that they hold."""

from __future__ import annotations

import math

import numpy as np
import pytest

from kinacc.assess.adaptive import Candidates
from kinacc.assess.attainable import attainable_excess_mm
from kinacc.assess.lower_average import LowerAverage, direction_of
from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.statement import CANDIDATES

SIGMA_MM, POINTS, NORMAL = 0.1, 40, 1.6448536


def directed(sizes_mm, seed: int = 3) -> np.ndarray:
    """Errors of these sizes in directions of their own."""
    vectors = np.random.default_rng(seed).normal(size=(len(sizes_mm), 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None] * np.asarray(sizes_mm)[:, None]


def ended(settings: SearchAndConfirm, errors_mm: np.ndarray, chance: np.random.Generator):
    """What is said on all candidates at the end of a campaign with normal readings."""
    campaign = settings.begin(Candidates.with_equal_noise(np.full(len(errors_mm), SIGMA_MM)))
    while (row := campaign.next()) is not None:
        campaign.record(row, errors_mm[row] + SIGMA_MM * chance.normal(size=3))
    return next(each for each in campaign.statements() if each.target == CANDIDATES)


@pytest.mark.parametrize(
    ("large", "upper", "lower"), [(1, 1.25, 1.6), (2, 1.6, 2.7), (8, 2.2, 2.7)]
)
def test_readings_after_the_visit_are_spent_nearly_as_well_as_with_the_sizes_known(
    large, upper, lower
):
    sizes = np.random.default_rng(4).uniform(0.1, 0.5, POINTS)
    sizes[:large] = 1.2
    chance, budget = np.random.default_rng(5), 2 * POINTS
    settings = SearchAndConfirm(budget, noise_margin=1.0)
    said = [ended(settings, directed(sizes), chance) for _ in range(100)]
    excess = np.mean([max(each.upper_mm - 1.2, 0.0) for each in said])
    assert excess <= upper * attainable_excess_mm(sizes, SIGMA_MM, budget, 0.05)
    least = NORMAL * SIGMA_MM / math.sqrt(budget - POINTS + 1)
    assert np.mean([1.2 - each.lower_mm for each in said]) <= lower * least


def test_a_point_whose_readings_differ_in_noise_keeps_its_bound():
    errors, chance, draws = directed([1.0, 0.01, 0.01, 0.01]), np.random.default_rng(6), 400
    too_small = too_large = 0
    for _ in range(draws):
        campaign = SearchAndConfirm(16, noise_margin=1.0).begin(
            Candidates.with_equal_noise(np.full(4, SIGMA_MM))
        )
        while (row := campaign.next()) is not None:
            own = SIGMA_MM * chance.choice([0.3, 1.0, 3.0])
            reading = errors[row] + own * chance.normal(size=3)
            campaign.record(row, reading, own**2 * np.eye(3))
        lower, upper = campaign.point_limits()[0]
        too_small += upper < 1.0
        too_large += lower > 1.0
    most = 0.05 * draws + 3.5 * math.sqrt(0.05 * 0.95 * draws)
    assert 0 < too_small <= most
    assert too_large <= most


def test_a_lower_bound_holds_however_wilfully_its_readings_were_chosen():
    """Whoever goes on with what looks large misses no more often than with one point alone."""
    errors, chance, draws, wanted = directed([1.0] * 6), np.random.default_rng(7), 3000, 12
    missed = 0
    for _ in range(draws):
        total, count, average = np.zeros((6, 3)), np.zeros(6), LowerAverage(wanted, 0.05)
        while average.missing:
            mean = total / np.maximum(count, 1.0)[:, None]
            fresh = np.flatnonzero(count == 0)
            row = fresh[0] if fresh.size else np.argmax(np.sum(mean**2, axis=1))
            reading = errors[row] + SIGMA_MM * chance.normal(size=3)
            # A direction that nothing was read of counts as well, if it was chosen before.
            direction = direction_of(mean[row] if count[row] else -errors[row])
            if count[row]:
                average.record(int(row), direction, reading.tolist(), SIGMA_MM)
            total[row] += reading
            count[row] += 1
        missed += average.bound_mm(np.ones(6)) > 1.0
    assert missed / draws <= 0.05 + 3.5 * math.sqrt(0.05 * 0.95 / draws)
