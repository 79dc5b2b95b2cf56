"""Whitened least squares: what a fit is given, what it returns, how a step is taken.

``truncated`` and ``ridge`` hold the two treatments of directions the data cannot determine. Both
take a system that hands out residual and Jacobian in blocks, so memory stays bounded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from kinacc.errors import FitError

STEP_TOLERANCE = 1e-6  # in units of `scale`: mm and mrad
MAX_ITERATIONS = 60
PATIENCE = 12  # steps after which standing still in the objective counts as arrived
STANDSTILL = 1e-9  # share of the objective
MAX_HALVINGS = 12
COST_RESOLUTION = 1e-9  # close to the optimum the cost no longer resolves a step
LEAST_COST = 1e-10  # mm^2: of noise-free data
_PANEL = 16  # columns reduced at once
_ROWS = 384


class System(Protocol):
    """Residuals of a fit: P parameters, blocks of whitened residuals and their Jacobian."""

    size: int
    count: int  # of residuals

    def cost(self, x: np.ndarray) -> float:
        """Sum of squared residuals at ``x``."""

    def blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) of one block of observations after another."""


@dataclass(frozen=True)
class Spectrum:
    """What data can tell of a block of parameters.

    ``values``: singular values of the Jacobian in units of ``scale``, falling, after the frame
    columns are projected out. ``rank`` of them exceed ``threshold`` times the largest; ``gap`` is
    the ratio across that cut, inf at full rank.
    """

    values: np.ndarray
    threshold: float
    rank: int
    gap: float

    @classmethod
    def of(cls, values: np.ndarray, threshold: float, most: int | None = None) -> Spectrum:
        """Spectrum of falling ``values``; no rank above ``most``."""
        rank = int(np.sum(values > threshold * values[0])) if values.size else 0
        rank = rank if most is None else min(rank, most)
        past = values[rank] if rank < values.size else 0.0
        gap = float(values[rank - 1] / past) if rank and past > 0.0 else float("inf")
        return cls(values, threshold, rank, gap)


@dataclass(frozen=True)
class Solution:
    """Outcome of a fit of P parameters to ``count`` residuals.

    ``std`` (P,) and ``covariance`` (P, P) in the parameters' own units for residuals of
    ``variance``. The covariance is that of the determined directions; ``undetermined`` (m, P) are
    the others, unit displacements in units of ``scale`` that change no residual, and ``std`` is NaN
    where one of them reaches a parameter. ``cost`` is the sum of squared residuals,
    ``degrees_of_freedom`` their number less the (effective) number of fitted parameters,
    ``last_step`` the largest last change in units of ``scale``; ``converged`` where it is not above
    STEP_TOLERANCE, else the objective stood still before. ``spectrum`` is None where a prior
    made it needless; see ``spectrum``. ``scale`` (P,) are the units of ``undetermined``.
    """

    x: np.ndarray
    std: np.ndarray
    covariance: np.ndarray
    cost: float
    count: int
    degrees_of_freedom: float
    variance: float
    iterations: int
    last_step: float
    converged: bool
    spectrum: Spectrum | None = None
    undetermined: np.ndarray | None = None
    scale: np.ndarray | None = None


def spectrum(
    system: System, x: np.ndarray, scale: np.ndarray, frames: int, threshold: float
) -> Spectrum:
    """Spectrum of all but the first ``frames`` parameters of ``system`` linearised at ``x``."""
    factor, _ = triangle(system, x, scale)
    return Spectrum.of(np.linalg.svd(factor[frames:, frames:-1], compute_uv=False), threshold)


def triangle(system: System, x: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, int]:
    """Triangular factor (P+1, P+1) of ``[J scale | r]`` and the number of residuals.

    Orthogonal reduction block by block: singular values keep their digits, unlike through J'J.
    """
    factors, counts = triangles(system, x, scale)
    return joined(factors), sum(counts)


