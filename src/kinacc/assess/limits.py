"""Upper and lower limits on the size of one point's error, from its averaged reading."""

from __future__ import annotations

import math

import numpy as np

from kinacc.assess import plain_sizes

_FEW = 5000  # sizes of one process that take less than loading the compiler does
_asked = 0


def upper_limit_mm(mean_mm: np.ndarray, noise: float | np.ndarray, error: float) -> float:
    """Size that the true error exceeds with probability at most ``error``, whatever it is.

    mean_mm: (3,) average of readings; noise: its standard deviation per axis (mm), or its
    covariance (3, 3), mm^2. Equal noise per axis: the noncentral chi limit. Unequal: the farthest
    point of an ellipsoid, a little wider.
    """
    if isinstance(noise, float):
        return noise * _size_at(_size(mean_mm) / noise, error)
    from scipy.special import ndtri

    from kinacc.assess.ellipsoid import largest_size

    return largest_size(mean_mm, noise, -float(ndtri(error)))


def lower_limit_mm(mean_mm: np.ndarray, noise: float | np.ndarray, error: float) -> float:
    """Size that the true error falls below with probability at most ``error``, whatever it is."""
    if isinstance(noise, float):
        return noise * _size_at(_size(mean_mm) / noise, 1.0 - error)
    from scipy.special import chdtri

    from kinacc.assess.ellipsoid import mahalanobis_beyond

    # The true error lies in this ellipsoid with the confidence asked for; take its smallest size.
    # An error of any size outside is rejected whatever its direction.
    wanted = math.sqrt(float(chdtri(3, error)))
    low, high = 0.0, _size(mean_mm)
    if mahalanobis_beyond(mean_mm, noise, 0.0) <= wanted:
        return 0.0
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        if mahalanobis_beyond(mean_mm, noise, middle) > wanted:
            low = middle
        else:
            high = middle
    return low


def _size(vector: np.ndarray) -> float:
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


def _size_at(x: float, probability: float) -> float:
    """As :func:`plain_sizes.size_at`, by the same digits, compiled where many are asked for."""
    global _asked
    _asked += 1
    if _asked <= _FEW:
        return plain_sizes.size_at(x, probability)
    from kinacc.assess.size_kernels import size_at

    return size_at(x, probability)
