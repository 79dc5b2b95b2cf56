"""How large the noise is: one factor on the covariances stated, from readings of the same block.

A block is what one decision reads at one point. How they differ
tells of the noise alone, whatever the errors are, and nothing of the block's mean. So a factor
estimated from a number of differences that was fixed beforehand is independent of all means, and
of every decision that was taken on means.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.assess.adaptive import Candidates, Ledger

ENOUGH = 60  # degrees of freedom that are asked for: 20 triples
FEWEST = 30  # degrees of freedom below which no factor is estimated
MOST = 120  # degrees of freedom beyond which a factor is as good as known
CHECKED = 120  # degrees of freedom that check a noise stated as known
SINGLES = 9  # blocks of a single reading: about the three stages of the lower bound, and its end


@dataclass(frozen=True)
class Contrasts:
    """Differences within blocks, in the order taken: standard normal where the noise is as stated.

    rows: (n,) candidate of each; places: (n,) of its reading in the ledger, from 0; values: (n, 3),
    each the difference of a reading from the mean of those before it in its block, in units of its
    own standard deviations.
    """

    rows: np.ndarray
    places: np.ndarray
    values: np.ndarray

    @property
    def freedom(self) -> int:
        """Degrees of freedom: three for each difference."""
        return 3 * len(self.rows)


@dataclass(frozen=True)
class NoiseFactor:
    """Standard deviations over those stated, and the degrees of freedom that tell it.

    ``freedom`` infinite: known. ``own`` (m,): factors of candidates that were read so often that
    they have one of their own, the larger of it and ``value``; elsewhere ``value``.
    """

    value: float
    freedom: float
    own: np.ndarray

    def at_most(self, error: float) -> float:
        """Factor that the true one exceeds with probability ``error``."""
        return self._limit(1.0 - error)

    def at_least(self, error: float) -> float:
        """Factor that the true one falls below with probability ``error``."""
        return self._limit(error)

    def _limit(self, above: float) -> float:
        if math.isinf(self.freedom):
            return self.value
        from scipy.special import chdtri

        # The probability of more than chdtri's value is its second argument.
        return self.value * math.sqrt(self.freedom / float(chdtri(self.freedom, above)))


def planned_freedom(spare: int) -> int:
    """Degrees of freedom that ``spare`` readings beyond the visit bring, whatever is decided.

    A block has two readings or more, but for a few; so half of all others tell of the noise.
    """
    return 3 * max((spare - SINGLES + 1) // 2, 0)


def estimating_freedom(spare: int) -> int:
    """Degrees of freedom that a factor is estimated from, fixed before anything is read; 0: none.

    All that is sure to come, so that bounds are sure to come; no more than helps.
    """
    within = planned_freedom(spare)
    return min(within, MOST) if within >= FEWEST else 0


def contrasts(ledger: Ledger, blocks: Sequence[int]) -> Contrasts:
    """Differences within blocks of all readings of a ledger, in the order taken.

    blocks: of each reading the number of its block; readings of a block are of one point.
    """
    if not ledger.readings:
        none = np.zeros(0, dtype=np.int64)
        return Contrasts(none, none, np.zeros((0, 3)))
    rows, given, own = zip(*ledger.readings, strict=True)
    rows = np.array(rows)
    block = np.asarray(blocks)
    order = np.argsort(block, kind="stable")
    ordered = block[order]
    begins = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
    lengths = np.diff([*begins, len(order)])
    behind = np.arange(len(order)) - np.repeat(begins, lengths)
    values = np.empty((len(order), 3))
    values[order] = _of_planned(ledger.candidates, rows[order], np.array(given)[order], behind)
    unlike = np.array([each is not None for each in own])[order]
    for at in np.flatnonzero(np.logical_or.reduceat(unlike, begins)):
        of_block = order[begins[at] : begins[at] + lengths[at]]
        values[of_block] = _of_unlike(ledger, of_block)
    inside = np.empty(len(order), dtype=bool)
    inside[order] = behind > 0
    return Contrasts(rows[inside], np.flatnonzero(inside), values[inside])


def _of_planned(candidates, rows, readings_mm, behind) -> np.ndarray:
    """Differences (n, 3) from the mean of the ``behind`` readings before each, all as planned.

    Of the first of a block, which has none before it: 0.
    """
    total = np.cumsum(readings_mm, axis=0)
    at = np.arange(len(rows)) - behind
    before = total - readings_mm - (total[at] - readings_mm[at])
    count = np.maximum(behind, 1)[:, None]
    apart = (readings_mm - before / count) * np.sqrt(count / (count + 1.0))
    inside, found = behind > 0, np.zeros_like(apart)
    again, place = np.unique(rows[inside], return_inverse=True)
    inverse = np.linalg.inv(np.linalg.cholesky(candidates.covariance_mm2[again]))
    found[inside] = np.einsum("nij,nj->ni", inverse[place], apart[inside])
    return found


def _of_unlike(ledger: Ledger, of_block: np.ndarray) -> np.ndarray:
    """Differences (b, 3) in one block whose readings have covariances of their own."""
    values, weight, mean = np.zeros((len(of_block), 3)), np.zeros((3, 3)), np.zeros(3)
    for place, at in enumerate(of_block):
        row, reading, covariance = ledger.readings[at]
        own = ledger.candidates.covariance_mm2[row] if covariance is None else covariance
        apart = np.array(reading) - mean
        if place:
            spread = own + np.linalg.inv(weight)
            values[place] = np.linalg.solve(np.linalg.cholesky(spread), apart)
        added = np.linalg.inv(own)
        weight = weight + added
        mean = mean + np.linalg.solve(weight, added @ apart)
    return values


def known_factor(points: int, value: float = 1.0) -> NoiseFactor:
    """A factor that is stated."""
    return NoiseFactor(value, math.inf, np.full(points, value))


def estimated_factor(found: Contrasts, estimating: int, points: int, freedom: float) -> NoiseFactor:
    """The factor that the first ``estimating`` contrasts tell, or, with none, a test before: 1.

    A point with 30 degrees of freedom of its own keeps the larger of its own factor and this one.
    """
    first = found.values.reshape(-1)[:estimating]
    value = math.sqrt(float(np.mean(first**2))) if estimating else 1.0
    count = 3 * np.bincount(found.rows, minlength=points)
    square = np.bincount(found.rows, np.sum(found.values**2, axis=1), minlength=points)
    own = np.sqrt(square / np.maximum(count, 1))
    return NoiseFactor(value, freedom, np.where(count >= FEWEST, np.maximum(own, value), value))


def largest_factor(
    candidates: Candidates, rows: np.ndarray, readings_mm: np.ndarray, error: float
) -> float:
    """Factor that the true one exceeds with probability at most ``error``, whatever the errors are.

    From one reading (n, 3) each of different candidates (n,). Errors take readings farther away
    than noise alone, never nearer: the median of their squared sizes, in the units of the noise, is
    at least that of as many central chi-squares with three degrees of freedom, times the factor
    squared. The median says more than the sum where a few errors are large.
    """
    from scipy.special import betaincinv, chdtri

    roots = np.linalg.cholesky(candidates.covariance_mm2[rows])
    square = np.sum(np.linalg.solve(roots, readings_mm[..., None])[..., 0] ** 2, axis=1)
    read = len(square)
    rank = (read + 1) // 2
    # The share of a chi-square below its order statistic is a beta variable.
    below = float(betaincinv(rank, read - rank + 1, error))
    return math.sqrt(float(np.sort(square)[rank - 1]) / float(chdtri(3, 1.0 - below)))
