"""Ridge regression at several widths of one prior, each with the residual variance it leaves.

Steps and what they leave depend on variance and prior through their ratio alone. An orthogonal
reduction of the normal matrix to three diagonals, a quarter of an eigendecomposition, serves all
ratios: each is then solved for in as many operations as there are unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

_VARIANCE_STEPS = 40
_VARIANCE_TOLERANCE = 1e-4
_LEAST_SHARE = 1e-6  # of the mean squared misfit, where the residual variance starts
_ROUNDING = 1e-14  # of the trace of a normal matrix: what rounding makes of a direction unseen


def steps(
    normal: np.ndarray, gradient: np.ndarray, cost: float, freedom: int, std: np.ndarray
) -> np.ndarray:
    """Steps (n, c) under priors of ``std`` (c,) at the residual variances they leave.

    ``normal`` (n, n), in order of rows and overwritten, ``gradient`` (n,) and ``cost`` of linear
    least squares; ``freedom``: number of residuals less that of parameters without a prior.
    """
    reduced = _Reduced.of(normal, gradient)
    variance = np.full(len(std), _LEAST_SHARE * cost / max(freedom, 1))
    going, found = np.ones(len(std), dtype=bool), np.zeros((len(std), len(gradient)))
    for _ in range(_VARIANCE_STEPS):
        held = np.maximum(variance[going] / std[going] ** 2, reduced.least)
        step, effective = reduced.at(held)
        left = cost + step @ reduced.gradient - held * np.sum(step**2, axis=1)
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

    ``gradient`` (n,) in that basis; ``least``: shift below which rounding decides.
    """

    diagonal: np.ndarray
    beside: np.ndarray
    gradient: np.ndarray
    reflectors: np.ndarray
    scales: np.ndarray
    least: float

    @classmethod
    def of(cls, normal: np.ndarray, gradient: np.ndarray) -> _Reduced:
        size = len(normal)
        least = max(_ROUNDING * float(np.trace(normal)), np.finfo(float).tiny)
        lwork = int(lapack.dsytrd_lwork(size, lower=1)[0])
        full, diagonal, beside, scales, info = lapack.dsytrd(
            normal.T, lower=1, lwork=lwork, overwrite_a=1
        )
        if info:
            raise ValueError(f"dsytrd: argument {-info}")
        reflectors = np.asfortranarray(full[1:, :-1])
        turned = _turned(reflectors, scales, gradient[:, None], "T")[:, 0]
        return cls(diagonal, beside, turned, reflectors, scales, least)

    def at(self, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Steps (c, n), in the basis, and effective numbers of parameters (c,) at ``held`` (c,)."""
        count, size = len(held), len(self.diagonal)
        # One band matrix of all: what links one to the next is zero.
        diagonal = (self.diagonal + held[:, None]).ravel()
        beside = np.tile(np.append(self.beside, 0.0), count)[:-1]
        pivots, below, info = lapack.dpttrf(diagonal, beside, overwrite_d=1, overwrite_e=1)
        if info:
            raise ValueError(f"dpttrf: {info}")
        step, _ = lapack.dpttrs(pivots, below, -np.tile(self.gradient, count))
        # The derivative of the pivots by the shift: that of the log determinant is the trace of
        # the inverse.
        links = np.ones((2, count * size), order="F")
        links[1, :-1] = -(below**2)
        slopes, _ = lapack.dtbtrs(links, np.ones(count * size), uplo="L", diag="U")
        traces = np.sum((slopes.ravel() / pivots).reshape(count, size), axis=1)
        return step.reshape(count, size), size - held * traces

    def turned_back(self, steps: np.ndarray) -> np.ndarray:
        """``steps`` (n, c) out of the basis."""
        return _turned(self.reflectors, self.scales, steps, "N")


def _turned(reflectors: np.ndarray, scales: np.ndarray, columns: np.ndarray, way: str):
    """The product of all reflections, which leave the first row alone, with ``columns`` (n, c)."""
    if not len(scales):
        return columns
    rest = np.array(columns[1:], order="F")
    work = 64 * max(columns.shape[1], 1) + 65 * 64
    rest, _, info = lapack.dormqr("L", way, reflectors, scales, rest, work, overwrite_c=1)
    if info:
        raise ValueError(f"dormqr: argument {-info}")
    return np.concatenate([columns[:1], rest])
