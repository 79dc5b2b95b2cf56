"""Two-parameter gamma distribution, location 0, by maximum likelihood: the paper's "99 % gamma"."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from kinacc.errors import input_error

# Below this gap between the logarithm of the mean and the mean logarithm (a relative spread near
# 1e-6) rounding decides the shape: the sample counts as one repeated value.
_LEAST_GAP = 1e-12


def gamma99(magnitudes: ArrayLike) -> float:
    """99 % quantile of the gamma distribution fitted to a sample: the paper's "99 % gamma".

    The shape k solves ``log k - digamma(k) = log mean(x) - mean(log x)``; the scale is mean / k.

    Parameters
    ----------
    magnitudes : array_like
        Sample, shape (n,), n >= 1, any unit, all above 0.

    Returns
    -------
    float
        The quantile, in the unit of the sample.

    Raises
    ------
    InputError
        For an empty sample and for values that are not finite or not above 0.
    """
    x = np.asarray(magnitudes, dtype=np.float64).ravel()
    if x.size == 0 or not np.all(np.isfinite(x)) or np.any(x <= 0.0):
        sample = "no values" if x.size == 0 else f"smallest {x.min():g}, largest {x.max():g}"
        raise input_error(
            "gamma fit",
            f"the likelihood has no maximum for this sample ({sample})",
            "at least one value, all finite and above 0",
            "leave out exact zeros or use another statistic",
        )
    # Relative to the mean, so that nothing depends on the unit.
    mean = float(x.mean())
    if -np.log(x / mean).mean() < _LEAST_GAP:
        return mean
    shape = float(scipy.stats.gamma.fit(x / mean, floc=0.0)[0])
    return float(scipy.special.gammaincinv(shape, 0.99) * mean / shape)
