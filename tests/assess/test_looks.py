"""The boundary of the looks and what rests on it: random walks, and an adversary."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.stats

from kinacc.assess.limits import EARLY, LATE, LowerAverage, boundary, clip_of, look_counts

ERROR, WALKS = 0.05, 200_000
CLOSE = 4.0 * np.sqrt(ERROR * (1.0 - ERROR) / WALKS)  # four standard deviations of a share


def crossed(counts, z, rng, rate=0.0, scale=1.0):
    """Shares of walks below -z s sqrt(k), and below 0.95 of it, at any look.

    Drawn reading by reading. Wrong readings are as low as can be; of a point's own readings the
    first is not clipped, and one that is wrong is paid for by itself.
    """
    at, lowest, counted = np.zeros(WALKS), np.zeros(WALKS), np.ones(WALKS, dtype=bool)
    limits, clip = dict(zip(counts, z, strict=True)), clip_of(rate) if rate else math.inf
    for number in range(1, counts[-1] + 1):
        drawn = rng.normal(size=WALKS)
        wrong = rng.random(WALKS) < rate if rate else False
        at += np.clip(np.where(wrong, -math.inf, drawn), -clip, clip) if rate else drawn
        if number == 1 and counts[0] == 1:
            counted = np.logical_not(wrong)
            lowest = drawn / limits[1]
        elif number in limits:
            lowest = np.minimum(lowest, at / (limits[number] * math.sqrt(number)))
    return [np.mean((lowest < -share * scale) & counted) for share in (1.0, 0.95)]


@pytest.mark.parametrize(
    ("extra", "freedom", "rate"),
    [(0, math.inf, 0.0), (100, math.inf, 0.0), (40, 30, 0.0), (40, math.inf, 0.01),
     (40, math.inf, 0.05)],
)  # fmt: skip
def test_walks_drawn_at_random_cross_the_boundary_as_often_as_is_allowed(extra, freedom, rate):
    looks, rng = boundary(look_counts(extra), ERROR, freedom, rate=rate), np.random.default_rng(1)
    scale = np.sqrt(rng.chisquare(freedom, WALKS) / freedom) if freedom < math.inf else 1.0
    share, of_less = crossed(looks.counts.tolist(), looks.z, rng, rate, scale)
    assert share == pytest.approx(ERROR, abs=3e-3 if rate else CLOSE + 5e-4)
    assert of_less > ERROR + CLOSE


def lower_bounds(wanted, campaigns, rng, factors):
    """Lower bounds of campaigns that choose by what was read: largest error 1, noise as it likes.

    For every factor on the noise. A reading that was high is followed by one with little noise, a
    low one by one with much; the direction of each is that of the last reading, where the error is
    always 1 along it.
    """
    found = np.empty((campaigns, len(factors)))
    for campaign in range(campaigns):
        average, sigma, noise = (
            LowerAverage(wanted, ERROR, math.inf, 0.0),
            1.0,
            rng.normal(size=wanted),
        )
        for number in range(wanted):
            along = 1.0 + sigma * noise.item(number)
            average.record(number % 7, along, sigma)
            sigma = 0.3 if along > 1.0 else 2.0
        found[campaign] = [average.bound_mm(np.full(7, factor)) for factor in factors]
    return found


def test_the_lower_bound_is_false_exactly_as_often_as_allowed_whatever_is_chosen():
    bounds, less = lower_bounds(24, 5000, np.random.default_rng(3), (1.0, 0.9)).T
    near = 4.0 * np.sqrt(ERROR * 0.95 / len(bounds))
    assert np.mean(bounds > 1.0) == pytest.approx(ERROR, abs=near)
    assert np.mean(less > 1.0) > ERROR + near


def test_a_look_at_estimated_noise_is_as_wide_as_students_quantile_of_its_share():
    counts = np.array([1, 3, 9])
    looks = boundary(tuple(counts), ERROR, 6.0)
    spent = ERROR * (EARLY + (1.0 - EARLY) * (counts / 9) ** LATE)
    assert scipy.stats.t.sf(looks.alone, 6.0) == pytest.approx(np.diff(spent, prepend=0.0))
