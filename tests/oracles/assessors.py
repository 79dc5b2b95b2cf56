"""The three assessors for one simulation, in plain Python with scipy.stats (paper eqs. 11-24).

A world is a function ``reading(j, v)`` that gives the v-th measured error vector (v = 1, 2, ...) at
operating point j, whatever led there. Lengths are in millimetres; ``sigma`` is the standard
deviation per axis, one number for each operating point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from scipy import stats

Reading = Callable[[int, int], Sequence[float]]
GRID_PER_MM = 1000


def norm(vector: Sequence[float]) -> float:
    return math.sqrt(math.fsum(x * x for x in vector))


# --- outlier rejection (eqs. 13-14) ---------------------------------------------------------------


def outlier_limit(magnitudes: Sequence[float], rule: str) -> float:
    """The c of eq. 14."""
    values = np.asarray(magnitudes, float)
    if rule == "normal":
        return float(values.mean() + 1.96 * values.std())
    if rule == "gamma":
        return gamma99(values)
    if rule == "iqr":
        low, high = np.percentile(values, [25, 75])
        return float(high + 1.5 * (high - low))
    raise ValueError(rule)


def outlier_rejection(magnitudes: Sequence[float], rule: str) -> float:
    limit = outlier_limit(magnitudes, rule)
    return max(value for value in magnitudes if not value > limit)


def gamma99(values: Sequence[float]) -> float:
    """The 99 % quantile of a gamma distribution from 0, fitted by maximum likelihood."""
    shape, _, scale = stats.gamma.fit(np.asarray(values, float), floc=0)
    return float(stats.gamma.ppf(0.99, shape, scale=scale))


# --- model invalidation (eqs. 15-24) --------------------------------------------------------------


@dataclass(frozen=True)
class Switches:
    distance: str = "squared"  # or "as_printed"
    covariance: str = "r"  # or "sqrt_r"
    alpha: float = 0.6


@dataclass
class Step:
    iteration: int
    point: int
    repeat: int
    measured: float
    averaged: float
    probability: float


@dataclass
class Run:
    rejected: bool
    points_visited: int
    measurements: int
    steps: list[Step] = field(default_factory=list)


def distance_outside(mean: Sequence[float], sigma: float, eta: float) -> float:
    """Eq. 20 with the candidate of eq. 21 in place of the unknown error, ``sigma`` of the mean."""
    size = norm(mean)
    if size <= eta:
        return 0.0
    candidate = [x / size * eta for x in mean]
    return norm([x - c for x, c in zip(mean, candidate, strict=True)]) / sigma


def invalidation_run(
    reading: Reading,
    order: Sequence[int],
    sigma: Sequence[float],
    eta: float,
    budget: int,
    switches: Switches = Switches(),
) -> Run:
    """One pass of the algorithm for one bound: which points it measures and whether it rejects."""
    sums: dict[int, list[float]] = {}
    counts: dict[int, int] = {}
    distances: dict[int, float] = {}
    run = Run(rejected=False, points_visited=0, measurements=0)
    probability = 0.0
    unexplored = list(order)
    for iteration in range(1, budget + 1):
        if probability > switches.alpha:
            # Largest p-hat*, told apart by the distance where the probabilities round to 1.
            point = max(distances, key=lambda j: distances[j])
        elif unexplored:
            point = unexplored.pop(0)
            sums[point], counts[point] = [0.0] * 3, 0
        else:
            break
        counts[point] += 1
        value = [float(x) for x in reading(point, counts[point])]
        sums[point] = [a + b for a, b in zip(sums[point], value, strict=True)]
        mean = [x / counts[point] for x in sums[point]]
        shrink = {"r": counts[point], "sqrt_r": math.sqrt(counts[point])}[switches.covariance]
        distances[point] = distance_outside(mean, sigma[point] / math.sqrt(shrink), eta)
        probability = 1.0 - math.prod(
            1.0 - point_probability(d, switches.distance) for d in distances.values()
        )
        run.steps.append(
            Step(iteration, point, counts[point], norm(value), norm(mean), probability)
        )
    run.measurements = len(run.steps)
    run.points_visited = len(counts)
    run.rejected = probability > switches.alpha
    return run


@cache
def point_probability(distance: float, kind: str) -> float:
    """Eq. 18: chi-square CDF of the squared distance, or of the distance as printed."""
    return float(stats.chi2.cdf({"squared": distance**2, "as_printed": distance}[kind], 3))


def decisions(rejects: Callable[[float], bool], top: float) -> list[bool]:
    """Whether each bound k x 1 um, k = 0, 1, ... up to just above the largest single reading, is
    rejected: the whole scan, from which both scan readings follow."""
    return [rejects(k / GRID_PER_MM) for k in range(math.ceil(top * GRID_PER_MM) + 1)]


def from_above(flags: Sequence[bool]) -> int:
    """Grid index just above the highest rejected bound."""
    return max((k for k, rejected in enumerate(flags) if rejected), default=-1) + 1


def from_below(flags: Sequence[bool]) -> int:
    """Lowest grid index that is not rejected."""
    return next(k for k, rejected in enumerate(flags) if not rejected)


def bisection(rejects: Callable[[float], bool], top: float) -> float:
    """Halving between 0 and the largest single reading until the bracket is at most 1 um; the
    end that was not rejected."""
    low, high = 0.0, top
    while high - low > 1 / GRID_PER_MM:
        middle = (low + high) / 2
        if rejects(middle):
            low = middle
        else:
            high = middle
    return high