def triangles(
    system: System, x: np.ndarray, scale: np.ndarray, is_rotation: np.ndarray | None = None
) -> tuple[list[np.ndarray], list[int]]:
    """As ``triangle``, of the rows that ``is_rotation`` (m,) says are not and are, one by one.

    A system with rows ``stacked`` by kind and a ``count`` of its own has them cheaper.
    """
    size, unit = system.size + 1, np.append(scale, 1.0)
    factors, counts = [np.zeros((size, size), order="F") for _ in range(2)], [0, 0]
    if hasattr(system, "stacked"):
        for kind, rows in system.stacked(x):
            factors[kind] = _reduced(factors[kind], rows)
        turned = 0 if is_rotation is None else int(is_rotation.sum())
        return [factor * unit for factor in factors], [system.count - turned, turned]
    for residual, jacobian in system.blocks(x):
        rows = np.concatenate([jacobian, residual[:, None]], axis=1)
        begin = sum(counts)
        own = None if is_rotation is None else is_rotation[begin : begin + len(rows)]
        for kind, some in enumerate([rows] if own is None else [rows[~own], rows[own]]):
            factors[kind] = _reduced(factors[kind], some)
            counts[kind] += len(some)
    return [factor * unit for factor in factors], counts


def joined(factors: Sequence[np.ndarray]) -> np.ndarray:
    """Triangular factor (P, P) of rows whose triangular factors are ``factors``."""
    found = factors[0]
    for factor in factors[1:]:
        if factor.any():
            found = _reduced(found, factor) if found.any() else factor
    return found


def _reduced(factor: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Triangular factor (P, P) of ``factor`` and ``rows`` (m, P) below it.

    Some rows at a time, so that they stay in the cache.
    """
    width = min(_PANEL, len(factor))
    for begin in range(0, len(rows), _ROWS):
        some = np.array(rows[begin : begin + _ROWS], order="F")
        factor = scipy.linalg.lapack.dtpqrt(0, width, factor, some, overwrite_a=1, overwrite_b=1)[0]
    return np.triu(factor)


def triangle_of_gram(gram: np.ndarray) -> np.ndarray:
    """Triangular factor (P, P) of a matrix with the Gram matrix ``gram`` (P, P).

    Singular values below 1e-7 of the largest, of columns made equally long, are rounding.
    """
    unit = np.sqrt(np.maximum(np.diag(gram), 0.0))
    unit = np.where(unit > 0.0, unit, 1.0)
    factor, order, rank, _ = scipy.linalg.lapack.dpstrf(
        gram / np.outer(unit, unit), tol=len(gram) * 2.3e-16
    )
    factor = np.triu(factor)
    factor[rank:] = 0.0
    back = np.empty_like(factor)
    back[:, order - 1] = factor
    return np.linalg.qr(back, mode="r") * unit


def gram(system: System, x: np.ndarray) -> np.ndarray:
    """Gram matrix (P+1, P+1) of ``[J | r]``: normal equations and, last, the cost.

    A system with a ``gram(x)`` of its own knows how to sum it up cheaper.
    """
    if hasattr(system, "gram"):
        return system.gram(x)
    total = np.zeros((system.size + 1, system.size + 1))
    for residual, jacobian in system.blocks(x):
        both = np.concatenate([jacobian, residual[:, None]], axis=1)
        total += both.T @ both
    return total


def gradient(system: System, x: np.ndarray) -> np.ndarray:
    """The last row (P+1,) of ``gram``: J'r and, last, the cost; cheaper where ``system`` has it."""
    if hasattr(system, "gradient"):
        return system.gradient(x)
    return gram(system, x)[-1]


def advance(
    objective: Callable[[np.ndarray], float],
    x: np.ndarray,
    step: np.ndarray,
    cost: float,
    scale: np.ndarray,
    name: str,
    growth: float = COST_RESOLUTION,
) -> tuple[np.ndarray, float, float]:
    """Take ``step``, halved until ``objective`` grows by less than ``growth``.

    New x, its cost and the largest move; x itself, with the size of the refused step, if no
    fraction of the step is any good.
    """
    size = float(np.max(np.abs(step / scale))) if step.size else 0.0
    if not np.isfinite(size):
        raise FitError(f"{name}: a step is not finite at cost {cost:.6g}")
    factor = 1.0
    for _ in range(MAX_HALVINGS):
        trial = x + factor * step
        trial_cost = objective(trial)
        if trial_cost <= cost * (1.0 + growth) + LEAST_COST:
            return trial, trial_cost, size * factor
        factor *= 0.5
    return x, cost, size


def require_converged(name: str, iterations: int, last: float, cost: float, count: int) -> None:
    """Raise FitError with the numbers where the last step was not below the tolerance."""
    if last > STEP_TOLERANCE:
        raise FitError(
            f"{name}: not converged after {iterations} iterations; last step {last:.3g} mm or mrad "
            f"(wanted {STEP_TOLERANCE:g}), cost {cost:.6g} over {count} residuals"
        )
