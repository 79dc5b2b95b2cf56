"""How near to the largest size a bound can come: what is attained with sizes known, what is proven.

An upper bound is measured by its mean excess: how far it is above the largest size on average,
counted as nothing where it is below. All functions take the true sizes of the points that the bound
is about, (m,), mm, and the standard deviation of a reading per axis, one for all or (m,), mm.
docs/limits-of-bounds.md has the proofs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kinacc.assess.statement import MEAN, MEASURED, REGION, Statement

_NODES = 8  # of a panel; each panel of a quadrature is twice as wide as the one before
_BEYOND = 6.0  # standard deviations behind which nothing is left of an integrand
_TABLE_TO = 30.0  # standard deviations of size up to which quantiles of lengths are tabulated
_POWER = (
    1.5  # of noise over distance from a level; 2 evens quantiles out, 2/3 ties of unequal noise
)
_LEVELS = 7  # levels tried first when the best counts are sought
_HALVINGS = 4  # of the distance at which neighbours of the best level are tried next


class WidthLimits(NamedTuple):
    """The limits of one statement, mm; infinite where none can be had, NaN where sizes are none."""

    attainable_mm: float  # mean excess of the upper bound by the best fixed design, sizes known
    proven_mm: float  # mean excess below which no rule stays whose bound holds whatever is true
    lower_mm: float  # mean distance of the lower bound where the largest point is known


NONE = WidthLimits(math.nan, math.nan, math.nan)


def points_bounded(said: Statement, visited: Sequence[int], candidates: int) -> np.ndarray:
    """Rows of the points whose largest mean error a statement bounds, in ascending order.

    None where it states no upper bound, or another: on a region, all but some, single visits.
    """
    other = said.target == REGION or said.excepted > 0 or said.error_of != MEAN
    if math.isnan(said.upper_mm) or other:
        return np.empty(0, dtype=int)
    every = np.arange(candidates)
    return np.sort(np.asarray(visited, int)) if said.target == MEASURED else every


def limits_of(
    said: Statement,
    visited: Sequence[int],
    sizes_mm: np.ndarray,
    noise_mm: np.ndarray,
    readings: int,
) -> WidthLimits:
    """Limits of a statement, of sizes and noise (m,) of all candidates; NaN where it has none."""
    rows = points_bounded(said, visited, len(sizes_mm))
    return width_limits(sizes_mm[rows], noise_mm[rows], readings, 1.0 - said.confidence)


def width_limits(
    sizes_mm: np.ndarray, noise_mm: np.ndarray | float, readings: int, error: float
) -> WidthLimits:
    """All three limits for a number of readings and the error allowed to each side."""
    if len(sizes_mm) == 0:
        return NONE
    return WidthLimits(
        attainable_excess_mm(sizes_mm, noise_mm, readings, error),
        proven_excess_mm(sizes_mm, noise_mm, readings, error),
        lower_distance_mm(sizes_mm, noise_mm, readings, error),
    )


def attainable_excess_mm(
    sizes_mm: np.ndarray, noise_mm: np.ndarray | float, readings: int, error: float
) -> float:
    """Mean excess of the largest upper limit, each point read as often as :func:`best_counts` says.

    A point's limit is that of :func:`kinacc.assess.limits.upper_limit_mm`: it misses the size of
    its point with probability ``error`` exactly. Infinite with fewer readings than points.
    """
    sizes, noise = _descending(sizes_mm, noise_mm)
    if readings < len(sizes):
        return math.inf
    return _mean_excess_mm(sizes, noise, _best_counts(sizes, noise, readings, error), error)


def best_counts(
    sizes_mm: np.ndarray, noise_mm: np.ndarray | float, readings: int, error: float
) -> np.ndarray:
    """Readings of each point, at least one, that make the mean excess least: (m,), in their order.

    The best of those counts that are in proportion to a power of noise over distance from a common
    level; what single readings moved by trial still gain is 2 %. ValueError: fewer than points.
    """
    if readings < len(sizes_mm):
        raise ValueError("every point is read at least once")
    order = np.argsort(-np.asarray(sizes_mm), kind="stable")
    counts = np.empty(len(order), dtype=np.int64)
    counts[order] = _best_counts(*_descending(sizes_mm, noise_mm), readings, error)
    return counts


def proven_excess_mm(
    sizes_mm: np.ndarray, noise_mm: np.ndarray | float, readings: int, error: float
) -> float:
    """Mean excess that every rule has whose bound fails with probability ``error`` at most.

    Of rules with at most so many readings, adaptive or not, that hold whatever the errors are and
    always state a bound. With p = P(bound < u) for a level u above all sizes, point i needs
    2 noise^2 kl(p, error) / (u - size)^2 readings on average, and 1 - error at least; p is at most
    that of the best test with all readings on one point: the largest p that all this leaves,
    integrated over u. Infinite where readings are less than 1 - error of the points.
    """
    sizes, noise = _descending(sizes_mm, noise_mm)
    if readings <= (1.0 - error) * len(sizes):
        return math.inf
    z = _deviate(error)
    narrowest = float(np.max(noise)) / math.sqrt(readings)
    far = _enough_mm(sizes, noise, readings, error)
    gaps, weights = _panels(narrowest, max(far, (z + _BEYOND) * narrowest))
    distances = gaps[:, None] + (sizes[0] - sizes)
    from scipy.special import ndtr

    best_test = ndtr((distances / noise).min(axis=1) * math.sqrt(readings) - z)
    probability = np.minimum(best_test, _affordable(distances / noise, readings, error))
    return float(weights @ (1.0 - probability))


def lower_distance_mm(
    sizes_mm: np.ndarray, noise_mm: np.ndarray | float, readings: int, error: float
) -> float:
    """Mean distance of the lower bound from the largest size, all others read once: z s/sqrt(k)."""
    sizes, noise = _descending(sizes_mm, noise_mm)
    if readings < len(sizes):
        return math.inf
    return _deviate(error) * float(noise[0]) / math.sqrt(readings - len(sizes) + 1)


def _descending(
    sizes_mm: np.ndarray, noise_mm: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    sizes = np.asarray(sizes_mm, dtype=float)
    order = np.argsort(-sizes, kind="stable")
    return sizes[order], np.broadcast_to(np.asarray(noise_mm, dtype=float), sizes.shape)[order]


def _best_counts(sizes: np.ndarray, noise: np.ndarray, readings: int, error: float) -> np.ndarray:
    if readings == len(sizes):
        return np.ones(len(sizes), dtype=np.int64)
    # A level hardly above the largest size gives it all; one far above all shares equally.
    low = math.log(0.1 * float(noise.min()) / math.sqrt(readings))
    high = math.log(float(noise.max()) * 10.0 + float(sizes[0] - sizes[-1]))
    step = (high - low) / (_LEVELS - 1)
    tried: dict[float, tuple[float, np.ndarray]] = {}
    asked = [low + number * step for number in range(_LEVELS)]
    for _ in range(_HALVINGS + 1):
        for level in asked:
            distances = math.exp(level) + (sizes[0] - sizes)
            counts = _filled((noise / distances) ** _POWER, readings)
            tried[level] = _mean_excess_mm(sizes, noise, counts, error), counts
        best = min(tried, key=lambda level: tried[level][0])
        step *= 0.5
        asked = [best - step, best + step]
    return tried[best][1]


def _filled(wanted: np.ndarray, readings: int) -> np.ndarray:
    """Whole counts in proportion to those wanted (m,), at least 1, ``readings`` together."""
    order = np.argsort(-wanted, kind="stable")
    total = np.cumsum(wanted[order])
    filled = np.arange(1, len(wanted) + 1)
    factors = (readings - len(wanted) + filled) / total  # if so many points are above 1
    holds = np.flatnonzero(factors * wanted[order] > 1.0)
    exact = np.maximum(factors[holds[-1]] * wanted, 1.0)
    counts = np.floor(exact).astype(np.int64)
    left = readings - int(counts.sum())
    counts[np.argsort(counts - exact, kind="stable")[:left]] += 1
    return counts


def _mean_excess_mm(
    sizes: np.ndarray, noise: np.ndarray, counts: np.ndarray, error: float
) -> float:
    """Mean of what the largest upper limit is above the largest size, sizes descending."""
    spread = noise / np.sqrt(counts)
    reaches = sizes - sizes[0] + (_deviate(error) + _BEYOND) * spread
    sizes, spread = sizes[reaches > 0.0], spread[reaches > 0.0]  # others are never the largest
    reach = float(reaches.max())
    gaps, weights = _panels(float(spread[0]), reach)
    levels = (sizes[0] + gaps)[:, None] / spread
    below = _length_below(_short_length(levels, error), sizes / spread)
    return float(weights @ (1.0 - below.prod(axis=1)))


def _panels(first: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of a quadrature from 0 to ``end``, fine as ``first`` at the beginning."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    panels = max(math.ceil(math.log2(max(end / first, 1.0) + 1.0)), 1)
    edges = end * (2.0 ** np.arange(panels + 1) - 1.0) / (2.0**panels - 1.0)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (nodes + 1.0)).ravel(), (half * weights).ravel()


def _length_below(lengths: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Probability of a length of N(size, 1) in three dimensions: the noncentral chi function."""
    from scipy.special import ndtr

    near, mirrored = lengths - sizes, lengths + sizes
    size = np.maximum(sizes, 1e-4)  # below, the limit for size 0 is met to 1e-8
    # [phi(x - s) - phi(x + s)] / s, without cancellation where sizes are small.
    density = np.exp(-0.5 * near * near) * -np.expm1(-2.0 * lengths * size)
    return np.maximum(
        ndtr(near) - ndtr(-mirrored) - density / (size * math.sqrt(2.0 * math.pi)), 0.0
    )


