"""Exact limits on a probability from counted successes."""

from __future__ import annotations

_CONFIDENCE = 0.95


def binomial_interval(hits: int, trials: int) -> tuple[float, float]:
    """Two-sided 95 % limits on the probability of ``hits`` in ``trials`` (Clopper and Pearson)."""
    from scipy.special import betaincinv

    half = 0.5 * (1.0 - _CONFIDENCE)
    low = 0.0 if hits == 0 else float(betaincinv(hits, trials - hits + 1, half))
    high = 1.0 if hits == trials else float(betaincinv(hits + 1, trials - hits, 1.0 - half))
    return low, high
