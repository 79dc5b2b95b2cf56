"""Readings that noise as stated does not explain, each named.

A block is what one decision reads at one point. What was read before decides on it, and nothing
read within it does. So the distance of a reading from the mean of the others of its block is that
of fresh noise, and no more readings are in blocks than are planned beyond the visit: the chance of
a false alarm is shared among so many. A first reading is held to the mean of the two that follow.
Its point was often chosen for it, so its chance is shared among all candidates, chosen or not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy

from kinacc.assess.adaptive import Ledger
from kinacc.assess.statement import Suspicious

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
    found = []
    for row in np.flatnonzero(ledger.count > 1).tolist():
        places = [place for place, each in enumerate(ledger.readings) if each[0] == row]
        values, spreads = ledger.readings_of(row, len(places))

        def distance(at: int, others: np.ndarray, values=values, spreads=spreads) -> float:
            """Distance from the mean of others, in standard deviations of the difference."""
            apart = values[at] - values[others].mean(axis=0)
            spread = spreads[at] + spreads[others].sum(axis=0) / len(others) ** 2
            return math.sqrt(float(apart @ np.linalg.solve(spread, apart)))

        looks = np.searchsorted(counts, np.arange(len(places)), side="right")
        block = np.where([blocks[each] < 0 for each in places], -np.array(places) - 1, looks)
        named: dict[int, float] = {}
        for number in np.unique(block):
            own = np.flatnonzero(block == number)
            if len(own) < 2:
                continue
            apart = [distance(at, own[own != at]) for at in own]
            if (far := max(apart)) > in_block:
                # Of two, neither tells which it is: the one farther from the other readings.
                others = np.flatnonzero(block != number)
                if len(own) == 2 and len(others):
                    apart = [distance(at, others) for at in own]
                named[int(own[np.argmax(apart)])] = far
        if len(places) > _LATER and not any(at <= _LATER for at in named):
            first = distance(0, np.arange(1, _LATER + 1))
            if first > of_first:
                named[0] = first
        found += [Suspicious(places[at] + 1, row, far / factor) for at, far in named.items()]
    return tuple(sorted(found))


def _limit(error: float, freedom: float) -> float:
    """Distance in standard deviations that noise in three directions exceeds so rarely."""
    if math.isinf(freedom):
        return math.sqrt(float(scipy.special.chdtri(3, error)))
    # The quantile of F by that of the beta variable it goes with: scipy.stats is slow to load.
    below = float(scipy.special.betaincinv(0.5 * freedom, 1.5, error))
    return math.sqrt(freedom * (1.0 - below) / below)
