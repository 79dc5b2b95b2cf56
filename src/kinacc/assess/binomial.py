"""Exact limits on a probability from counted successes."""

from __future__ import annotations


def binomial_interval(hits: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Two-sided limits on the probability of ``hits`` in ``trials`` (Clopper and Pearson)."""
    from scipy.special import betaincinv

    half = 0.5 * (1.0 - confidence)
    low = 0.0 if hits == 0 else float(betaincinv(hits, trials - hits + 1, half))
    high = 1.0 if hits == trials else float(betaincinv(hits + 1, trials - hits, 1.0 - half))
    return low, high
