"""Readings of the same block, points left out, and scores of wrong readings: by other means."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from kinacc.assess.adaptive import Candidates, Ledger
from kinacc.assess.noise_factor import contrasts

SIGMA = 0.1


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
