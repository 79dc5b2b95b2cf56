"""Ridge regression at several widths of one prior, each with the residual variance it leaves.

Steps and what they leave depend on variance and prior through their ratio alone. An orthogonal
reduction of the normal matrix to three diagonals, a quarter of an eigendecomposition, serves all
ratios: each is then solved for in as many operations as there are unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

_VARIANCE_STEPS = 40
_VARIANCE_TOLERANCE = 1e-4
_LEAST_SHARE = 1e-6  # of the mean squared misfit, where the residual variance starts
_ROUNDING = 1e-14  # of the trace of a normal matrix: what rounding makes of a direction unseen


def steps(normal: np.ndarray, freedom: int, std: np.ndarray) -> np.ndarray:
    """Steps (n, c) under priors of ``std`` (c,) at the residual variances they leave.

    ``normal`` (n + 1, n + 1), in order of rows and overwritten: the Gram matrix of ``[r | J]`` of
    linear least squares. ``freedom``: number of residuals less that of parameters without a prior.
    """
    reduced = _Reduced.of(normal)
    variance = np.full(len(std), _LEAST_SHARE * reduced.cost / max(freedom, 1))
    going, found = np.ones(len(std), dtype=bool), np.zeros((len(std), len(reduced.diagonal)))
    for _ in range(_VARIANCE_STEPS):
        held = np.maximum(variance[going] / std[going] ** 2, reduced.least)
        step, effective = reduced.at(held)
        left = reduced.cost + reduced.slope * step[:, 0] - held * np.sum(step**2, axis=1)
        found[going] = step
        after = np.maximum(left, 0.0) / np.maximum(freedom - effective, 1.0)
        before = variance[going]
        moved = np.abs(after - before) > _VARIANCE_TOLERANCE * before
        variance[going] = np.where(moved, after, before)
        going[going] = moved
        if not going.any():
            break
    return reduced.turned_back(found.T)


@dataclass(frozen=True)
class _Reduced:
    """A normal matrix as ``diagonal`` (n,) and ``beside`` (n-1,) it, in an orthogonal basis.

    Its first direction is that of the gradient, of length ``slope``. ``cost``: at no step;
    ``least``: shift below which rounding decides.
    """

    diagonal: np.ndarray
    beside: np.ndarray
    slope: float
    cost: float
    least: float
    reflectors: np.ndarray
    scales: np.ndarray

    @classmethod
    def of(cls, normal: np.ndarray) -> _Reduced:
        size = len(normal)
        lwork = int(scipy.linalg.lapack.dsytrd_lwork(size, lower=1)[0])
        full, diagonal, beside, scales, info = scipy.linalg.lapack.dsytrd(
            normal.T, lower=1, lwork=lwork, overwrite_a=1
        )
        _require(info)
        # Reflectors begin below the diagonal: the same numbers, read from one farther on.
        begun = full.ravel(order="K")[1 : 1 + size * (size - 1)]
        reflectors = begun.reshape((size, size - 1), order="F")
        cost, slope = float(diagonal[0]), float(beside[0])
        least = max(_ROUNDING * float(diagonal[1:].sum()), np.finfo(float).tiny)
        # What was taken off the matrix before it came here may have left more rounding than that.
        while scipy.linalg.lapack.dpttrf(diagonal[1:] + least, beside[1:])[2] > 0:
            least *= 10.0
        return cls(diagonal[1:], beside[1:], slope, cost, least, reflectors, scales)

    def at(self, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps (c, n), in the basis, and effective numbers of parameters (c,) at ``held`` (c,)."""
        shape = len(held), len(self.diagonal)
        # One band matrix of all: what links one to the next is zero.
        beside = np.zeros(shape)
        beside[:, :-1] = self.beside
        diagonal = (self.diagonal + held[:, None]).ravel()
        pivots, below, info = scipy.linalg.lapack.dpttrf(
            diagonal, beside.ravel()[:-1], overwrite_d=1
        )
        _require(info)
        gradient = np.zeros(shape)
        gradient[:, 0] = -self.slope
        step, info = scipy.linalg.lapack.dpttrs(pivots, below, gradient.ravel(), overwrite_b=1)
        _require(info)
        # The derivative of the pivots by the shift: that of the log determinant is the trace of
        # the inverse.
        links = np.ones((2, len(pivots)), order="F")
        np.multiply(below, -below, out=links[1, :-1])
        slopes, info = scipy.linalg.lapack.dtbtrs(links, np.ones(len(pivots)), uplo="L", diag="U")
        _require(info)
        traces = np.sum((slopes.ravel() / pivots).reshape(shape), axis=1)
        return step.reshape(shape), shape[1] - held * traces

    def turned_back(self, steps: np.ndarray) -> np.ndarray:
        """``steps`` (n, c) out of the basis."""
        work = 64 * steps.shape[1] + 65 * 64
        found, _, info = scipy.linalg.lapack.dormqr(
            "L", "N", self.reflectors, self.scales, np.array(steps, order="F"), work, overwrite_c=1
        )
        _require(info)
        return found


def _require(info: int) -> None:
    if info:
        raise ValueError(f"a routine of LAPACK returned {info}")
