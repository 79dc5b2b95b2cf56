"""Limits that hold although some readings go wrong.

A reading goes wrong with probability ``rate`` at most, whatever was read before and whatever it
then says: the target slipped, the beam met another target. All others are normal as planned.

A reading counts by its score: its distance from the size tried, along a direction and in standard
deviations, clipped at ``clip``. A wrong reading then counts ``clip`` at most, and the sum of k
scores at the true size is no lower, in distribution, than the sum of k draws that are -``clip``
with probability ``rate`` and a clipped normal deviate otherwise. That law is known, so limits are
calibrated by it exactly, for any number of readings and without counting out suspects (Huber 1965).
Only the first reading of a point cannot be guarded: one that is wrong and small there has the point
left alone. It costs ``rate`` of the confidence, and the statement says so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
import scipy

_CELLS = 256  # of the grid of sums, between no score and the largest
_WIDTHS = 10.0  # standard deviations of a sum that the grid reaches to both sides
_FEWEST, _MOST = 24, 200  # directions to begin the search with, fewer where readings are many:
_PRODUCTS = 4000  # of readings with directions
_KEPT, _NEAR, _ROUNDS = 3, 12, 7  # best directions of a round, new ones about each, rounds


@lru_cache
def clip_of(rate: float) -> float:
    """Score beyond which readings count no more: the one by which a wrong reading harms least."""

    def gain(clip: float) -> float:
        density = math.exp(-0.5 * clip * clip) / math.sqrt(2.0 * math.pi)
        return 2.0 * density / clip - 2.0 * _below(-clip) - rate / (1.0 - rate)

    return float(scipy.optimize.brentq(gain, 1e-3, 12.0))


@lru_cache(maxsize=64)
def guarded_boundary(
    counts: tuple[int, ...], shares: tuple[float, ...], rate: float
) -> tuple[float, ...]:
    """Look j rejects a size where the scores sum to less than -z_j sqrt(k_j); all z, first 1.

    counts: readings at the looks, from 1 upwards. shares: probability that a true size is rejected
    at each look and not before. The first look comes on top of a first reading that is wrong, which
    has probability ``rate`` and is in no share. Infinite where a look can reject nothing.
    """
    walk = _Walk(rate, counts[-1])
    first = -float(scipy.special.ndtri(shares[0] / (1.0 - rate)))
    begun = (1.0 - rate) * walk.clipped_normal(-first)
    return first, *walk.boundary(begun, 1, counts[1:], shares[1:])


@lru_cache(maxsize=64)
def guarded_stages(
    counts: tuple[int, ...], shares: tuple[float, ...], rate: float
) -> tuple[float, ...]:
    """The same for scores of which the first may be wrong like any other: nothing goes by it."""
    walk = _Walk(rate, counts[-1])
    return tuple(walk.boundary(walk.none(), 0, counts, shares))


def guarded_upper_mm(
    readings_mm: np.ndarray, covariances_mm2: np.ndarray, deviations: float, rate: float
) -> float:
    """Largest size of a point's error that its readings do not reject, mm.

    readings_mm: (k, 3); covariances_mm2: (k, 3, 3); deviations: z of this look. A size is rejected
    by the direction in which the error points, so the limit is the largest over all directions. It
    is searched for all around, then ever closer about the best directions found.
    """
    # Compiled code, which no campaign needs that is not guarded.
    from kinacc.assess.guarded_kernels import largest_size

    count = len(readings_mm)
    # A first reading counts in full.
    clip = clip_of(rate) if count > 1 else abs(deviations) + 1.0
    wanted = -deviations * math.sqrt(count)
    if wanted <= -clip * count:
        return math.inf
    number = min(max(_PRODUCTS // count, _FEWEST), _MOST)
    around = np.vstack([readings_mm.mean(axis=0), _around(number)])
    apart = math.sqrt(4.0 * math.pi / number)
    return largest_size(
        readings_mm, covariances_mm2, around, _around(_NEAR), apart, clip, wanted, _ROUNDS, _KEPT
    )


def guarded_lower_mm(
    along_mm: np.ndarray, sigma_mm: np.ndarray, deviations: float, rate: float
) -> float:
    """Smallest largest error that readings along directions chosen beforehand do not reject, mm.

    along_mm: (T,) readings along the directions, of any points; sigma_mm: (T,) their standard
    deviations; deviations: z of T scores. The largest error is at least the error along any
    direction, so scores at it are no larger than those of the noise.
    """
    clip, wanted = clip_of(rate), -deviations * math.sqrt(len(along_mm))
    if wanted <= -clip * len(along_mm):
        return 0.0
    return max(-float(sizes_at(-along_mm[None], sigma_mm[None], clip, wanted)[0]), 0.0)


def at_most_wrong(readings: int, rate: float, error: float) -> int:
    """Smallest number that the wrong ones of so many readings exceed but for ``error``."""
    numbers = np.arange(readings + 1)
    return int(np.argmax(scipy.special.bdtrc(numbers, readings, rate) <= error))


def sizes_at(along: np.ndarray, sigma: np.ndarray, clip: float, wanted: float) -> np.ndarray:
    """Largest sizes (q,) at which the scores of every row sum to ``wanted`` or more.

    along, sigma: (q, k). The sum falls by straight pieces as the size grows.
    """
    rows, count = along.shape
    bends = np.concatenate([along - clip * sigma, along + clip * sigma], axis=1)
    turns = np.concatenate([-1.0 / sigma, 1.0 / sigma], axis=1)
    order = np.argsort(bends, axis=1)
    bends = np.take_along_axis(bends, order, axis=1)
    slopes = np.cumsum(np.take_along_axis(turns, order, axis=1), axis=1)
    sums = np.full((rows, 2 * count), clip * count)
    sums[:, 1:] += np.cumsum(slopes[:, :-1] * np.diff(bends, axis=1), axis=1)
    last = np.sum(sums >= wanted, axis=1) - 1
    row = np.arange(rows)
    slope = slopes[row, last]
    flat = slope > -1e-12 * np.abs(slopes).max()
    step = (wanted - sums[row, last]) / np.where(flat, -1.0, slope)
    return bends[row, last] + np.where(flat, 0.0, step)


def _below(deviate: float) -> float:
    return float(scipy.special.ndtr(deviate))


@lru_cache
def _around(number: int) -> np.ndarray:
    """Directions (number, 3) evenly all around: a spiral from pole to pole."""
    at = np.arange(number) + 0.5
    height, turn = 1.0 - 2.0 * at / number, math.pi * (1.0 + math.sqrt(5.0)) * at
    radius = np.sqrt(1.0 - height**2)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])


class _Walk:
    """Sums of scores of which each is -clip with probability ``rate``, on a grid.

    Probability between two grid points is shared between them so that the mean stays: the sums
    spread a little more than they do, never less.
    """

    def __init__(self, rate: float, most: int) -> None:
        self.clip = clip_of(rate)
        self.step = self.clip / _CELLS
        reach = _WIDTHS * math.sqrt(most) + 2.0 * self.clip + 3.0 * rate * self.clip * most
        self._half = math.ceil(min(reach, self.clip * (most + 1)) / self.step)
        self.sums = self.step * np.arange(-self._half, self._half + 1)
        score = (1.0 - rate) * self.clipped_normal(-math.inf)
        score[self._half - _CELLS] += rate
        # Sums that leave the grid on one side come in on the other: twice its length keeps off
        # those of one step, and more are improbable beyond what matters.
        self._length = scipy.fft.next_fast_len(2 * len(score))
        self._transform = np.fft.rfft(np.roll(self._padded(score), -self._half))

    def none(self) -> np.ndarray:
        """The sum of no score."""
        mass = np.zeros(2 * self._half + 1)
        mass[self._half] = 1.0
        return mass

    def clipped_normal(self, above: float) -> np.ndarray:
        """Probability of the clipped value of a normal deviate that is above ``above``."""
        clip, mass = self.clip, np.zeros(2 * self._half + 1)
        edges = np.clip(self.step * np.arange(-_CELLS, _CELLS + 1), max(above, -clip), clip)
        below = scipy.special.ndtr(edges)
        density = np.exp(-0.5 * edges**2) / math.sqrt(2.0 * math.pi)
        between, moment = np.diff(below), -np.diff(density)
        left = self.step * np.arange(-_CELLS, _CELLS)
        right_share = np.clip((moment - left * between) / self.step, 0.0, between)
        inner = slice(self._half - _CELLS, self._half + _CELLS)
        mass[inner] += between - right_share
        mass[inner.start + 1 : inner.stop + 1] += right_share
        mass[inner.start] += max(_below(-clip) - _below(above), 0.0)
        mass[inner.stop] += _below(-max(clip, above))
        return mass

    def boundary(
        self, mass: np.ndarray, before: int, counts: Sequence[int], shares: Sequence[float]
    ) -> Iterator[float]:
        """All z of looks that follow the sums of ``before`` scores."""
        for count, share in zip(counts, shares, strict=True):
            mass, before = self.after(mass, count - before), count
            cell = int(np.argmax(np.cumsum(mass) > share))
            mass[:cell] = 0.0
            reached = -(self.sums[cell] - 0.5 * self.step)
            # No sum is below -clip times the readings: what is asked for there is never met.
            yield reached / math.sqrt(count) if reached < self.clip * count else math.inf

    def after(self, mass: np.ndarray, scores: int) -> np.ndarray:
        """Probability of the sums after so many more scores."""
        moved = np.fft.rfft(self._padded(mass)) * self._transform**scores
        return np.maximum(np.fft.irfft(moved, self._length)[: len(mass)], 0.0)

    def _padded(self, mass: np.ndarray) -> np.ndarray:
        return np.concatenate([mass, np.zeros(self._length - len(mass))])
