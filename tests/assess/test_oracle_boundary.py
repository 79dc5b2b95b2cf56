"""The boundary of the looks, and what rests on it, by slow means that share no code with it.

Walks drawn at random, multivariate normal probabilities, and adversaries that choose what is read.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from kinacc.assess.boundary import boundary, crossing, look_counts
from kinacc.assess.lower_average import LowerAverage

ERROR = 0.05
WALKS = 200_000
CLOSE = 4.0 * np.sqrt(ERROR * (1.0 - ERROR) / WALKS)  # four standard deviations of a share


def share_below(counts, z, rng, scale=1.0, walks=WALKS):
    """Share of Gaussian walks that are below -z s sqrt(k) at any look, drawn look by look."""
    at, sure = np.zeros(walks), np.zeros(walks, dtype=bool)
    for step, count, each in zip(np.diff(counts, prepend=0), counts, z, strict=True):
        at += np.sqrt(step) * rng.normal(size=walks)
        sure |= at < -each * scale * np.sqrt(count)
    return sure.mean()


@pytest.mark.parametrize("extra", [0, 7, 100, 600])
def test_walks_drawn_at_random_cross_the_boundary_as_often_as_is_allowed(extra):
    looks, rng = boundary(look_counts(extra), ERROR), np.random.default_rng(extra)
    assert share_below(looks.counts, looks.z, rng) == pytest.approx(ERROR, abs=CLOSE)
    assert share_below(looks.counts, 0.95 * looks.z, rng) > ERROR + CLOSE


@pytest.mark.parametrize("freedom", [30, 60])
def test_walks_cross_as_often_as_is_allowed_where_one_deviation_is_estimated_for_all(freedom):
    looks, rng = boundary(look_counts(100), ERROR, freedom), np.random.default_rng(freedom)
    scale = np.sqrt(rng.chisquare(freedom, WALKS) / freedom)
    assert share_below(looks.counts, looks.z, rng, scale) == pytest.approx(ERROR, abs=CLOSE)
    assert share_below(looks.counts, 0.95 * looks.z, rng, scale) > ERROR + CLOSE


def test_the_crossing_probability_is_that_of_a_multivariate_normal():
    counts, z = (1, 3, 6, 20), np.array([2.1, 2.6, 2.4, 1.9])
    spread = [[np.sqrt(min(a, b) / max(a, b)) for a in counts] for b in counts]
    stays = multivariate_normal(cov=spread, abseps=1e-6, maxpts=1_000_000, seed=1).cdf(z)
    assert crossing(counts, z) == pytest.approx(1.0 - stays, abs=5e-6)


def block_ends(counts, taken):
    """The next look after ``taken`` (c,) readings, the last one for good."""
    return counts[np.minimum(np.searchsorted(counts, taken, side="right"), len(counts) - 1)]


def share_false(size, z, counts, choose, campaigns, rng):
    """Share of campaigns in which the largest of the limits |mean| + z_k / sqrt(k) is below.

    size (m,): true sizes, noise 1. ``choose(sums, count, limits)``: the point (c,) that each
    campaign reads up to its next look, -1 to stop. Own code: m points, their sums in three axes.
    """
    points, extra = len(size), counts[-1] - 1
    errors = size[:, None] * np.eye(3)[0]
    sums = errors + rng.normal(size=(campaigns, points, 3))
    count = np.ones((campaigns, points), dtype=int)
    limits = np.linalg.norm(sums, axis=2) + z[0]
    left, rows = np.full(campaigns, extra), np.arange(campaigns)
    while True:
        point = choose(sums, count, limits)
        end = block_ends(counts, count[rows, point])
        more = np.where(point >= 0, end - count[rows, point], 0)
        more = np.where(more > left, 0, more)
        if not more.any():
            return np.mean(limits.max(axis=1) < size.max())
        noise = np.sqrt(more)[:, None] * rng.normal(size=(campaigns, 3))
        sums[rows, point] += more[:, None] * errors[point] + noise
        count[rows, point] += more
        left -= more
        k = count[rows, point]
        here = (
            np.linalg.norm(sums[rows, point], axis=1) / k + z[np.searchsorted(counts, k)] / k**0.5
        )
        limits[rows, point] = np.minimum(limits[rows, point], here)


def smallest_mean(sums, count, limits):
    return np.argmin(np.linalg.norm(sums, axis=2) / count, axis=1)


def largest_limit(sums, count, limits):
    return np.argmax(limits, axis=1)


def one_point_until_it_is_too_low(sums, count, limits):
    return np.where(limits[:, 0] < 20.0, -1, 0)


def the_large_while_low(sums, count, limits):
    """Knows the truth: reads the largest point as long as its limit is not below its size."""
    return np.where(limits[:, 0] < 20.0, 1, 0)


@pytest.mark.parametrize(
    "choose", [smallest_mean, largest_limit, one_point_until_it_is_too_low, the_large_while_low]
)
def test_no_choice_of_what_is_read_makes_the_upper_bound_false_more_often(choose):
    looks, campaigns = boundary(look_counts(40), ERROR), 20_000
    size, rng = np.array([20.0, 19.0, 1.0]), np.random.default_rng(1)
    false = share_false(size, looks.z, looks.counts, choose, campaigns, rng)
    assert false <= ERROR + 3.5 * np.sqrt(ERROR * 0.95 / campaigns)


def test_the_worst_choice_makes_the_upper_bound_of_one_point_false_as_often_as_is_allowed():
    looks, campaigns = boundary(look_counts(40), ERROR), 60_000
    near = 4.0 * np.sqrt(ERROR * 0.95 / campaigns)
    size, rng = np.array([300.0]), np.random.default_rng(2)

    def false(z):
        return share_false(size, z, looks.counts, largest_limit, campaigns, rng)

    assert false(looks.z) == pytest.approx(ERROR, abs=near)
    assert false(0.95 * looks.z) > ERROR + near


def lower_bounds(wanted, campaigns, rng, factor=1.0):
    """Lower bounds of campaigns that choose by what was read: largest error 1, noise as it likes.

    A reading that was high is followed by one with little noise, a low one by one with much; the
    direction of each is that of the last reading, where the error is always 1 along it.
    """
    found = np.empty(campaigns)
    for campaign in range(campaigns):
        average, sigma, noise = LowerAverage(wanted, ERROR), 1.0, rng.normal(size=wanted)
        for number in range(wanted):
            along = 1.0 + sigma * noise.item(number)
            row = number % 7
            average.record(row, [0.0, 0.6, 0.8], [9.0, 0.6 * along, 0.8 * along], sigma)
            sigma = 0.3 if along > 1.0 else 2.0
        found[campaign] = average.bound_mm(np.full(7, factor))
    return found


def test_the_lower_bound_is_false_exactly_as_often_as_allowed_whatever_is_chosen():
    bounds = lower_bounds(24, 5000, np.random.default_rng(3))
    near = 4.0 * np.sqrt(ERROR * 0.95 / len(bounds))
    assert np.mean(bounds > 1.0) == pytest.approx(ERROR, abs=near)
    less = lower_bounds(24, 5000, np.random.default_rng(3), factor=0.9)
    assert np.mean(less > 1.0) > ERROR + near
