"""The limits shown beside a bound: held to slow sums, all designs and simulated campaigns."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy import integrate, optimize, special

from kinacc.assess.attainable import limits_of, proven_excess_mm, width_limits
from kinacc.assess.statement import CANDIDATES, MEASURED, REGION, Statement

ERROR = 0.05
Z = 1.6448536269514722

FIELDS = {
    "lone": np.r_[0.2 * np.ones(5), 1.0, 0.2 * np.ones(4)],
    "all tied": np.full(10, 0.5),
    "spread": np.linspace(0.05, 0.8, 10),
}


def excess_by_quad(sizes: np.ndarray, noise: np.ndarray, counts: tuple[int, ...]) -> float:
    spread = noise / np.sqrt(counts)

    levels = np.linspace(sizes.max(), float((sizes + 6.0 * spread).max()), 401)
    shortest = special.chndtrix(ERROR, 3, (levels[:, None] / spread) ** 2)
    above = 1.0 - np.prod(special.chndtr(shortest, 3, (sizes / spread) ** 2), axis=1)
    return float(integrate.simpson(above, x=levels))


@pytest.mark.parametrize(
    "sizes",
    [np.array([1.0, 0.9, 0.2]), np.array([0.5, 0.5, 0.5]), np.array([1.0, 0.3, 0.3])],
    ids=["near", "tied", "lone"],
)
def test_no_other_counts_do_much_better_than_the_best_counts(sizes):
    noise, readings = np.array([0.2, 0.1, 0.3]), 9
    every = (c for c in itertools.product(range(1, 8), repeat=3) if sum(c) == readings)
    best_mm = min(excess_by_quad(sizes, noise, counts) for counts in every)
    said = width_limits(sizes, noise, readings, ERROR).attainable_mm
    assert best_mm - 1e-4 <= said <= 1.02 * best_mm


def proven_slowly(sizes: np.ndarray, noise: np.ndarray, readings: int) -> float:
    def divergence(p: float) -> float:
        return special.rel_entr(p, ERROR) + special.rel_entr(1.0 - p, 1.0 - ERROR)

    def excess(level: float) -> float:
        distance = (level - sizes) / noise
        test = min(special.ndtr(math.sqrt(readings) * distance - Z))

        def over(p: float) -> float:
            needed = np.maximum(2.0 * divergence(p) / distance**2, 1.0 - ERROR)
            return needed.sum() - readings

        paid = 1.0 if over(1.0) <= 0.0 else optimize.brentq(over, ERROR, 1.0)
        return 1.0 - min(test, paid)

    top = sizes.max()
    edges = top + np.r_[1e-9, np.geomspace(0.01, 20.0, 12)]
    return sum(integrate.quad(excess, *ends, limit=200)[0] for ends in itertools.pairwise(edges))


@pytest.mark.parametrize("field", ["lone", "all tied", "spread"])
def test_the_proven_excess_is_the_integral_of_what_readings_can_pay_for(field):
    sizes, noise = FIELDS[field], np.linspace(0.08, 0.2, 10)
    for readings in (10, 30):
        said = proven_excess_mm(sizes, noise, readings, ERROR)
        assert said == pytest.approx(proven_slowly(sizes, noise, readings), rel=2e-3)


@pytest.mark.parametrize(("readings", "at_largest"), [(10, 1), (18, 9)])
def test_below_all_spare_readings_are_at_the_largest_point(readings, at_largest):
    sizes, noise = FIELDS["lone"], np.linspace(0.08, 0.2, 10)
    lower_mm = width_limits(sizes, noise, readings, ERROR).attainable_lower_mm
    assert lower_mm == pytest.approx(Z * noise[5] / math.sqrt(at_largest))


def test_limits_are_told_of_statements_on_the_mean_error_of_all_their_points_alone():
    sizes, noise = FIELDS["spread"], np.full(10, 0.1)
    visited = [9, 2, 4]

    def told(target, upper_mm=1.0, **more):
        said = Statement(target, upper_mm=upper_mm, confidence=1.0 - ERROR, **more)
        return limits_of(said, visited, sizes, noise, 15)

    assert told(CANDIDATES) == pytest.approx(width_limits(sizes, 0.1, 15, ERROR))
    assert told(MEASURED) == pytest.approx(width_limits(sizes[visited], 0.1, 15, ERROR))
    for other in (
        told(REGION, share=0.9),
        told(CANDIDATES, upper_mm=math.nan),
        told(CANDIDATES, excepted=2),
        told(MEASURED, error_of="visit"),
    ):
        assert all(math.isnan(limit) for limit in other)
