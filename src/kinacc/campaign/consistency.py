"""Whether readings scatter as the stated noise says: what every bound rests on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinacc.campaign.reading import covariance_mm2
from kinacc.campaign.state import State, Told

SUSPICIOUS = 1e-3


@dataclass(frozen=True)
class Scatter:
    """Root of chi-square over its degrees of freedom (1 on average where the noise is as stated),
    the degrees, and the probability of so much scatter or more by chance."""

    ratio: float
    freedom: int
    probability: float

    @property
    def too_large(self) -> bool:
        """Whether the readings contradict the noise stated: the bounds cannot be relied on."""
        return self.probability < SUSPICIOUS

    @property
    def too_small(self) -> bool:
        """Whether the noise is stated larger than it is: the bounds hold, wider than needed."""
        return 1.0 - self.probability < SUSPICIOUS


def scatter(state: State) -> Scatter | None:
    """Scatter of repeated readings about their means by point, with the covariances stated.

    The first reading of a point is left out, because a point is read again for being large there.
    None without a point that was read at least three times.
    """
    square, freedom = 0.0, 0
    for later in _repeated(state):
        square += _square(state, later)
        freedom += 3 * (len(later) - 1)
    if not freedom:
        return None
    from scipy.special import chdtrc

    return Scatter(math.sqrt(square / freedom), freedom, float(chdtrc(freedom, square)))


def deviations(state: State) -> dict[int, float]:
    """Of the readings that ``scatter`` counts, by number: distance from the mean of their point.

    In units of what the noise stated brings: the root mean square is 1 where it is as stated.
    """
    found = {}
    for later in _repeated(state):
        weights, mean = _mean(state, later)
        of_mean = np.linalg.inv(sum(weights))
        for each, weight in zip(later, weights, strict=True):
            apart = each.error_mm - mean
            own = np.linalg.inv(weight) - of_mean
            found[each.number] = math.sqrt(float(apart @ np.linalg.solve(own, apart)) / 3.0)
    return found


def _repeated(state: State) -> Iterator[list[Told]]:
    """Readings of every point that was read at least three times, without its first."""
    groups: dict[int, list[Told]] = {}
    for each in (*state.told, *state.in_hand):
        groups.setdefault(each.reading.point, []).append(each)
    for group in groups.values():
        if len(group) >= 3:
            yield sorted(group, key=lambda each: each.number)[1:]


def _mean(state: State, readings: list[Told]) -> tuple[list[np.ndarray], np.ndarray]:
    """Weights (3, 3) of readings of one point, and their weighted mean (3,)."""
    weights = [np.linalg.inv(covariance_mm2(state.plan, each.reading)) for each in readings]
    sums = sum(w @ each.error_mm for w, each in zip(weights, readings, strict=True))
    return weights, np.linalg.solve(sum(weights), sums)


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
    near, found = too_near(state), scatter(state)
    if near is not None:
        # Bounds are wider for noise stated too large where errors outweigh it, and only there.
        return [near]
    return [] if found is None else [in_words(found)]


def contradicted(state: State) -> list[str]:
    """Those of ``remarks`` by which the bounds cannot be relied on."""
    found = scatter(state)
    contradicts = too_near(state) is not None or (found is not None and found.too_large)
    return remarks(state) if contradicts else []


def _square(state: State, readings: list[Told]) -> float:
    """Chi-square of readings of one point about their weighted mean."""
    weights, mean = _mean(state, readings)
    values = [each.error_mm for each in readings]
    return float(sum((x - mean) @ w @ (x - mean) for w, x in zip(weights, values, strict=True)))


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