def _short_length(sizes: np.ndarray, error: float) -> np.ndarray:
    """Length that a reading of noise 1 stays below with probability ``error``, by true size."""
    z = _deviate(error)
    known, lengths = _short_lengths(error)
    far = np.maximum(sizes, _TABLE_TO)
    return np.where(
        sizes < _TABLE_TO,
        np.interp(sizes, known, lengths),
        far - z + 1.0 / far + 0.5 * z / (far * far),
    )


@lru_cache(maxsize=16)
def _short_lengths(error: float) -> tuple[np.ndarray, np.ndarray]:
    sizes = np.linspace(0.0, _TABLE_TO, 6001)
    low, high = np.zeros_like(sizes), sizes + 4.0
    for _ in range(48):
        middle = 0.5 * (low + high)
        short = _length_below(middle, sizes) < error
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return sizes, 0.5 * (low + high)


def _deviate(error: float) -> float:
    from scipy.special import ndtri

    return -float(ndtri(error))


def _divergence(probability: np.ndarray, error: float) -> np.ndarray:
    """Kullback-Leibler divergence of a probability of at least ``error`` from ``error``."""
    from scipy.special import xlogy

    rest = 1.0 - probability
    return xlogy(probability, probability / error) + xlogy(rest, rest / (1.0 - error))


