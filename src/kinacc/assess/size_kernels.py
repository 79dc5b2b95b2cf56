"""Compiled limits on the size of an error from the size of a reading with equal noise per axis.

Sizes are in units of the noise's standard deviation per axis. The size x of a reading at a point
of true size a is noncentral chi distributed with three degrees of freedom (eq. 9).
"""

from __future__ import annotations

import math

import numpy as np

from kinacc.compiled import compiled

_ROOT_HALF = math.sqrt(0.5)
_ROOT_2_PI = math.sqrt(2.0 * math.pi)
_TINY = 1e-4  # sizes below it count as zero; the error this makes is below 1e-9


@compiled
def reading_below(x, a):
    """Probability that a reading at a point of size ``a`` has at most size ``x``."""
    if x <= 0.0:
        return 0.0
    if a < _TINY:
        return math.erf(x * _ROOT_HALF) - 2.0 / _ROOT_2_PI * x * math.exp(-0.5 * x * x)
    near, far = x - a, x + a
    tails = 0.5 * (math.erfc(-near * _ROOT_HALF) - math.erfc(far * _ROOT_HALF))
    bulge = (math.exp(-0.5 * near * near) - math.exp(-0.5 * far * far)) / (a * _ROOT_2_PI)
    return max(tails - bulge, 0.0)


@compiled
def size_at(x, probability):
    """The size at which a reading of at most ``x`` has this probability; 0 if none is as likely.

    With 0.05 an upper limit on the size, with 0.95 a lower limit, each at 95 % confidence.
    """
    if reading_below(x, 0.0) <= probability:
        return 0.0
    low, high = 0.0, x + 1.0
    while reading_below(x, high) > probability:
        high += 1.0
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if reading_below(x, middle) > probability:
            low = middle
        else:
            high = middle
    return high


@compiled
def reading_densities(x, noise, true):
    """Density (n, g) of readings of size ``x`` (n,) at true sizes (g,), up to a factor per reading.

    noise: (n,) standard deviations per axis; the largest value of every row is 1. Noncentral chi
    with three degrees of freedom: exp(-(x - a)^2 / 2) (1 - exp(-2 x a)) / a.
    """
    rows, columns = x.size, true.size
    found = np.zeros((rows, columns))
    log = np.empty(columns)
    for i in range(rows):
        best = -np.inf
        for j in range(columns):
            gap, product = (x[i] - true[j]) / noise[i], 2.0 * x[i] * true[j] / noise[i] ** 2
            log[j] = -0.5 * gap * gap - math.log(true[j])
            if product < 40.0:
                log[j] += math.log(-math.expm1(-product) + 1e-300)
            best = max(best, log[j])
        for j in range(columns):
            if log[j] - best > -60.0:
                found[i, j] = math.exp(log[j] - best)
    return found
