"""Whether readings of several poses show a drift or a step that all of them have in common.

A change has one of a number of shapes over the readings: linear in time, or a step at one of the
gaps between them. Each shape is centred pose by pose, so that the errors of the poses drop out.
What a shape explains is a square of three standard normal components where nothing changed; where
the noise is known up to a factor only, it is taken as a part of the square of all that is left of
the readings. Proofs: docs/drift-and-steps.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

_OF_DRIFT = 0.6  # of the false alarms, for the linear drift; steps have the rest
_GRID = 64  # nodes per axis of a probability that two shapes alarm together


@dataclass(frozen=True)
class Shapes:
    """Courses a change may have over readings, centred by pose: the drift, then steps in order.

    ``unit`` (shapes, n): times readings of variance 1 / weight it is standard normal; ``length``
    (shapes,): divided by it, a reading of unit variance gives the change. ``gap``: the reading
    before which a shape steps (0 for the drift).
    """

    pose: np.ndarray
    weight: np.ndarray
    unit: np.ndarray
    length: np.ndarray
    gap: tuple[int, ...]

    def within(self, whitened: np.ndarray) -> np.ndarray:
        """Readings (3, n) about the means of their poses, at unit variance."""
        return _centred(whitened, self.pose, self.weight) * np.sqrt(self.weight)

    def thresholds(self, error: float, freedom: float) -> np.ndarray:
        """Squares (shapes,) that one exceeds with probability ``error`` at most, without change."""
        correlation = (self.unit / self.weight) @ self.unit.T
        chain = tuple(np.abs(np.diagonal(correlation[1:, 1:], 1)).tolist())
        nearest = float(np.abs(correlation[0, 1:]).max(initial=0.0))
        drift, step = _thresholds(chain, nearest, len(self.gap) - 1, error, freedom)
        return np.array([drift] + [step] * (len(self.gap) - 1))


@lru_cache(maxsize=256)
def shapes_of(time: tuple, row: tuple, weight: tuple) -> Shapes:
    pose, weights = np.array(row), np.array(weight)
    count, poses = len(row), len(set(row))
    gaps = range(poses, count - poses + 1)
    courses = np.array([time] + [[float(k >= gap) for k in range(count)] for gap in gaps])
    apart = _centred(courses, pose, weights)
    length = np.sqrt(np.sum(apart**2 * weights, axis=1))
    told = length > 1e-9
    unit = apart[told] * weights / length[told, None]
    gap = np.array([0, *gaps])[told]
    return Shapes(pose, weights, unit, length[told], tuple(int(each) for each in gap))


def _centred(values: np.ndarray, pose: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Values (.., n) without the weighted mean of their pose."""
    belongs = (pose[:, None] == np.unique(pose)[None, :]).astype(float)
    means = (values * weight) @ belongs / (weight @ belongs)
    return values - means @ belongs.T


@lru_cache(maxsize=256)
def _thresholds(
    chain: tuple[float, ...], nearest: float, steps: int, error: float, freedom: float
) -> tuple[float, float]:
    """Squares that the drift's and the steps' are held to.

    The probability that any exceeds its own is at most the sum of all, without what neighbours of
    a tree exceed together (Hunter and Worsley): steps in their order, and the drift beside the
    step most like it.
    """
    drift = _square_beyond(error * (_OF_DRIFT if steps else 1.0), freedom)
    if not steps:
        return drift, math.inf

    def excess(step: float) -> float:
        together = sum(_both(each, step, step, freedom) for each in chain)
        alone = steps * _beyond(step, freedom) + _beyond(drift, freedom)
        return math.log((alone - together - _both(nearest, drift, step, freedom)) / error)

    # The logarithm is nearly a straight line, so few secants meet it.
    one = _square_beyond(error, freedom)
    step = _square_beyond(error * (1.0 - _OF_DRIFT) / steps, freedom)
    before, now = excess(one), excess(step)
    while abs(now) > 1e-6 and abs(step - one) > 1e-12 * step:
        one, step = step, step - now * (step - one) / (now - before)
        before, now = now, excess(step)
    return drift, step


def _beyond(square: float, freedom: float) -> float:
    """Probability of so large a square of three components, without change."""
    if math.isinf(freedom):
        return float(scipy.special.chdtrc(3.0, square))
    return float(scipy.special.betainc(0.5 * (freedom - 3.0), 1.5, 1.0 - square))


def _square_beyond(probability: float, freedom: float) -> float:
    if math.isinf(freedom):
        return float(scipy.special.chdtri(3.0, probability))
    return 1.0 - float(scipy.special.betaincinv(0.5 * (freedom - 3.0), 1.5, probability))


@lru_cache(maxsize=4096)
def _both(correlation: float, first: float, second: float, freedom: float) -> float:
    """Probability that two squares, of vectors (3,) with a correlation, exceed their limits.

    The second vector is ``correlation`` times the first and a part independent of it, whose angle
    with the first is uniform in its cosine: an integral over the two lengths is left.
    """
    tail = (np.arange(_GRID) + 0.5) / _GRID
    alone = _beyond(first, freedom)
    if math.isinf(freedom):
        a = scipy.special.chdtri(3.0, tail * alone)[:, None]
        w = scipy.special.chdtri(3.0, tail)[None, :]
    else:
        a = (1.0 - scipy.special.betaincinv(0.5 * (freedom - 3.0), 1.5, tail * alone))[:, None]
        w = (1.0 - a) * scipy.special.betaincinv(1.5, 0.5 * (freedom - 6.0), tail)[None, :]
    rest = max(1.0 - correlation**2, 1e-12)
    mixed = 2.0 * correlation * math.sqrt(rest) * np.sqrt(a * w) + 1e-300
    cosine = (second - correlation**2 * a - rest * w) / mixed
    return alone * float(np.mean(np.clip(0.5 * (1.0 - cosine), 0.0, 1.0)))


def likelier(square: np.ndarray, freedom: float) -> int:
    """The shape to name: the drift, or the step that fits best where steps are likelier on average.

    So a step, which has many places to fit by chance, is not preferred for their number.
    """
    likely = 0.5 * square if math.isinf(freedom) else -0.5 * freedom * np.log1p(-square)
    steps = likely[1:]
    if not steps.size or likely[0] >= np.logaddexp.reduce(steps) - math.log(steps.size):
        return 0
    return 1 + int(np.argmax(steps))


def half_found(least: float, freedom: float) -> float:
    """Length of a mean (3,), in standard deviations, whose square exceeds ``least`` half the time.

    Of the linear drift alone: steps only add to what is found.
    """
    if math.isinf(freedom):
        return math.sqrt(float(scipy.special.chndtrinc(least, 3.0, 0.5)))
    ratio = least / (1.0 - least) * (freedom - 3.0) / 3.0
    return math.sqrt(float(scipy.special.ncfdtrinc(3.0, freedom - 3.0, 0.5, ratio)))