def _readings_needed(deviations: np.ndarray, probability: np.ndarray, error: float) -> np.ndarray:
    """Mean readings it takes that P(bound < level) = ``probability``; deviations: (levels, m)."""
    by_divergence = 2.0 * _divergence(probability, error)[:, None] / (deviations * deviations)
    return np.maximum(by_divergence, 1.0 - error).sum(axis=1)


def _affordable(deviations: np.ndarray, readings: int, error: float) -> np.ndarray:
    """Largest probability that the readings can pay for, by level: (levels,)."""
    low = np.full(len(deviations), error)
    high = np.ones(len(deviations))
    paid = _readings_needed(deviations, high, error) <= readings
    for _ in range(40):
        middle = 0.5 * (low + high)
        enough = _readings_needed(deviations, middle, error) <= readings
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    return np.where(paid, 1.0, low)


def _enough_mm(sizes: np.ndarray, noise: np.ndarray, readings: int, error: float) -> float:
    """Distance above the largest size from which on the readings pay for certainty."""
    one = np.ones(1)

    def enough(gap: float) -> bool:
        deviations = (gap + sizes[0] - sizes)[None, :] / noise
        return bool(_readings_needed(deviations, one, error)[0] <= readings)

    low, high = 0.0, float(noise.max())
    while not enough(high):
        high *= 2.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high
