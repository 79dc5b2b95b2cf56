"""The bounds of search_and_confirm, worked out again from the raw readings in the order taken.

Own slow code for the looks of every point, for the points left out and for the lower bound's sums;
the boundaries themselves are held to other means in test_looks.py.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.stats import chi2
from simulated_campaigns import away, conducted, equal

from kinacc.assess.search_and_confirm import SearchAndConfirm
from kinacc.assess.world import conduct, drawn_world

ERROR, SIGMA_MM = 0.05, 0.1


def campaign(points, budget):
    """A campaign to its end, its readings and its noise by point; errors up to 1 mm."""
    rng = np.random.default_rng([points, budget])
    error = away(rng, rng.uniform(0.0, 1.0, points))
    sigma = rng.uniform(0.8, 1.2, points) * 0.05
    key = np.array([points, budget], np.uint64)
    world = drawn_world(error, sigma, key, budget, rng.permutation(points))
    said = conduct(SearchAndConfirm(measurements=budget, noise_margin=1.0), world)
    given = [(row, np.array(reading)) for row, reading, _ in said.ledger.readings]
    return said, given, world.sigma_mm


def largest_limit(given, sigma, counts, z):
    """Largest over the points of each point's smallest limit at as many readings as in counts."""
    found = {}
    for row in {row for row, _ in given}:
        own = np.array([reading for at, reading in given if at == row])
        for count, each in zip(counts, z, strict=True):
            if count <= len(own):
                limit = np.linalg.norm(own[:count].mean(axis=0)) + each * sigma[row] / count**0.5
                found[row] = min(limit, found.get(row, np.inf))
    return max(found.values())


def shown(said, given, sigma):
    """Noise over that stated by the pooled variance within blocks; 1 at least."""
    of_block = {}
    for block, (row, reading) in zip(said.blocks, given, strict=True):
        of_block.setdefault(block, []).append(reading / sigma[row])
    freedom = sum(3 * (len(each) - 1) for each in of_block.values())
    square = sum(3 * len(each) * np.var(each, axis=0).mean() for each in of_block.values())
    return max(1.0, np.sqrt(square / freedom)) if freedom >= 30 else 1.0


def left_out(points, seen, error):
    """Fewest points such that these and one more are all missed with ``error`` at most."""
    for largest in range(1, points + 1):
        chance = Fraction(1)
        for drawn in range(seen):
            chance *= Fraction(max(points - largest - drawn, 0), points - drawn)
        if chance <= error:
            return largest - 1
    raise AssertionError


@pytest.mark.parametrize(("budget", "visited"), [(194, 175), (195, 195), (204, 195), (205, 200)])
def test_candidates_are_left_out_where_hardly_a_reading_would_confirm(budget, visited):
    """195 of 200 are the fewest of which 5 others hold the largest in 2.5 % of cases at most."""
    assert SearchAndConfirm(measurements=budget).visit(200) == visited


@pytest.mark.parametrize(("points", "budget"), [(60, 90), (60, 300), (40, 200)])
def test_the_upper_bound_follows_from_the_raw_readings(points, budget):
    said, given, sigma = campaign(points, budget)
    looks = said.boundary_of(ERROR)
    factor = shown(said, given, sigma)
    wanted = largest_limit(given, factor * sigma, looks.counts, looks.z)
    measured, everywhere = said.statements()
    stated = measured.noise.numbers["factor"] if measured.noise else 1.0
    assert stated == pytest.approx(factor)
    assert len(given) == budget
    assert measured.upper_mm == pytest.approx(max(wanted, measured.value_mm), rel=1e-9)
    assert everywhere.upper_mm == pytest.approx(measured.upper_mm, rel=1e-9)
    assert everywhere.excepted == 0


@pytest.mark.parametrize(("points", "budget"), [(60, 30), (200, 50), (200, 150)])
def test_where_fewer_are_read_than_there_are_the_bound_is_of_all_but_the_fewest(points, budget):
    said, given, sigma = campaign(points, budget)
    everywhere = said.statements()[1]
    seen = len({row for row, _ in given})
    assert seen < points
    assert everywhere.excepted == left_out(points, seen, Fraction(1, 40))
    ahead = said.settings.shortfall(points)
    assert ahead.numbers["excepted"] == everywhere.excepted
    looks = said.boundary_of(ERROR / 2)
    wanted = largest_limit(given, sigma, looks.counts, looks.z)
    assert everywhere.upper_mm == pytest.approx(wanted, rel=1e-9)


def test_a_point_whose_readings_differ_in_noise_keeps_its_bound():
    chance, draws = np.random.default_rng(6), 400
    errors = away(chance, np.array([1.0, 0.01, 0.01, 0.01]))
    too_small = too_large = 0
    for _ in range(draws):
        campaign = SearchAndConfirm(16, noise_margin=1.0).begin(equal(4, SIGMA_MM))
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


def test_points_read_again_for_being_large_scatter_within_blocks_as_stated():
    rng, square, freedom = np.random.default_rng(7), 0.0, 0
    for _ in range(60):
        values = conducted(rng, away(rng, np.full(20, 4.0)), 100).noise.contrasts
        square, freedom = square + values.squares.sum(), freedom + values.freedom
    assert freedom >= 60 * 36
    assert 0.005 < chi2.cdf(square, freedom) < 0.995
