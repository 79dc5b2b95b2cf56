"""Limits on the size of an error, for the few of a campaign; ``size_kernels`` compiles them.

Loading the compiler takes 0.25 s, a limit here 0.02 ms. Sizes are in units of the noise's standard
deviation per axis. The size x of a reading at a point of true size a is noncentral chi distributed
with three degrees of freedom (eq. 9).
"""

from __future__ import annotations

import math

_ROOT_HALF = math.sqrt(0.5)
_ROOT_2_PI = math.sqrt(2.0 * math.pi)
_TINY = 1e-4  # sizes below it count as zero; the error this makes is below 1e-9


def reading_below(x: float, a: float) -> float:
    """Probability that a reading at a point of size ``a`` has at most size ``x``."""
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
