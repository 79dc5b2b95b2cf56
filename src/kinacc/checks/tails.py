"""How far out a value may lie before it is no longer one of the others.

Errors of a kinematic model are not normal: a few configurations are worse than the rest. A limit is
therefore the quantile of a multivariate t distribution whose median and 90 % quantile are those of
the values themselves, at a family-wise error rate: one good file in a hundred has a value beyond
the limit. Never lighter tails than ten degrees of freedom: nothing measured is known to be normal.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy

FAMILY_WISE = 0.01
ROUNDING = 1e-6  # mm and rad: what is nearer is equal, as readings without noise are
_FREEDOM = np.linspace(10.0, 4.0, 2001)  # degrees from light tails to heavy ones
_BULK = 0.9
_APART = 1.25  # of the next: what is less makes no difference to the largest


def limit(lengths: np.ndarray, dimensions: int, count: int | None = None) -> float:
    """Largest length to be expected among ``count`` vectors (as many as ``lengths`` if None).

    ``lengths`` (m,), mm or rad, of vectors of ``dimensions`` components about their own centre.
    """
    lengths = lengths[np.isfinite(lengths)]
    if lengths.size == 0:
        return np.inf
    middle, outer = np.quantile(lengths, [0.5, _BULK])
    count = lengths.size if count is None else count
    if middle <= 0.0:
        return np.inf
    freedom: np.ndarray = np.interp(outer / middle, _ratios(dimensions), _FREEDOM)
    tail = _length(1.0 - FAMILY_WISE / max(count, 1), dimensions, freedom)
    return max(float(middle * tail / _length(0.5, dimensions, freedom)), ROUNDING)


def detached(lengths: np.ndarray) -> int:
    """How many of the largest ``lengths`` (m,) stand apart from all the others.

    Gaps between the largest values of an exponential tail are independent: the k-th gap times k is
    exponential with the tail's mean excess (Renyi 1953), so over the mean excess of the m values
    behind it, it has the distribution F(2, 2m). Lighter tails have smaller gaps. 0 where none
    stands apart, by as much as ``_APART``, or there are too few.
    """
    ordered = np.sort(lengths[np.isfinite(lengths)])[::-1]
    tail = ordered.size // 10
    most = min(tail // 3, 10)
    for count in range(most, 0, -1):
        rest = ordered[count : count + tail + 1]
        excess = float(np.mean(rest[:-1] - rest[-1]))
        gap = ordered[count - 1] - ordered[count]
        chance = (1.0 + count * gap / (tail * excess)) ** -tail if excess > 0.0 else 1.0
        if chance < FAMILY_WISE / most and ordered[count - 1] > _APART * ordered[count] + ROUNDING:
            return count
    return 0


@cache
def _ratios(dimensions: int) -> np.ndarray:
    """The bulk quantile in medians, for every one of ``_FREEDOM``."""
    return _length(_BULK, dimensions, _FREEDOM) / _length(0.5, dimensions, _FREEDOM)


def _length(probability: float, dimensions: int, freedom: np.ndarray) -> np.ndarray:
    """Quantile of the length of a standard t vector."""
    return np.sqrt(dimensions * scipy.special.fdtri(dimensions, freedom, probability))
