"""Limits on the size of one point's error, from its averaged reading.

Readings are normal (eq. 9). With equal noise per axis the size of a reading is noncentral chi
distributed with three degrees of freedom; with other noise the true error lies in an ellipsoid.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.optimize import brentq

_ROOT_2_PI = math.sqrt(2.0 * math.pi)
_TINY = 1e-9  # sizes below it count as it
VISITS = 0.95  # share of future visits that a bound on single visits is about
_FAR = 300.0  # sizes over noise from which on an expansion is exact to 1e-7


def upper_limit_mm(mean_mm: np.ndarray, noise: float | np.ndarray, error: float) -> float:
    """Return the size that the true error exceeds with probability at most ``error``.

    mean_mm: (3,) average of readings; noise: its standard deviation per axis (mm), or its
    covariance (3, 3), mm^2. Equal noise per axis: the noncentral chi limit. Unequal: the farthest
    point of an ellipsoid, a little wider.
    """
    if isinstance(noise, float):
        return noise * size_at(float(np.linalg.norm(mean_mm)) / noise, error)
    from scipy.special import ndtri

    return largest_size(mean_mm, noise, -float(ndtri(error)))


def lower_limit_mm(mean_mm: np.ndarray, noise: float | np.ndarray, error: float) -> float:
    """Return the size that the true error falls below with probability at most ``error``.

    Where noise is unequal, the smallest size in the ellipsoid that holds the true error with the
    confidence asked for: an error of any size outside is rejected whatever its direction.
    """
    size = float(np.linalg.norm(mean_mm))
    if isinstance(noise, float):
        return noise * size_at(size / noise, 1.0 - error)
    from scipy.special import chdtri

    deviations = math.sqrt(float(chdtri(3, error)))
    distances = BallDistances(np.asarray(mean_mm)[None], noise[None])
    if distances.beyond(0.0)[0] <= deviations:
        return 0.0
    return brentq(lambda low: distances.beyond(low)[0] - deviations, 0.0, size, xtol=1e-12 * size)


def reading_below(x: np.ndarray | float, a: np.ndarray | float) -> np.ndarray:
    """Return the probability that a reading at a point of size ``a`` has at most size ``x``.

    Both in standard deviations of the noise per axis: the noncentral chi distribution with three
    degrees of freedom. SciPy's chndtr takes milliseconds beyond sizes of 1000.
    """
    from scipy.special import ndtr

    a = np.maximum(a, _TINY)
    # [phi(x - a) - phi(x + a)] / a, without cancellation where sizes are small.
    bulge = np.exp(-0.5 * (x - a) ** 2) * -np.expm1(-2.0 * x * a) / (a * _ROOT_2_PI)
    return np.maximum(ndtr(x - a) - ndtr(-(x + a)) - bulge, 0.0)


@lru_cache(maxsize=100_000)
def size_at(x: float, probability: float) -> float:
    """Return the size at which a reading of at most ``x`` has this probability; 0 if none has.

    With 0.05 an upper limit on the size, with 0.95 a lower limit, each at 95 % confidence.
    """
    if reading_below(x, 0.0) <= probability:
        return 0.0
    high = x + 1.0
    while reading_below(x, high) > probability:
        high += 1.0
    return brentq(lambda a: reading_below(x, a) - probability, 0.0, high, xtol=1e-14, rtol=1e-14)


def visit_mm(size_mm: np.ndarray | float, arm_mm: np.ndarray | float) -> np.ndarray:
    """Return the size that 95 % of visits to poses of mean errors ``size_mm`` do not exceed.

    arm_mm: standard deviation of a visit per axis, equal in all. Grows with the size and with the
    noise, so limits on these bring limits on it. NaN for a size that is not known.
    """
    from scipy.special import chndtrix, ndtri

    size, arm = np.broadcast_arrays(np.asarray(size_mm, float), np.asarray(arm_mm, float))
    ratio = size / np.where(arm > 0.0, arm, 1.0)
    beyond = np.sqrt(chndtrix(VISITS, 3.0, np.minimum(ratio, _FAR) ** 2))
    return size + arm * np.where(
        ratio < _FAR, beyond - ratio, ndtri(VISITS) + 1.0 / np.maximum(ratio, 1.0)
    )


def largest_size(mean_mm: np.ndarray, covariance_mm2: np.ndarray, deviations: float) -> float:
    """Return the largest |x| with (x - mean)' S^-1 (x - mean) <= deviations^2, mm.

    With the one-sided normal quantile for ``deviations`` it is an upper limit on the size of the
    true error: along the true error's own direction the reading is normal, and the largest value
    over all directions is at least the one along it.
    """
    variance, axes = np.linalg.eigh(covariance_mm2)
    top, y = float(variance[-1]), axes.T @ mean_mm
    # Off the plane across the widest axis by a billionth, where the farthest point is not unique.
    y[-1] = math.copysign(max(abs(y.item(2)), 1e-9 * math.sqrt(top)), y.item(2))
    # x_i = t y_i / (t - s_i), for the t above the largest variance that meets the boundary.
    weight, below = variance * y * y, top - variance

    def excess(gap: float) -> float:
        return float(np.sum(weight / (gap + below) ** 2)) - deviations * deviations

    low, high = math.sqrt(weight.item(2)) / deviations, math.sqrt(weight.sum()) / deviations
    gap = brentq(excess, 0.999999 * low, 1.000001 * high, xtol=1e-14 * low, rtol=1e-14)
    return float(np.linalg.norm((top + gap) * y / (gap + below)))


class BallDistances:
    """Mahalanobis distances from readings to the nearest points of balls of any radius.

    means_mm: (n, 3); covariances_mm2: (n, 3, 3). The nearest point replaces the candidate of
    eq. 21, which it is only where the covariance is a multiple of the identity. To minimise
    (x - y)' S^-1 (x - y) over |x| <= radius is a convex problem: x = (I + t S)^-1 y with t >= 0
    where |x| meets the radius. Newton's method on 1/|x| - 1/radius, which is concave in t, climbs
    to the root from t = 0 without overshooting.
    """

    def __init__(self, means_mm: np.ndarray, covariances_mm2: np.ndarray) -> None:
        self._variance, axes = np.linalg.eigh(covariances_mm2)
        self._y = np.einsum("nji,nj->ni", axes, means_mm)
        self.size_mm = np.linalg.norm(self._y, axis=1)

    def beyond(self, radius_mm: float) -> np.ndarray:
        """Return the distances (n,) to the ball of this radius; 0 inside."""
        y, variance, t = self._y, self._variance, np.zeros(len(self._y))
        if radius_mm <= 0.0:
            return np.sqrt(np.sum(y * y / variance, axis=1))
        for _ in range(100):
            spread = 1.0 + t[:, None] * variance
            square = np.sum((y / spread) ** 2, axis=1)
            slope = np.sum((y / spread) ** 2 * variance / spread, axis=1)
            step = square / np.maximum(slope, 1e-300) * (np.sqrt(square) - radius_mm) / radius_mm
            t += np.maximum(step, 0.0)
            if np.all(step <= 1e-13 * t):
                break
        # y - x = t S x, so the squared distance is t^2 x' S x.
        return t * np.sqrt(np.sum((y / (1.0 + t[:, None] * variance)) ** 2 * variance, axis=1))
