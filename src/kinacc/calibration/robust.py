"""Losses that lean less on rows far off, with a scale taken from the data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from kinacc.calibration.observations import Observations

SQUARES, HUBER, TUKEY = "squares", "huber", "tukey"
# Share of rows of Gaussian noise alone that lies beyond the bend: of one component those are the
# usual 1.345 and 4.685 standard deviations (95 % efficiency).
_BEYOND = {HUBER: 0.17863, TUKEY: 2.7995e-6}


@dataclass(frozen=True)
class Weights:
    """``row`` (n,) weights of the rows; ``scale_mm`` per component."""

    row: np.ndarray
    scale_mm: float


def weights(
    loss: str, residual: np.ndarray, observations: Observations, scale_mm: float | None = None
) -> Weights:
    """Weights of ``loss`` at whitened residuals (m,), one weight per row (target of a pose).

    A row's d components (3, or 6 with its orientation) are judged together by their length u. The
    scale is the median over rows of u divided by its value for unit Gaussian noise, the root of
    the median of chi-square with d degrees of freedom: half the rows may be off. Huber's weight is
    1 up to the bend and bend / u beyond, Tukey's (1 - (u / bend)^2)^2 and 0 beyond (Holland and
    Welsch, Communications in Statistics 6, 1977), with the bend where the same share of Gaussian
    noise lies beyond as for one component. ``scale_mm``: a scale held from before.
    """
    components = np.where(observations.has_rotation, 6, 3)
    row = np.repeat(np.arange(len(observations)), components)
    length = np.sqrt(np.bincount(row, residual**2, minlength=len(observations)))
    scale = scale_mm
    if scale is None:
        scale = float(np.median(length / np.sqrt(scipy.special.chdtri(components, 0.5))))
    bend = np.sqrt(scipy.special.chdtri(components, _BEYOND[loss])) * max(
        scale, np.finfo(float).tiny
    )
    share = length / bend
    if loss == HUBER:
        weight = 1.0 / np.maximum(share, 1.0)
    else:
        weight = np.maximum(1.0 - share**2, 0.0) ** 2
    return Weights(weight, scale)
