"""Two-parameter gamma distribution, location 0, by maximum likelihood: the paper's "99 % gamma"."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from kinacc.errors import input_error

# Below this gap between the logarithm of the mean and the mean logarithm (a relative spread near
# 1e-6) rounding decides the shape: the sample counts as one repeated value.
_LEAST_GAP = 1e-12


class GammaFit(NamedTuple):
    """Gamma distribution with location 0.

    Attributes
    ----------
    shape : float
        Shape k, without unit; infinite for a sample of one repeated value.
    scale : float
        Scale, in the unit of the sample; 0 for a sample of one repeated value.
    mean : float
        Mean of the sample, in its unit.
    """

    shape: float
    scale: float
    mean: float


def fit(magnitudes: ArrayLike) -> GammaFit:
    """Fit a gamma distribution with location 0 by maximum likelihood.

    The shape k solves ``log k - digamma(k) = log mean(x) - mean(log x)``; the scale is mean / k.

    Parameters
    ----------
    magnitudes : array_like
        Sample, shape (n,), n >= 1, any unit.

    Returns
    -------
    GammaFit
        The fitted distribution.

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
    mean = float(x.mean())
    # Relative to the mean, so that nothing depends on the unit.
    gap = -float(np.log(x / mean).mean())
    if gap < _LEAST_GAP:
        return GammaFit(np.inf, 0.0, mean)
    shape = float(scipy.stats.gamma.fit(x / mean, floc=0.0)[0])
    return GammaFit(shape, mean / shape, mean)


def quantile(fitted: GammaFit, probability: float) -> float:
    """Quantile of a fitted gamma distribution.

    Parameters
    ----------
    fitted : GammaFit
        The distribution.
    probability : float
        Probability, 0 to 1.

    Returns
    -------
    float
        The quantile, in the unit of the sample.
    """
    if np.isinf(fitted.shape):
        return fitted.mean
    return float(scipy.special.gammaincinv(fitted.shape, probability) * fitted.scale)


def gamma99(magnitudes: ArrayLike) -> float:
    """99 % quantile of the gamma distribution fitted to a sample: the paper's "99 % gamma".

    Parameters
    ----------
    magnitudes : array_like
        Sample, shape (n,), any unit, all above 0.

    Returns
    -------
    float
        The quantile, in the unit of the sample.

    Raises
    ------
    InputError
        As ``fit``.
    """
    return quantile(fit(magnitudes), 0.99)
