"""Nearest and farthest points of ellipsoids: exact limits where the noise differs by direction."""

from __future__ import annotations

import math

import numpy as np

_STEPS = 100


def largest_size(mean_mm: np.ndarray, covariance_mm2: np.ndarray, deviations: float) -> float:
    """Largest |x| with (x - mean)' S^-1 (x - mean) <= deviations^2, mm.

    With the one-sided normal quantile for ``deviations`` it is an upper limit on the size of the
    true error: along the true error's own direction the reading is normal, and the largest value
    over all directions is at least the one along it.
    """
    variance, axes = np.linalg.eigh(covariance_mm2)
    y = axes.T @ mean_mm
    top = float(variance[-1])
    # x_i = t y_i / (t - s_i) for the t above the largest variance that meets the boundary.
    weight = variance * y * y
    wanted = deviations * deviations
    parts = list(zip(weight.tolist(), variance.tolist(), strict=True))
    low, high = top, top + math.sqrt(3.0 * float(weight.max())) / deviations + 1e-300
    while _squared_steps(parts, high) > wanted:
        high = top + 2.0 * (high - top)
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if _squared_steps(parts, middle) > wanted:
            low = middle
        else:
            high = middle
    gap = high - variance
    free = gap <= 1e-9 * top
    step = np.where(free, 0.0, variance * y / np.where(free, 1.0, gap))
    if free.any():
        # Hardly any component of the mean along the widest axes: the boundary decides how far.
        left = max(wanted - float(np.sum(step * step / variance)), 0.0)
        along = np.where(free, y, 0.0)
        if not along.any():
            along[-1] = 1.0
        step += along * math.sqrt(left * top / float(along @ along))
    x = y + step
    return math.sqrt(float(x @ x))


def _squared_steps(parts: list[tuple[float, float]], t: float) -> float:
    """Sum of weight / (t - variance)^2, in plain numbers: three are too few for arrays to pay."""
    total = 0.0
    for weight, variance in parts:
        square = (t - variance) * (t - variance)
        if square > 0.0:
            total += weight / square
        else:
            total += math.inf if weight > 0.0 else math.nan
    return total


class BallDistances:
    """Mahalanobis distances from readings to the nearest points of balls of any radius.

    means_mm: (n, 3); covariances_mm2: (n, 3, 3). The nearest point replaces the candidate of
    eq. 21, which it is only where the covariance is a multiple of the identity. To minimise
    (x - y)' S^-1 (x - y) over |x| <= radius is a convex problem: x = (I + t S)^-1 y with t >= 0
    where |x| meets the radius. Newton's method on 1/|x| - 1/radius, which is concave in t, climbs
    to the root from t = 0 without overshooting.
    """

    def __init__(self, means_mm: np.ndarray, covariances_mm2: np.ndarray) -> None:
        self.variance, axes = np.linalg.eigh(covariances_mm2)
        self.y = np.einsum("nji,nj->ni", axes, means_mm)
        self.size_mm = np.sqrt(np.sum(self.y**2, axis=1))

    def beyond(self, radius_mm: float) -> np.ndarray:
        """Distances (n,) to the ball of this radius; 0 inside."""
        distance = np.zeros(len(self.y))
        outside = np.flatnonzero(self.size_mm > radius_mm)
        if not outside.size:
            return distance
        y, variance = self.y[outside], self.variance[outside]
        if radius_mm <= 0.0:
            distance[outside] = np.sqrt(np.sum(y * y / variance, axis=1))
            return distance
        t = np.zeros(outside.size)
        for _ in range(_STEPS):
            factor = 1.0 / (1.0 + t[:, None] * variance)
            shrunk = y * factor
            square = np.sum(shrunk**2, axis=1)
            slope = np.sum(shrunk**2 * variance * factor, axis=1)
            step = np.maximum(square / slope * (np.sqrt(square) - radius_mm) / radius_mm, 0.0)
            t += step
            if np.all(step <= 1e-13 * t):
                break
        # y - x = t S x, so the squared distance is t^2 x' S x.
        shrunk = y / (1.0 + t[:, None] * variance)
        distance[outside] = t * np.sqrt(np.sum(shrunk**2 * variance, axis=1))
        return distance
