"""Figures that gates are about, and chance, worked out by hand: sorted lists and many resamples."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy import optimize, special


def quantile(values: Sequence[float], share: float) -> float:
    """Empirical quantile: between the two values next to rank ``share`` of the way, by a line."""
    ordered = sorted(values)
    place = share * (len(ordered) - 1)
    below = math.floor(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def gamma_quantile(values: Sequence[float], share: float) -> float:
    """Quantile of the gamma distribution whose likelihood of the values is the largest."""
    mean = math.fsum(values) / len(values)
    spread = math.log(mean) - math.fsum(math.log(each) for each in values) / len(values)
    shape = optimize.brentq(lambda k: math.log(k) - special.digamma(k) - spread, 1e-3, 1e9)
    return float(special.gammaincinv(shape, share)) * mean / shape


def statistics(values: Sequence[float]) -> dict[str, float]:
    """Every figure of errors by the last word of its name."""
    return {
        "mean": math.fsum(values) / len(values),
        "rms": math.sqrt(math.fsum(each * each for each in values) / len(values)),
        "p99": quantile(values, 0.99),
        "p99_gamma": gamma_quantile(values, 0.99),
        "largest": max(values),
    }


def resampled_differences(
    before: np.ndarray, after: np.ndarray, of_pose: np.ndarray, times: int, seed: int
) -> np.ndarray:
    """Differences of means (times,) over poses drawn again, errors (n,) of one pose together.

    ``before`` and ``after`` are of the same rows: a pose that is drawn is drawn for both.
    """
    draw = np.random.default_rng(seed)
    poses = [np.flatnonzero(of_pose == each) for each in np.unique(of_pose)]
    found = []
    for _ in range(times):
        rows = np.concatenate([poses[i] for i in draw.integers(0, len(poses), len(poses))])
        found.append(np.mean(after[rows]) - np.mean(before[rows]))
    return np.array(found)
