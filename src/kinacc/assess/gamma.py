"""The gamma distribution under the name of its use here; see :mod:`kinacc.gamma`."""

from __future__ import annotations

from kinacc.gamma import GammaFit, fit, gamma99, quantile

__all__ = ["GammaFit", "fit", "gamma99", "quantile"]
