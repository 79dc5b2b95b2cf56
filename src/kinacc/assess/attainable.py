"""How near to the largest size a bound can come: what is attained with sizes known, what is proven.

An upper bound is measured by its mean excess: how far it is above the largest size on average,
counted as nothing where it is below. All functions take the true sizes of the points that the bound
is about, (m,), mm, and the standard deviation of a reading per axis, one for all or (m,), mm.
docs/bounds.md has the proofs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, fminbound
from scipy.special import chndtrix, ndtr, ndtri, rel_entr

from kinacc.assess.limits import reading_below
from kinacc.assess.statement import MEAN, MEASURED, REGION, Statement

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(96)  # of a quadrature, dense at its beginning
_BEYOND = 6.0  # standard deviations behind which nothing is left of an integrand
_TABLE_TO = 30.0  # standard deviations of size up to which quantiles of lengths are tabulated
# Of noise over distance from a level: 2 evens quantiles out, 2/3 ties of unequal noise.
_POWER = 1.5


class WidthLimits(NamedTuple):
    """The limits of one statement, mm; infinite where none can be had, NaN where sizes are none."""

    attainable_mm: float  # mean excess of the upper bound by the best fixed design, sizes known
    proven_mm: float  # mean excess below which no rule stays whose bound holds whatever is true
    attainable_lower_mm: float  # mean distance of the lower bound where the largest point is known


NONE = WidthLimits(math.nan, math.nan, math.nan)


def limits_of(
    statement: Statement,
    visited: Sequence[int],
    sizes_mm: np.ndarray,
    noise_mm: np.ndarray,
    readings: int,
) -> WidthLimits:
    """Limits of a statement, of sizes and noise (m,) of all candidates.

    NaN where it states no upper bound, or another: on a region, all but some, single visits.
    """
    unlimited = statement.target == REGION or statement.excepted > 0 or statement.error_of != MEAN
    if math.isnan(statement.upper_mm) or unlimited:
        return NONE
    rows = np.sort(visited) if statement.target == MEASURED else np.arange(len(sizes_mm))
    return width_limits(sizes_mm[rows], noise_mm[rows], readings, 1.0 - statement.confidence)


def width_limits(
    sizes_mm: np.ndarray, noise_mm: np.ndarray | float, readings: int, error: float
) -> WidthLimits:
    """All three limits for a number of readings and the error allowed to each side.

    The lower one where all points but the largest are read once. Infinite with fewer readings than
    points.
    """
    noise, attainable, lower = np.broadcast_to(noise_mm, len(sizes_mm)), math.inf, math.inf
    if readings >= len(sizes_mm):
        counts = best_counts(sizes_mm, noise, readings, error)
        attainable = mean_excess_mm(sizes_mm, noise, counts, error)
        spread = float(noise[np.argmax(sizes_mm)]) / math.sqrt(readings - len(sizes_mm) + 1)
        lower = -float(ndtri(error)) * spread
    return WidthLimits(attainable, proven_excess_mm(sizes_mm, noise, readings, error), lower)


def best_counts(
    sizes_mm: np.ndarray, noise_mm: np.ndarray, readings: int, error: float
) -> np.ndarray:
    """Readings (m,) of each point, at least one, that make the mean excess least.

    The best of those counts that are in proportion to a power of noise over distance from a common
    level; what single readings moved by trial still gain is 2 %.
    """
    below = np.max(sizes_mm) - sizes_mm

    def counts(log_level: float) -> np.ndarray:
        return _filled((noise_mm / (math.exp(log_level) + below)) ** _POWER, readings)

    def excess(log_level: float) -> float:
        return mean_excess_mm(sizes_mm, noise_mm, counts(log_level), error)

    # A level hardly above the largest size gives it all; one far above all shares equally.
    first, last = 0.1 * noise_mm.min() / math.sqrt(readings), noise_mm.max() * 10.0 + below.max()
    return counts(float(fminbound(excess, math.log(first), math.log(last), xtol=0.03)))


def mean_excess_mm(
    sizes_mm: np.ndarray, noise_mm: np.ndarray, counts: np.ndarray, error: float
) -> float:
    """Mean of what the largest upper limit is above the largest size, by readings (m,) of a point.

    A point's limit is that of :func:`kinacc.assess.limits.upper_limit_mm`: it misses the size of
    its point with probability ``error`` exactly.
    """
    top, spread = float(np.max(sizes_mm)), noise_mm / np.sqrt(counts)
    reaches = sizes_mm - top + (-float(ndtri(error)) + _BEYOND) * spread
    sizes, spread = sizes_mm[reaches > 0.0], spread[reaches > 0.0]  # others are never the largest
    gaps, weights = _quadrature(float(reaches.max()))
    shortest = _short_length((top + gaps)[:, None] / spread, error)
    return float(weights @ (1.0 - reading_below(shortest, sizes / spread).prod(axis=1)))


def proven_excess_mm(
    sizes_mm: np.ndarray, noise_mm: np.ndarray, readings: int, error: float
) -> float:
    """Mean excess that every rule has whose bound fails with probability ``error`` at most.

    Of rules with at most so many readings, adaptive or not, that hold whatever the errors are and
    always state a bound. With p = P(bound < u) for a level u above all sizes, point i needs
    2 noise^2 kl(p, error) / (u - size)^2 readings on average, and 1 - error at least; p is at most
    that of the best test with all readings on one point: the largest p that all this leaves,
    integrated over u. Infinite where readings are less than 1 - error of the points.
    """
    points = len(sizes_mm)
    if readings <= (1.0 - error) * points:
        return math.inf
    z = -float(ndtri(error))
    # From here on the readings pay for certainty, or the best test is certain.
    certain = math.sqrt(-2.0 * math.log(error) * points / (readings - (1.0 - error) * points))
    gaps, weights = _quadrature(
        float(noise_mm.max()) * max(certain, (z + _BEYOND) / math.sqrt(readings))
    )
    deviations = (gaps[:, None] + (np.max(sizes_mm) - sizes_mm)) / noise_mm

    def needed(probability: np.ndarray) -> np.ndarray:
        """Mean readings it takes that P(bound < level) is so large, by level."""
        divergence = rel_entr(probability, error) + rel_entr(1.0 - probability, 1.0 - error)
        return np.maximum(2.0 * divergence[:, None] / deviations**2, 1.0 - error).sum(axis=1)

    low, high = np.full(len(gaps), error), np.ones(len(gaps))
    for _ in range(40):
        middle = 0.5 * (low + high)
        enough = needed(middle) <= readings
        low, high = np.where(enough, middle, low), np.where(enough, high, middle)
    best_test = ndtr(deviations.min(axis=1) * math.sqrt(readings) - z)
    return float(weights @ (1.0 - np.minimum(best_test, low)))


def _filled(wanted: np.ndarray, readings: int) -> np.ndarray:
    """Whole counts in proportion to those wanted (m,), at least 1, ``readings`` together."""

    def excess(factor: float) -> float:
        return float(np.maximum(factor * wanted, 1.0).sum()) - readings

    factor = float(brentq(excess, 0.0, readings / wanted.max()))
    exact = np.maximum(factor * wanted, 1.0)
    counts = np.floor(exact).astype(np.int64)
    spare = readings - int(counts.sum())
    counts[np.argsort(counts - exact, kind="stable")[:spare]] += 1
    return counts


def _quadrature(end: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights from 0 to ``end``, by the cube of a Gauss-Legendre variable."""
    share = 0.5 * (_NODES + 1.0)
    return end * share**3, end * 1.5 * share**2 * _WEIGHTS


def _short_length(sizes: np.ndarray, error: float) -> np.ndarray:
    """Length that a reading of noise 1 stays below with probability ``error``, by true size."""
    z, far = -ndtri(error), np.maximum(sizes, _TABLE_TO)
    beyond = far - z + 1.0 / far + 0.5 * z / (far * far)
    return np.where(sizes < _TABLE_TO, np.interp(sizes, *_short_lengths(error)), beyond)


@lru_cache(maxsize=16)
def _short_lengths(error: float) -> tuple[np.ndarray, np.ndarray]:
    sizes = np.linspace(0.0, _TABLE_TO, 3001)
    return sizes, np.sqrt(chndtrix(error, 3.0, sizes**2))
