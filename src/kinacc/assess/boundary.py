"""How far a point's mean may lie below its size at each look, so that no look misses by chance.

A point of size s has readings whose component along its true error is normal about s. The mean of
its first k readings is at least as long as that component. Where every look at k readings states
``|mean| + z_k sigma / sqrt(k)``, a statement below s therefore means that a Gaussian walk of k
steps lies below ``-z_k sqrt(k)``. Counts and z are fixed beforehand, so the chance that this ever
happens is that of the walk, whatever decides which looks are reached.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

_GROWTH = 1.25  # of the number of readings from look to look
_SECOND = 3  # readings at the second look: a block of two tells how readings scatter
_NEAR = 0.93  # of the last look: what comes later is left to it
EARLY = 0.15  # of the allowed error, spent on the first look whatever comes
LATE = 0.8  # power of the share of readings taken, with which the rest is spent
_NODES = 101  # of the walk's density; crossing probabilities are then exact to 1e-9
_FAR = 8.5  # standard deviations beyond which the walk has no density
_SCALES = 24  # nodes over the estimated standard deviation


@dataclass(frozen=True)
class Boundary:
    """Looks at ``counts`` (L,) readings, and standard deviations ``z`` (L,) of the mean at each.

    ``alone`` (L,): the same for looks that share the error without regard to their correlation,
    for points whose readings are not all of one covariance.
    """

    counts: np.ndarray
    z: np.ndarray
    alone: np.ndarray


def look_counts(extra: int) -> tuple[int, ...]:
    """Numbers of readings at which a point is looked at: 1, 3, then by a quarter, extra + 1."""
    last, found, count = extra + 1, [1], _SECOND
    while count < _NEAR * last:
        found.append(count)
        count = max(count + 2, math.ceil(count * _GROWTH))
    return tuple(found) if last == 1 else (*found, last)


@lru_cache(maxsize=256)
def boundary(
    counts: tuple[int, ...],
    error: float,
    freedom: float = math.inf,
    early: float = EARLY,
    late: float = LATE,
) -> Boundary:
    """The boundary that a walk crosses with probability ``error`` in all.

    The part ``early`` of the error is spent at once and the rest with the share of readings taken,
    raised to ``late``. With ``freedom`` the mean is held to ``z s / sqrt(k)``, s being one standard
    deviation estimated from so many degrees of freedom, common to all looks.
    """
    steps = spending(counts, error, early, late)
    z, alone = _by_spending(np.array(counts), steps), -_normal_quantile(steps)
    if math.isinf(freedom):
        return Boundary(np.array(counts), z, alone)
    import scipy

    wider = _widened(counts, z, error, freedom)
    return Boundary(np.array(counts), wider * z, -scipy.special.stdtrit(freedom, steps))


def spending(counts: tuple[int, ...], error: float, early: float, late: float) -> np.ndarray:
    """Parts (L,) of the error by look: ``early`` of it at once, the rest with readings taken."""
    share = np.array(counts, dtype=float) / counts[-1]
    return np.diff(error * (early + (1.0 - early) * share**late), prepend=0.0)


def crossing(counts: tuple[int, ...], z: np.ndarray, freedom: float = math.inf) -> float:
    """Probability that a Gaussian walk is below ``-z s sqrt(k)`` at any of ``counts`` (L,).

    By the density of walks that did not cross, from look to look (Armitage, McPherson and Rowe
    1969); with ``freedom`` averaged over the common s, whose square is chi-square over it.
    """
    at = np.array(counts)
    if math.isinf(freedom):
        return _crossed(at, np.asarray(z, dtype=float))
    scale, weight = _scales(freedom)
    return float(
        sum(w * _crossed(at, s * np.asarray(z)) for s, w in zip(scale, weight, strict=True))
    )


def _by_spending(counts: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """The z of every look whose chance of being the first to cross is ``steps``."""
    walk, found = _Walk.begun(int(counts[0]), -float(_normal_quantile(steps[0]))), []
    found.append(walk.z)
    for count, step in zip(counts[1:].tolist(), steps[1:].tolist(), strict=True):
        low, high = 0.0, 12.0
        while high - low > 1e-10:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if walk.crossed(count, middle) > step else (low, middle)
        walk = walk.carried(count, high)
        found.append(high)
    return np.array(found)


def _crossed(counts: np.ndarray, z: np.ndarray) -> float:
    from scipy.special import ndtr

    walk, total = _Walk.begun(int(counts[0]), float(z[0])), float(ndtr(-z[0]))
    for count, each in zip(counts[1:].tolist(), z[1:].tolist(), strict=True):
        total += walk.crossed(count, each)
        walk = walk.carried(count, each)
    return total


def _widened(counts: tuple[int, ...], z: np.ndarray, error: float, freedom: float) -> float:
    """The factor on all z that keeps the error where s is estimated."""
    low, high = 1.0, 1.0 + 20.0 / freedom
    while crossing(counts, high * z, freedom) > error:
        high = 1.0 + 2.0 * (high - 1.0)
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if crossing(counts, middle * z, freedom) > error else (low, middle)
        )
    return high


@lru_cache(maxsize=64)
def _scales(freedom: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of s and their weights, s^2 being chi-square over ``freedom``."""
    import scipy

    low, high = np.sqrt(scipy.special.chdtri(freedom, [1.0 - 1e-9, 1e-9]) / freedom)
    node, weight = _legendre(_SCALES)
    scale = 0.5 * (high - low) * node + 0.5 * (high + low)
    density = (freedom - 1.0) * np.log(scale) - 0.5 * freedom * scale**2
    mass = weight * np.exp(density - density.max())
    return scale, mass / mass.sum()


@lru_cache(maxsize=4)
def _legendre(count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.polynomial.legendre.leggauss(count)


def _normal_quantile(probability):
    from scipy.special import ndtri

    return ndtri(probability)


@dataclass(frozen=True)
class _Walk:
    """Density of a walk that did not cross, after ``count`` steps: ``mass`` at every ``place``."""

    count: int
    z: float
    place: np.ndarray
    mass: np.ndarray

    @classmethod
    def begun(cls, count: int, z: float) -> _Walk:
        place, weight = _places(count, z)
        density = np.exp(-0.5 * place**2 / count) / math.sqrt(2.0 * math.pi * count)
        return cls(count, z, place, weight * density)

    def crossed(self, count: int, z: float) -> float:
        """Probability of first being below the boundary after ``count`` steps."""
        from scipy.special import ndtr

        below = ndtr((-z * math.sqrt(count) - self.place) / math.sqrt(count - self.count))
        return float(np.sum(self.mass * below))

    def carried(self, count: int, z: float) -> _Walk:
        """The walk after ``count`` steps, as far as it is above the boundary there."""
        place, weight = _places(count, z)
        variance = count - self.count
        kernel = np.exp(-0.5 * (place[:, None] - self.place) ** 2 / variance)
        density = kernel @ self.mass / math.sqrt(2.0 * math.pi * variance)
        return _Walk(count, z, place, weight * density)


def _places(count: int, z: float) -> tuple[np.ndarray, np.ndarray]:
    node, weight = _legendre(_NODES)
    low, high = -z * math.sqrt(count), _FAR * math.sqrt(count)
    return 0.5 * (high - low) * node + 0.5 * (high + low), 0.5 * (high - low) * weight
