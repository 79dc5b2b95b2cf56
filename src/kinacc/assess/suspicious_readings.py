"""Readings that noise as stated does not explain, each named.

A block is what one decision reads at one point. What was read before decides on it, and nothing
read within it does. So the distance of a reading from the mean of the others of its block is that
of fresh noise, and no more readings are in blocks than are planned beyond the visit: the chance of
a false alarm is shared among so many. A first reading is held to the mean of the two that follow.
Its point was often chosen for it, so its chance is shared among all candidates, chosen or not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from kinacc.assess.adaptive import Ledger
from kinacc.assess.statement import Suspicious

FALSE_ALARM = 0.002  # chance that a campaign without a wrong reading has a suspicious one
_LATER = 2  # readings after the first that it is held to, fixed as their number must be


class PointReadings(NamedTuple):
    """Readings of one point in the order taken.

    Their numbers in the campaign (k,), from 1; their blocks (k,), numbers equal within one; values
    (k, 3), mm; covariances (k, 3, 3), mm^2.
    """

    numbers: np.ndarray
    blocks: np.ndarray
    readings_mm: np.ndarray
    covariances_mm2: np.ndarray


class Noise(NamedTuple):
    """Factor by which standard deviations are larger than stated, from so many degrees."""

    factor: float = 1.0
    freedom: float = math.inf


def readings_by_row(
    ledger: Ledger, blocks: Sequence[int], counts: Sequence[int]
) -> dict[int, PointReadings]:
    """The readings of every row that was read again.

    blocks: of all readings of the ledger, below 0 where planned. counts: at which a point is looked
    at. All readings between two looks are taken as one block: what interrupts them goes by looks.
    """
    again: dict[int, list[int]] = {}
    for place, (row, _, _) in enumerate(ledger.readings):
        if ledger.count[row] > 1:
            again.setdefault(row, []).append(place)
    planned = ledger.candidates.covariance_mm2
    found = {}
    for row, places in again.items():
        told = [ledger.readings[place] for place in places]
        spread = [planned[row] if own is None else own for _, _, own in told]
        looks = np.searchsorted(counts, np.arange(len(places)), side="right")
        found[row] = PointReadings(
            np.array(places) + 1,
            np.where([blocks[place] < 0 for place in places], -np.array(places) - 1, looks),
            np.array([value for _, value, _ in told]),
            np.array(spread, dtype=float),
        )
    return found


def suspicious_readings(
    readings: Mapping[int, PointReadings],
    planned: int,
    points: int,
    noise: Noise,
    false_alarm: float = FALSE_ALARM,
) -> tuple[Suspicious, ...]:
    """All suspicious readings of the points read again, by number.

    readings: by row. planned: readings beyond the visit; points: candidates. With probability
    ``false_alarm`` at most there is one where every reading is as the noise says.
    """
    in_block = _limit(0.5 * false_alarm / max(planned, 1), noise)
    of_first = _limit(0.5 * false_alarm / points, noise)
    found = []
    for row, each in readings.items():
        told = _apart_in_blocks(each, in_block)
        if len(each.numbers) > _LATER and not any(place <= _LATER for place, _ in told):
            later = np.arange(1, _LATER + 1)
            first = float(_from_others(each, np.array([0]), later)[0])
            if first > of_first:
                told.append((0, first))
        found += [Suspicious(int(each.numbers[at]), row, far / noise.factor) for at, far in told]
    return tuple(sorted(found))


def _apart_in_blocks(each: PointReadings, limit: float) -> list[tuple[int, float]]:
    """Place and distance of the reading of every block that stands apart, if one does.

    Of two readings neither tells which it is: it is the one farther from the other readings.
    """
    _, of_block, lengths = np.unique(each.blocks, return_inverse=True, return_counts=True)
    total, spread = np.zeros((len(lengths), 3)), np.zeros((len(lengths), 3, 3))
    np.add.at(total, of_block, each.readings_mm)
    np.add.at(spread, of_block, each.covariances_mm2)
    values, own, others = each.readings_mm, each.covariances_mm2, lengths[of_block] - 1
    far = _distances(
        values, own, total[of_block] - values, spread[of_block] - own, np.maximum(others, 1)
    )
    found = []
    for number in np.unique(of_block[(far > limit) & (others > 0)]):
        block = np.flatnonzero(of_block == number)
        apart = far[block]
        if len(block) == 2:
            apart = _from_others(each, block, np.delete(np.arange(len(of_block)), block))
        found.append((int(block[np.argmax(apart)]), float(far[block].max())))
    return found


def _from_others(each: PointReadings, some: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Distances of readings ``some`` from the mean of ``others``, of which none is one of them."""
    values, spread = each.readings_mm, each.covariances_mm2
    total, all_spread = values[others].sum(axis=0), spread[others].sum(axis=0)
    return _distances(values[some], spread[some], total, all_spread, np.full(1, len(others)))


def _distances(values, spread, total, total_spread, number) -> np.ndarray:
    """Distances (k,) of readings from the mean of ``number`` others, their sums being ``total``.

    In standard deviations of the difference.
    """
    apart = values - total / number[:, None]
    covariance = spread + total_spread / number[:, None, None] ** 2
    return np.sqrt(np.sum(apart * np.linalg.solve(covariance, apart[..., None])[..., 0], axis=1))


def _limit(error: float, noise: Noise) -> float:
    """Distance in standard deviations stated that noise in three directions exceeds so rarely."""
    if math.isinf(noise.freedom):
        return noise.factor * math.sqrt(float(scipy.special.chdtri(3, error)))
    # The quantile of F by that of the beta variable it goes with: scipy.stats is slow to load.
    below = float(scipy.special.betaincinv(0.5 * noise.freedom, 1.5, error))
    return noise.factor * math.sqrt(noise.freedom * (1.0 - below) / below)
