"""The bounds of search_and_confirm, worked out again from the raw readings in the order taken.

Own slow code: scipy's noncentral chi-square for the limits, a product of plain ratios for the
chance of missing points, fractions for the expected number of new largest points.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scipy.stats import ncx2

from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.simulate import conduct
from kinacc.assess.world import drawn_world

WRONG = Fraction(1, 20)  # of the statements on either target
MISSED = Fraction(1, 50)  # of those on all candidates: what they lose by points never read
LOOKS = {1: 0.60, 2: 0.16, 4: 0.10, 8: 0.06, 16: 0.04, 32: 0.02, 64: 0.01, 128: 0.005}


class Recorded:
    """A world that writes down every reading it gives away: (row, reading) in order."""

    def __init__(self, world):
        self.points, self.sigma_mm = world.points, world.sigma_mm
        self._world, self.given = world, []

    def reading_mm(self, row, visit):
        reading = self._world.reading_mm(row, visit)
        self.given.append((row, np.array(reading)))
        return reading


def limits(sizes, noise, error):
    """Sizes a at which readings (n,) at most as large have probability ``error``; by bisection."""
    square = (sizes / noise) ** 2
    low, high = np.zeros(len(sizes)), np.sqrt(square) + 10.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = ncx2.cdf(square, 3, middle**2) > error
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    return noise * high


def largest_limit(given, sigma, error):
    """Largest over the points of each point's smallest limit at 1, 2, 4, .. readings."""
    sums, count, sizes, noises, errors, rows = {}, {}, [], [], [], []
    for row, reading in given:
        sums[row] = sums.get(row, 0.0) + reading
        n = count[row] = count.get(row, 0) + 1
        if n in LOOKS:
            sizes.append(np.linalg.norm(sums[row] / n))
            noises.append(sigma[row] / np.sqrt(n))
            errors.append(float(error) * LOOKS[n])
            rows.append(row)
    found = limits(np.array(sizes), np.array(noises), np.array(errors))
    smallest = {row: min(found[np.array(rows) == row]) for row in set(rows)}
    return max(smallest.values())


def missed(marked, points, seen):
    """Probability that none of ``marked`` points is among ``seen`` of ``points``."""
    chance = Fraction(1)
    for drawn in range(seen):
        chance *= Fraction(max(points - marked - drawn, 0), points - drawn)
    return chance


def visited_anyway(points, budget):
    """Number of points the settings promise to visit whatever is read."""
    if 2 * budget >= 3 * points:
        return points
    nearly_all = min(n for n in range(points + 1) if missed(1, points, n) <= MISSED)
    return nearly_all if nearly_all <= budget else -(-6 * min(budget, points) // 10)


def worked_out(given, sigma, points, budget):
    """Limits (mm) for the points read, once at 5 % and once at what 2 % for missing others leave.

    Then how many points are missed together with at most 2 %, and how many were read.
    """
    seen, anyway = len({row for row, _ in given}), visited_anyway(points, budget)
    more = sum((Fraction(1, i) for i in range(anyway + 1, min(budget, points) + 1)), Fraction(1))
    here = largest_limit(given, sigma, WRONG / more)
    if anyway == points:
        return here, here, 1, seen
    unlikely = next(c for c in range(1, points + 1) if missed(c, points, seen) <= MISSED)
    everywhere = largest_limit(given, sigma, (WRONG - MISSED) / more)
    return here, everywhere, unlikely, seen


def campaign(points, budget, large, noise_mm):
    """Statements and readings of a campaign: ``large`` errors near 1 mm, all others below 0.8."""
    rng = np.random.default_rng([points, budget, large])
    size = np.append(rng.uniform(0.9, 1.0, large), rng.uniform(0.0, 0.8, points - large))
    error = rng.normal(size=(points, 3))
    error *= (size / np.linalg.norm(error, axis=1))[:, None]
    sigma = rng.uniform(0.8, 1.2, points) * noise_mm
    key = np.array([points, budget], np.uint64)
    recorded = Recorded(drawn_world(error, sigma, key, 300, rng.permutation(points)))
    return conduct(SearchAndConfirm(measurements=budget), recorded).statements(), recorded


@pytest.mark.parametrize(
    ("points", "budget", "large", "noise_mm", "read"),
    [
        (200, 200, 5, 0.05, {196}),
        (200, 197, 5, 0.05, {196}),
        (200, 140, 60, 0.03, range(84, 141)),
        (200, 400, 5, 0.1, {200}),
        (50, 50, 1, 0.05, {49}),
        (50, 60, 1, 0.05, {50}),  # all are visited, but only because the readings said so
    ],
)
def test_bounds_follow_from_the_raw_readings(points, budget, large, noise_mm, read):
    (measured, everywhere), world = campaign(points, budget, large, noise_mm)
    here, beyond, unlikely, seen = worked_out(world.given, world.sigma_mm, points, budget)
    assert len(world.given) == budget
    assert seen in read
    assert len({row for row, _ in world.given}) < len(world.given)
    # The likely size is a floor of every bound; here it is below that on the measured points.
    assert measured.value_mm < here
    assert measured.upper_mm == pytest.approx(here, rel=1e-6)
    assert not everywhere.withheld
    stretch = 1.0 if unlikely == 1 else 1.25
    expected = stretch * max(beyond, everywhere.value_mm)
    assert everywhere.upper_mm == pytest.approx(expected, rel=1e-6)
    assert bool(everywhere.assumption) == (unlikely > 1)
    if everywhere.assumption:
        assert everywhere.assumption.numbers["crowd"] == unlikely
    if unlikely == 1:
        assert everywhere.value_mm < beyond
