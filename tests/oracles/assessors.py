"""The three assessors for one simulation, in plain Python with scipy.stats (paper eqs. 11-24).

A world is a function ``reading(j, v)`` that gives the v-th measured error vector (v = 1, 2, ...) at
operating point j, whatever led there. Lengths are in millimetres; ``sigma`` is the standard
deviation per axis, one entry per operating point: a number, or one number per axis (eq. 10).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import optimize, stats

Reading = Callable[[int, int], Sequence[float]]
GRID_PER_MM = 1000


def norm(vector: Sequence[float]) -> float:
    return math.sqrt(math.fsum(x * x for x in vector))


# --- maximum measurement (eqs. 11-12) and outlier rejection (eqs. 13-14) -------------------------


def maximum(magnitudes: Sequence[float]) -> float:
    return max(magnitudes)


def outlier_limit(magnitudes: Sequence[float], rule: str, ddof: int = 0) -> float:
    """The c of eq. 14. ``ddof`` and the factor 1.96 belong to the normal rule."""
    values = np.asarray(magnitudes, float)
    if rule == "normal":
        return float(values.mean() + 1.96 * values.std(ddof=ddof))
    if rule == "gamma":
        shape, _, scale = gamma_fit(values)
        return float(stats.gamma.ppf(0.99, shape, scale=scale))
    if rule == "iqr":
        low, high = np.percentile(values, [25, 75])
        return float(high + 1.5 * (high - low))
    raise ValueError(rule)


def outlier_rejection(magnitudes: Sequence[float], rule: str, ddof: int = 0) -> float:
    limit = outlier_limit(magnitudes, rule, ddof)
    return max(value for value in magnitudes if not value > limit)


def gamma_fit(values: Sequence[float]) -> tuple[float, float, float]:
    """Maximum likelihood with the location held at 0: (shape, 0, scale)."""
    return stats.gamma.fit(np.asarray(values, float), floc=0)


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


def nearest_in_ball(mean: Sequence[float], variances: Sequence[float], eta: float) -> list[float]:
    """Point of the ball |x| <= eta at the smallest Mahalanobis distance from ``mean`` (eq. 21 where
    the variances are equal). Stationarity: x_i = mean_i / (1 + t v_i) with t >= 0, |x| = eta."""
    size = norm(mean)
    if size <= eta:
        return list(mean)
    if eta == 0:
        return [0.0] * len(mean)
    if len(set(variances)) == 1:
        return [x / size * eta for x in mean]

    def excess(t: float) -> float:
        return norm([x / (1 + t * v) for x, v in zip(mean, variances, strict=True)]) - eta

    high = 1.0 / min(variances)
    while excess(high) > 0:
        high *= 2
    t = optimize.brentq(excess, 0.0, high, xtol=1e-300, rtol=1e-15, maxiter=500)
    return [x / (1 + t * v) for x, v in zip(mean, variances, strict=True)]


def distance_outside(mean: Sequence[float], variances: Sequence[float], eta: float) -> float:
    """Eq. 20 with the candidate of eq. 21 in place of the unknown error."""
    if norm(mean) <= eta:
        return 0.0
    candidate = nearest_in_ball(mean, variances, eta)
    return math.sqrt(
        math.fsum((x - c) ** 2 / v for x, c, v in zip(mean, candidate, variances, strict=True))
    )


def invalidation_run(
    reading: Reading,
    order: Sequence[int],
    sigma: Sequence[float | Sequence[float]],
    eta: float,
    budget: int,
    switches: Switches = Switches(),
    axes: int = 3,
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
            sums[point], counts[point] = [0.0] * axes, 0
        else:
            break
        counts[point] += 1
        value = [float(x) for x in reading(point, counts[point])]
        sums[point] = [a + b for a, b in zip(sums[point], value, strict=True)]
        mean = [x / counts[point] for x in sums[point]]
        shrink = {"r": counts[point], "sqrt_r": math.sqrt(counts[point])}[switches.covariance]
        variances = [s * s / shrink for s in per_axis(sigma[point], axes)]
        distances[point] = distance_outside(mean, variances, eta)
        probability = 1.0 - math.prod(
            1.0 - point_probability(d, axes, switches.distance) for d in distances.values()
        )
        run.steps.append(
            Step(iteration, point, counts[point], norm(value), norm(mean), probability)
        )
    run.measurements = len(run.steps)
    run.points_visited = len(counts)
    run.rejected = probability > switches.alpha
    return run


def per_axis(sigma: float | Sequence[float], axes: int) -> list[float]:
    return [float(sigma)] * axes if np.isscalar(sigma) else [float(x) for x in sigma]


_cache: dict[tuple[float, int, str], float] = {}


def point_probability(distance: float, axes: int, kind: str) -> float:
    """Eq. 18: chi-square CDF of the squared distance, or of the distance as printed."""
    if distance == 0.0:
        return 0.0
    key = (distance, axes, kind)
    if key not in _cache:
        argument = {"squared": distance**2, "as_printed": distance}[kind]
        _cache[key] = float(stats.chi2.cdf(argument, axes))
    return _cache[key]


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
