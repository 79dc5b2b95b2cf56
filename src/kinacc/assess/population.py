"""What measured points tell of all: the largest error as a random quantity, and limits on counts.

Empirical Bayes: the density of the true sizes is a mixture of smooth bumps of fixed relative width
whose weights are fitted to the readings by maximum likelihood (EM). Given it, every point's true
size has a posterior, and so has the largest.
It gives values, not guarantees: it can raise an upper bound, never lower one.
"""

from __future__ import annotations

import numpy as np

_FREEDOM = 10  # a bump is a chi density with so many degrees: 23 % standard deviation
_STEP = 0.2  # distance of bumps in the logarithm of their scale
_SMALLEST, _LARGEST = 0.03, 0.8  # scales of the first and last bump over the largest reading
_ROUNDS = 50  # EM steps; many more would follow the noise of the readings
_NO_SIZE = 1e-12  # of the noise: what readings below it count as
_PSEUDO = 0.2  # points' worth of mass spread over the bumps before any reading


def likely_largest_mm(
    sizes_mm: np.ndarray, noise_mm: np.ndarray, unmeasured: int
) -> tuple[float, float]:
    """Posterior median of the largest true size, among measured points and among all, mm.

    sizes_mm: (n,) sizes of mean readings; noise_mm: (n,) their standard deviations per axis;
    unmeasured: number of points without a reading, taken as drawn from the same population.
    Sizes go with the largest reading: where every reading is 0, so is every size.
    """
    top = float(sizes_mm.max())
    if top == 0.0:
        return 0.0, 0.0
    scale = top * np.exp(np.arange(np.log(_SMALLEST), np.log(_LARGEST), _STEP))
    # Sizes, fine up to a little above the largest reading and wider beyond.
    wide = np.geomspace(1.2 * top, 4.0 * top, 61)[1:]
    edges = np.concatenate([np.linspace(0.0, 1.2 * top, 361), wide])
    size, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    bumps = _chi_density(size, scale / np.sqrt(_FREEDOM)) * width
    bumps /= bumps.sum(axis=1, keepdims=True)
    likelihood = reading_densities(sizes_mm[:, None], noise_mm[:, None], size)
    by_bump = likelihood @ bumps.T
    pseudo = _PSEUDO / scale.size
    weight = np.full(scale.size, 1.0 / scale.size)
    for _ in range(_ROUNDS):
        # Every point's shares in the bumps, each in proportion to by_bump * weight, summed.
        weight = weight * ((1.0 / (by_bump @ weight)) @ by_bump) + pseudo
        weight /= weight.sum()
    prior = weight @ bumps
    posterior = np.cumsum(likelihood * prior, axis=1)
    measured = np.exp(np.log(np.maximum(posterior / posterior[:, -1:], 1e-300)).sum(axis=0))
    both = measured, measured * np.cumsum(prior) ** unmeasured
    among_measured, among_all = (float(np.interp(0.5, known / known[-1], size)) for known in both)
    return among_measured, among_all


def reading_densities(x: np.ndarray, noise: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Density (n, g) of readings of sizes x (n, 1) at true sizes (g,), up to a factor per reading.

    noise: (n, 1) standard deviations per axis; the largest value of every row is 1. Noncentral chi
    with three degrees of freedom: exp(-(x - a)^2 / 2) (1 - exp(-2 x a)) / a; of a reading of 0,
    what is left of the factor is in proportion to a.
    """
    gap = ((x - true) / noise) ** 2
    away = -np.expm1(-2.0 * np.maximum(x / noise, _NO_SIZE) * true / noise)
    density = np.exp(0.5 * (gap.min(axis=1, keepdims=True) - gap)) * away / true
    return density / density.max(axis=1, keepdims=True)


def _chi_density(size_mm: np.ndarray, unit_mm: np.ndarray) -> np.ndarray:
    """Chi densities (bumps, n) with units (bumps,), up to a factor per bump."""
    ratio = size_mm / unit_mm[:, None]
    log = (_FREEDOM - 1) * np.log(ratio) - 0.5 * ratio**2
    return np.exp(log - log.max(axis=1, keepdims=True))


def binomial_interval(hits: int, trials: int) -> tuple[float, float]:
    """Return two-sided 95 % limits on the probability of ``hits`` in ``trials``.

    References
    ----------
    Clopper and Pearson, Biometrika 26 (1934) 404-413.
    """
    from scipy.stats import binomtest

    low, high = binomtest(hits, trials).proportion_ci(0.95, "exact")
    return float(low), float(high)


def hardly_missed(points: int, error: float) -> int:
    """Return the number of random points that hold the largest of ``points`` but for ``error``."""
    return next(drawn for drawn in range(points + 1) if points - drawn <= error * points)


def excepted(points: int, drawn: int, error: float) -> int:
    """Return the K that all but K points are no larger than the largest of ``drawn`` random ones.

    But for probability ``error``, whatever their errors are: K + 1 points are all missed with
    probability C(points - K - 1, drawn) / C(points, drawn).
    """
    missed, number = (points - drawn) / points, 0
    while missed > error:
        number += 1
        missed *= max(points - drawn - number, 0) / (points - number)
    return number
