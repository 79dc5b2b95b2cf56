"""Limits that hold although some readings go wrong.

A reading goes wrong with probability ``rate`` at most, whatever was read before and whatever it
then says: the target slipped, the beam met another target. All others are normal as planned.

A reading counts by its score: its distance from the size tried, along a direction and in standard
deviations, clipped at ``clip`` (Huber 1965). A wrong reading then counts ``clip`` at most, and the
sum of k scores at the true size is no lower, in distribution, than the sum of k draws that are
-``clip`` with probability ``rate`` and a clipped normal deviate otherwise. That law is known, and
:func:`kinacc.assess.looks.boundary` is calibrated by it. Only the first reading of a point cannot
be guarded: one that is wrong and small there has the point left alone. It costs ``rate`` of the
confidence, and the statement says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import scipy

from kinacc.assess.adaptive import Ledger
from kinacc.assess.statement import Suspicious

_PRODUCTS, _FEWEST, _MOST = 4000, 24, 200  # of readings with directions; directions tried first
_KEPT, _NEAR, _ROUNDS = 3, 12, 7  # best directions of a round, new ones about each, rounds


@lru_cache
def clip_of(rate: float) -> float:
    """Score beyond which readings count no more: the one by which a wrong reading harms least."""

    def gain(clip: float) -> float:
        density = math.exp(-0.5 * clip * clip) / math.sqrt(2.0 * math.pi)
        return 2.0 * density / clip - 2.0 * float(scipy.special.ndtr(-clip)) - rate / (1.0 - rate)

    return float(scipy.optimize.brentq(gain, 1e-3, 12.0))


def guarded_upper_mm(
    readings_mm: np.ndarray, covariances_mm2: np.ndarray, deviations: float, rate: float
) -> float:
    """Largest size of a point's error that its readings do not reject, mm.

    readings_mm: (k, 3); covariances_mm2: (k, 3, 3); deviations: z of this look. A size is rejected
    by the direction in which the error points, so the limit is the largest over all directions. It
    is searched for all around, then ever closer about the best directions found.
    """
    count, clip = len(readings_mm), clip_of(rate)
    wanted = -deviations * math.sqrt(count)
    if wanted <= -clip * count:
        return math.inf
    number = min(max(_PRODUCTS // count, _FEWEST), _MOST)
    tried = np.vstack([readings_mm.mean(axis=0), _around(number)])
    apart, largest = math.sqrt(4.0 * math.pi / number), 0.0
    for _ in range(_ROUNDS):
        tried = tried / np.linalg.norm(tried, axis=1)[:, None]
        sigma = np.sqrt(np.einsum("qi,kij,qj->qk", tried, covariances_mm2, tried))
        sizes = sizes_at(tried @ readings_mm.T, sigma, clip, wanted)
        largest = max(largest, float(sizes.max()))
        best = tried[np.argsort(-sizes)[:_KEPT]]
        tried = np.vstack([best, (best[:, None] + apart * _around(_NEAR)).reshape(-1, 3)])
        apart *= 0.5
    return largest


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


@lru_cache
def _around(number: int) -> np.ndarray:
    """Directions (number, 3) evenly all around: a spiral from pole to pole."""
    rank = np.arange(number) + 0.5
    height, turn = 1.0 - 2.0 * rank / number, math.pi * (1.0 + math.sqrt(5.0)) * rank
    radius = np.sqrt(1.0 - height**2)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])


FALSE_ALARM = 0.002  # chance that a campaign without a wrong reading has a suspicious one
_LATER = 2  # readings after the first that it is held to, fixed as their number must be


def suspicious_readings(
    ledger: Ledger,
    blocks: Sequence[int],
    counts: Sequence[int],
    planned: int,
    factor: float = 1.0,
    freedom: float = math.inf,
    false_alarm: float = FALSE_ALARM,
) -> tuple[Suspicious, ...]:
    """All suspicious readings of the points read again, by number.

    blocks: of all readings of the ledger, below 0 where planned. counts: at which a point is looked
    at; all readings between two looks are taken as one block: what interrupts them goes by looks.
    planned: readings beyond the visit. factor: by which standard deviations are larger than stated,
    from ``freedom`` degrees. With probability ``false_alarm`` at most there is one where every
    reading is as the noise says.
    """
    in_block = factor * _limit(0.5 * false_alarm / max(planned, 1), freedom)
    of_first = factor * _limit(0.5 * false_alarm / ledger.candidates.points, freedom)
    suspicious = []
    for row in np.flatnonzero(ledger.count > 1).tolist():
        places = [place for place, reading in enumerate(ledger.readings) if reading[0] == row]
        values, spreads = ledger.readings_of(row, len(places))

        def distance(index: int, others: np.ndarray, values=values, spreads=spreads) -> float:
            """Distance from the mean of others, in standard deviations of the difference."""
            apart = values[index] - values[others].mean(axis=0)
            spread = spreads[index] + spreads[others].sum(axis=0) / len(others) ** 2
            return math.sqrt(float(apart @ np.linalg.solve(spread, apart)))

        looks = np.searchsorted(counts, np.arange(len(places)), side="right")
        block = np.where([blocks[reading] < 0 for reading in places], -np.array(places) - 1, looks)
        named: dict[int, float] = {}
        for number in np.unique(block):
            members = np.flatnonzero(block == number)
            if len(members) < 2:
                continue
            apart = [distance(index, members[members != index]) for index in members]
            if (far := max(apart)) > in_block:
                # Of two, neither tells which it is: the one farther from the other readings.
                others = np.flatnonzero(block != number)
                if len(members) == 2 and len(others):
                    apart = [distance(index, others) for index in members]
                named[int(members[np.argmax(apart)])] = far
        if len(places) > _LATER and not any(index <= _LATER for index in named):
            first = distance(0, np.arange(1, _LATER + 1))
            if first > of_first:
                named[0] = first
        suspicious += [
            Suspicious(places[index] + 1, row, far / factor) for index, far in named.items()
        ]
    return tuple(sorted(suspicious))


def _limit(error: float, freedom: float) -> float:
    """Distance in standard deviations that noise in three directions exceeds so rarely."""
    if math.isinf(freedom):
        return math.sqrt(float(scipy.special.chdtri(3, error)))
    # The quantile of F by that of the beta variable it goes with: scipy.stats is slow to load.
    below = float(scipy.special.betaincinv(0.5 * freedom, 1.5, error))
    return math.sqrt(freedom * (1.0 - below) / below)
