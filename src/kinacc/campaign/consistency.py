"""Scatter of readings compared with the stated noise, on which every bound rests."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from kinacc.assess.adaptive import Ledger
from kinacc.assess.noise import Contrasts, contrasts, false_scatter, scatter_alarm
from kinacc.campaign.reading import covariance_mm2, unplanned_mm2
from kinacc.campaign.state import State

SUSPICIOUS = 1e-3


@dataclass(frozen=True)
class Scatter:
    """Root of chi-square over its degrees of freedom (1 on average where the noise is as stated).

    ``probability`` of so much scatter or more by chance. ``too_large``: the readings contradict
    the stated noise; bounds cannot be relied on.
    """

    ratio: float
    freedom: int
    probability: float
    too_large: bool = False

    @property
    def too_small(self) -> bool:
        """Whether the noise is overstated: bounds hold, wider than needed."""
        return 1.0 - self.probability < SUSPICIOUS


def scatter(state: State) -> Scatter | None:
    """Return the scatter of readings within their blocks; None without two readings of one block.

    A block is what one decision reads at one point. The first reading of a point, which decides
    whether it is read again, belongs to none.
    """
    values = _within_blocks(state)
    if not values.freedom:
        return None
    alarm = scatter_alarm(
        values,
        margin=state.campaign.factor,
        false=false_scatter(getattr(state.plan.assessor, "references", 0)),
    )
    return _scatter(float(np.sum(values.values**2)), values.freedom, alarm is not None)


def nearness(state: State) -> Scatter | None:
    """Return the size of all readings as scatter about the predictions; None without a reading.

    Errors make readings larger than noise alone would, never smaller: ``too_small`` contradicts
    the stated noise, whatever the errors are.
    """
    square, readings = 0.0, [*state.told, *state.in_hand]
    for each in readings:
        covariance = covariance_mm2(state.plan, each.reading)
        square += float(each.error_mm @ np.linalg.solve(covariance, each.error_mm))
    return _scatter(square, 3 * len(readings)) if readings else None


def deviations(state: State) -> dict[int, float]:
    """Return the distance of each reading that ``scatter`` counts from those before in its block.

    By number of the reading, in standard deviations: the root mean square is 1 where the noise is
    as stated.
    """
    values = _within_blocks(state)
    numbers = [each.number for each in (*state.told, *state.in_hand)]
    sizes = np.sqrt(np.mean(values.values**2, axis=1)).tolist()
    return {numbers[place]: size for place, size in zip(values.places, sizes, strict=True)}


def _scatter(square: float, freedom: int, too_large: bool = False) -> Scatter:
    return Scatter(math.sqrt(square / freedom), freedom, float(chdtrc(freedom, square)), too_large)


def _within_blocks(state: State) -> Contrasts:
    """Readings used by the blocks in which they were requested, those in hand by point."""
    ledger, blocks = Ledger(state.campaign.ledger.candidates), state.campaign.reading_blocks()
    row_of = {int(point): row for row, point in enumerate(state.rows)}
    in_hand = [each for each in state.in_hand if each.reading.point in row_of]
    for each in (*state.told, *in_hand):
        covariance = unplanned_mm2(state.plan, each.reading)
        ledger.record(row_of[each.reading.point], each.error_mm, covariance)
    beyond = max(blocks, default=0) + 1
    every = [*blocks, *(beyond + row_of[each.reading.point] for each in in_hand)]
    values = contrasts(ledger, every)
    guarded = getattr(state.plan.assessor, "wrong_rate", 0.0) > 0.0
    return values.without_wrong_blocks(every) if guarded else values
