"""The largest error as a random quantity, points taken as a sample of one population of sizes.

Empirical Bayes: the density of the true sizes is a mixture of smooth bumps of fixed relative width
whose weights are fitted to the readings by maximum likelihood (EM). Given it, every point's true
size has a posterior, and so has the largest.
It gives values, not guarantees: it can raise an upper bound, never lower one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_FREEDOM = 10  # a bump is a chi density with so many degrees: 23 % standard deviation
_STEP = 0.2  # distance of bumps in the logarithm of their scale
_SMALLEST, _LARGEST = 0.03, 0.8  # scales of the first and last bump over the largest reading
_ROUNDS = 50  # EM steps; many more would follow the noise of the readings
_PSEUDO = 0.2  # points' worth of mass spread over the bumps before any reading


class LargestSize(NamedTuple):
    """Distribution of the largest size on a grid of sizes (mm): distribution functions (n,)."""

    size_mm: np.ndarray
    measured: np.ndarray
    everywhere: np.ndarray

    def quantile_mm(self, probability: float, measured_only: bool = False) -> float:
        """Size the largest is at most with this probability."""
        known = self.measured if measured_only else self.everywhere
        return float(np.interp(probability, known, self.size_mm))


def largest_size(sizes_mm: np.ndarray, noise_mm: np.ndarray, unmeasured: int) -> LargestSize:
    """Posterior of the largest true size, among measured points and among all.

    sizes_mm: (n,) sizes of mean readings; noise_mm: (n,) their standard deviations per axis;
    unmeasured: number of points without a reading, taken as drawn from the same population.
    Sizes go with the largest reading: where every reading is 0, so is every size.
    """
    # Compiled code, which only statements need: a reading is recorded without.
    from kinacc.assess.size_kernels import reading_densities

    top = float(sizes_mm.max())
    if top == 0.0:
        return LargestSize(np.zeros(1), np.ones(1), np.ones(1))
    scale = top * np.exp(np.arange(np.log(_SMALLEST), np.log(_LARGEST), _STEP))
    size, width = _grid(top)
    bumps = _chi_density(size, scale / np.sqrt(_FREEDOM)) * width
    bumps /= bumps.sum(axis=1, keepdims=True)
    likelihood = reading_densities(sizes_mm, noise_mm, size)
    by_bump = likelihood @ bumps.T
    pseudo = _PSEUDO / scale.size
    weight = np.full(scale.size, 1.0 / scale.size)
    for _ in range(_ROUNDS):
        # Every point's shares in the bumps, each in proportion to by_bump * weight, summed.
        weight = weight * ((1.0 / (by_bump @ weight)) @ by_bump) + pseudo
        weight /= weight.sum()
    prior = weight @ bumps
    # In the memory of the likelihood: arrays so large are slow to get from the system.
    posterior = np.multiply(likelihood, prior, out=likelihood)
    np.cumsum(posterior, axis=1, out=posterior)
    posterior /= posterior[:, -1:].copy()
    np.log(np.maximum(posterior, 1e-300, out=posterior), out=posterior)
    measured = np.exp(posterior.sum(axis=0))
    everywhere = measured * np.cumsum(prior) ** unmeasured
    return LargestSize(size, _rising(measured), _rising(everywhere))


def _rising(distribution: np.ndarray) -> np.ndarray:
    """Strictly increasing to 1, for interpolation."""
    return np.maximum.accumulate(distribution / distribution[-1]) + 1e-15 * np.arange(
        distribution.size
    )


def _grid(top_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Sizes, fine up to a little above the largest reading and wider beyond, and their widths."""
    fine = np.linspace(0.0, 1.2 * top_mm, 361)
    wide = np.geomspace(1.2 * top_mm, 4.0 * top_mm, 61)[1:]
    edges = np.concatenate([fine, wide])
    return 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)


def _chi_density(size_mm: np.ndarray, unit_mm: np.ndarray) -> np.ndarray:
    """Chi densities (bumps, n) with units (bumps,), up to a factor per bump."""
    ratio = size_mm / unit_mm[:, None]
    log = (_FREEDOM - 1) * np.log(ratio) - 0.5 * ratio**2
    return np.exp(log - log.max(axis=1, keepdims=True))
