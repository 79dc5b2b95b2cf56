"""Upper and lower limits on the size of one point's error, from its averaged reading."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

_ROOT_HALF = math.sqrt(0.5)
_ROOT_2_PI = math.sqrt(2.0 * math.pi)
_TINY = 1e-4  # sizes below it count as zero; the error this makes is below 1e-9


def upper_limit_mm(mean_mm: np.ndarray, noise: float | np.ndarray, error: float) -> float:
    """Size that the true error exceeds with probability at most ``error``, whatever it is.

    mean_mm: (3,) average of readings; noise: its standard deviation per axis (mm), or its
    covariance (3, 3), mm^2. Equal noise per axis: the noncentral chi limit. Unequal: the farthest
    point of an ellipsoid, a little wider.
    """
    if isinstance(noise, float):
        return noise * size_at(_size(mean_mm) / noise, error)
    from scipy.special import ndtri

    from kinacc.assess.ellipsoid import largest_size

    return largest_size(mean_mm, noise, -float(ndtri(error)))


def lower_limit_mm(mean_mm: np.ndarray, noise: float | np.ndarray, error: float) -> float:
    """Size that the true error falls below with probability at most ``error``, whatever it is."""
    if isinstance(noise, float):
        return noise * size_at(_size(mean_mm) / noise, 1.0 - error)
    from scipy.special import chdtri

    from kinacc.assess.ellipsoid import BallDistances

    # The true error lies in this ellipsoid with the confidence asked for; take its smallest size.
    # An error of any size outside is rejected whatever its direction.
    wanted = math.sqrt(float(chdtri(3, error)))
    distances = BallDistances(np.asarray(mean_mm)[None], noise[None])
    if distances.beyond(0.0)[0] <= wanted:
        return 0.0
    size = _size(mean_mm)
    return brentq(lambda low: distances.beyond(low)[0] - wanted, 0.0, size, xtol=1e-12 * size)


def _size(vector: np.ndarray) -> float:
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


def reading_below(x: float, a: float) -> float:
    """Probability that a reading at a point of size ``a`` has at most size ``x``.

    Both in standard deviations of the noise per axis: noncentral chi, three degrees of freedom
    (eq. 9). SciPy's chndtr takes milliseconds beyond sizes of 1000, and fails beyond 100,000.
    """
    if x <= 0.0:
        return 0.0
    if a < _TINY:
        return math.erf(x * _ROOT_HALF) - 2.0 / _ROOT_2_PI * x * math.exp(-0.5 * x * x)
    near, far = x - a, x + a
    tails = 0.5 * (math.erfc(-near * _ROOT_HALF) - math.erfc(far * _ROOT_HALF))
    bulge = (math.exp(-0.5 * near * near) - math.exp(-0.5 * far * far)) / (a * _ROOT_2_PI)
    return max(tails - bulge, 0.0)


def size_at(x: float, probability: float) -> float:
    """The size at which a reading of at most ``x`` has this probability; 0 if none is as likely.

    With 0.05 an upper limit on the size, with 0.95 a lower limit, each at 95 % confidence.
    """
    if reading_below(x, 0.0) <= probability:
        return 0.0
    high = x + 1.0
    while reading_below(x, high) > probability:
        high += 1.0
    return brentq(lambda a: reading_below(x, a) - probability, 0.0, high, xtol=1e-14, rtol=1e-14)
