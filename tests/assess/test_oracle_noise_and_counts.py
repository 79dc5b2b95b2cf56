"""Readings of the same block, points left out, and scores of wrong readings: by other means."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from kinacc.assess.adaptive import Candidates, Ledger
from kinacc.assess.boundary import look_counts
from kinacc.assess.coverage import excepted
from kinacc.assess.noise_factor import contrasts
from kinacc.assess.wrong_readings import clip_of, guarded_boundary, guarded_stages

SIGMA = 0.1


@pytest.mark.parametrize(("points", "seen"), [(9, 4), (10, 8), (11, 5), (12, 11)])
@pytest.mark.parametrize("error", [0.025, 0.2])
def test_all_but_so_many_points_is_right_over_all_subsets_that_can_be_read(points, seen, error):
    def missed(largest):
        """Share of all subsets that hold none of the largest points."""
        subsets = [set(each) for each in combinations(range(points), seen)]
        return np.mean([not each & set(range(largest)) for each in subsets])

    left = excepted(points, seen, error)
    assert missed(left + 1) <= error
    assert left == 0 or missed(left) > error


def read_in_blocks(blocks, rng, means=None):
    """A ledger of blocks of three readings; a point gets further blocks while its means are low."""
    ledger, numbers = Ledger(Candidates.with_equal_noise(np.full(blocks, SIGMA))), []
    for point in range(blocks):
        for block in range(4):
            low = block == 0 or ledger.mean_mm[point, 0] < 1.0
            for reading in [1.0, 2.0, 3.0] + SIGMA * rng.normal(size=(3, 3)) if low else []:
                ledger.record(point, reading)
                numbers.append(4 * point + block)
    return ledger, np.array(numbers)


def test_differences_within_blocks_tell_of_the_noise_alone_whatever_means_decided():
    ledger, numbers = read_in_blocks(1500, np.random.default_rng(1))
    found = contrasts(ledger, numbers.tolist())
    readings = np.array([each[1] for each in ledger.readings])
    each = np.unique(numbers)
    squares, means = np.empty(len(each)), np.empty((len(each), 3))
    for place, number in enumerate(each):
        of_block = readings[numbers == number]
        means[place] = of_block.mean(axis=0)
        squares[place] = np.sum((of_block - means[place]) ** 2) / SIGMA**2
    assert found.freedom == 6 * len(each)
    assert np.sum(found.values**2) == pytest.approx(squares.sum(), rel=1e-9)
    own = np.sum(found.values.reshape(len(each), -1) ** 2, axis=1)
    assert own == pytest.approx(squares, rel=1e-6)
    assert kstest(squares, chi2(6).cdf).pvalue > 1e-3
    high = means[:, 0] > np.median(means[:, 0])
    assert kstest(squares[high], chi2(6).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(squares, means[:, 0])[0, 1]) < 4.0 / np.sqrt(len(each))


def lowest_sums(rule, rate, campaigns, counts, rng):
    """Sums of scores at the looks, every wrong one as low as can be; and who counts.

    Of a point's own readings the first is not clipped, and one that is wrong is paid for by itself.
    """
    clip, total = clip_of(rate), counts[-1]
    drawn = rng.normal(size=(campaigns, total))
    wrong = rng.random((campaigns, total)) < rate
    worst = np.where(wrong, -clip, np.clip(drawn, -clip, clip))
    sums = np.cumsum(worst, axis=1)[:, np.array(counts) - 1]
    if rule is guarded_stages:
        return sums, np.ones(campaigns, dtype=bool)
    sums[:, 0] = drawn[:, 0]
    return sums, ~wrong[:, 0]


@pytest.mark.parametrize("rate", [0.01, 0.05])
@pytest.mark.parametrize("rule", [guarded_boundary, guarded_stages])
def test_the_worst_of_wrong_readings_breaks_guarded_limits_as_rarely_as_is_said(rule, rate):
    counts, campaigns, error = look_counts(40), 100_000, 0.05
    shares = error * np.diff(np.array(counts) / counts[-1], prepend=0.0)
    z = np.array(rule(counts, tuple(shares.tolist()), rate))
    sums, counted = lowest_sums(rule, rate, campaigns, counts, np.random.default_rng(1))

    def broken(z):
        return np.mean(np.any(sums < -z * np.sqrt(counts), axis=1) & counted)

    near = 4.0 * np.sqrt(error * (1.0 - error) / campaigns)
    assert broken(z) <= error + near
    assert broken(0.95 * z) > error + near
