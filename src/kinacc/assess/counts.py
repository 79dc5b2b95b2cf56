"""Limits on a probability from counted successes, and who can have been missed by a sample."""

from __future__ import annotations

from itertools import count

_CONFIDENCE = 0.95


def binomial_interval(hits: int, trials: int) -> tuple[float, float]:
    """Return two-sided 95 % limits on the probability of ``hits`` in ``trials``.

    References
    ----------
    Clopper and Pearson, Biometrika 26 (1934) 404-413.
    """
    from scipy.special import betaincinv

    half = 0.5 * (1.0 - _CONFIDENCE)
    low = 0.0 if hits == 0 else float(betaincinv(hits, trials - hits + 1, half))
    high = 1.0 if hits == trials else float(betaincinv(hits + 1, trials - hits, 1.0 - half))
    return low, high


def hardly_missed(points: int, error: float) -> int:
    """Return the number of random points that hold the largest of ``points`` but for ``error``."""
    return next(drawn for drawn in range(points + 1) if points - drawn <= error * points)


def companions(points: int, drawn: int, error: float) -> int:
    """Return the number of points of which one is among ``seen`` of ``points`` but for ``error``.

    The ``seen`` are drawn at random without replacement: all of n are missed with probability
    C(points - n, seen) / C(points, seen).
    """
    missed = 1.0
    for number in count(1):
        missed *= max(points - drawn - number + 1, 0) / (points - number + 1)
        if missed <= error:
            break
    return number


def excepted(points: int, drawn: int, error: float) -> int:
    """Return the K that all but K points are no larger than the largest of ``seen`` random ones.

    But for probability ``error``, whatever their errors are.
    """
    return companions(points, drawn, error) - 1
