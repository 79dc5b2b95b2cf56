"""Whether readings scatter as the stated noise says: what every bound rests on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kinacc.assess.adaptive import Ledger
from kinacc.assess.noise import ESTIMATED, KNOWN, Contrasts, contrasts, false_scatter, scatter_alarm
from kinacc.campaign.reading import covariance_mm2, unplanned_mm2
from kinacc.campaign.state import State

SUSPICIOUS = 1e-3


@dataclass(frozen=True)
class Scatter:
    """Root of chi-square over its degrees of freedom (1 on average where the noise is as stated),
    the degrees, and the probability of so much scatter or more by chance.

    ``too_large``: the readings contradict the noise stated, the bounds cannot be relied on.
    """

    ratio: float
    freedom: int
    probability: float
    too_large: bool = False

    @property
    def too_small(self) -> bool:
        """Whether the noise is stated larger than it is: the bounds hold, wider than needed."""
        return 1.0 - self.probability < SUSPICIOUS


def scatter(state: State) -> Scatter | None:
    """Scatter of readings within their blocks, with the covariances stated.

    A block is what one decision reads at one point: the first reading of a point, for which it may
    be read again, is none. None without two readings of one block.
    """
    found = _within_blocks(state)
    if not found.freedom:
        return None
    from scipy.special import chdtrc

    square = float(np.sum(found.values**2))
    chance = float(chdtrc(found.freedom, square))
    false = false_scatter(getattr(state.plan.assessor, "references", 0))
    too_large = scatter_alarm(found, margin=state.campaign.factor, false=false) is not None
    return Scatter(math.sqrt(square / found.freedom), found.freedom, chance, too_large)


def deviations(state: State) -> dict[int, float]:
    """Of the readings that ``scatter`` counts, by number: distance from those before in the block.

    In units of what the noise stated brings: the root mean square is 1 where it is as stated.
    """
    found = _within_blocks(state)
    numbers = [each.number for each in (*state.told, *state.in_hand)]
    sizes = np.sqrt(np.mean(found.values**2, axis=1)).tolist()
    return {numbers[at]: size for at, size in zip(found.places.tolist(), sizes, strict=True)}


def _within_blocks(state: State) -> Contrasts:
    """Of readings told by the blocks they were asked for in, of those in hand by point."""
    ledger, blocks = Ledger(state.campaign.ledger.candidates), state.campaign.reading_blocks()
    row_of = {int(point): row for row, point in enumerate(state.rows)}
    in_hand = [each for each in state.in_hand if each.reading.point in row_of]
    for each in (*state.told, *in_hand):
        own = unplanned_mm2(state.plan, each.reading)
        ledger.record(row_of[each.reading.point], each.error_mm, own)
    beyond = max(blocks, default=0) + 1
    every = [*blocks, *(beyond + row_of[each.reading.point] for each in in_hand)]
    found = contrasts(ledger, every)
    guarded = getattr(state.plan.assessor, "wrong_rate", 0.0) > 0.0
    return found.without_wrong_blocks(every) if guarded else found


def nearness(state: State) -> Scatter | None:
    """Size of all readings, with the covariances stated, as scatter about the predictions.

    Errors make readings larger than noise alone would, never smaller: ``too_small`` contradicts
    the noise stated, whatever the errors are. None without a reading.
    """
    readings = [*state.told, *state.in_hand]
    if not readings:
        return None
    from scipy.special import chdtrc

    square, freedom = 0.0, 3 * len(readings)
    for each in readings:
        size = np.linalg.solve(covariance_mm2(state.plan, each.reading), each.error_mm)
        square += float(each.error_mm @ size)
    return Scatter(math.sqrt(square / freedom), freedom, float(chdtrc(freedom, square)))


def too_near(state: State) -> str | None:
    """That readings are nearer to the predictions than their noise lets any be, as a sentence."""
    found = nearness(state)
    if found is None or not found.too_small:
        return None
    return (
        f"readings are {found.ratio:.2f} times as far from the predictions as the noise stated "
        f"alone would take them ({found.freedom} degrees of freedom): nearer than chance allows of "
        "an arm without errors. The noise is stated too large, or these are no readings: the "
        "bounds cannot be relied on"
    )


def remarks(state: State) -> list[str]:
    """What the readings say of the noise stated, a sentence each."""
    near, found = too_near(state), _held_to_stated(state)
    if near is not None:
        # Bounds are wider for noise stated too large where errors outweigh it, and only there.
        return [near]
    return [] if found is None else [in_words(found)]


def contradicted(state: State) -> list[str]:
    """Those of ``remarks`` by which the bounds cannot be relied on."""
    found = _held_to_stated(state)
    contradicts = too_near(state) is not None or (found is not None and found.too_large)
    return remarks(state) if contradicts else []


def _held_to_stated(state: State) -> Scatter | None:
    """The scatter, where the bounds rest on the noise stated and not on an estimate."""
    return None if getattr(state.plan.assessor, "noise", KNOWN) == ESTIMATED else scatter(state)


def in_words(found: Scatter) -> str:
    """The finding as a sentence."""
    said = (
        f"repeated readings scatter {found.ratio:.2f} times as much as the noise stated "
        f"({found.freedom} degrees of freedom)"
    )
    if found.too_large:
        return (
            f"{said}: more than chance allows. The noise is stated too small, or something moved: "
            "the bounds cannot be relied on"
        )
    if found.too_small:
        return f"{said}: the noise is stated too large, the bounds are wider than they need be"
    return f"{said}, as chance allows"
