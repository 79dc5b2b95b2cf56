"""Gauss-Newton on whitened residuals with two treatments of undetermined directions.

``minimise_truncated``: truncated SVD, smallest displacement from the nominal parameters.
``minimise_with_prior``: a Gaussian prior (ridge), solved by Cholesky.
Both take a system that hands out residual and Jacobian in blocks, so memory stays bounded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from kinacc.errors import FitError

STEP_TOLERANCE = 1e-6  # in units of `scale`: mm and mrad
MAX_ITERATIONS = 60
MAX_HALVINGS = 12
TOUCH_SQUARED = 1e-4  # a parameter is undetermined if a truncated direction holds 1 % of it


class System(Protocol):
    """Residuals of a fit: P parameters, blocks of whitened residuals and their Jacobian."""

    size: int

    def cost(self, x: np.ndarray) -> float:
        """Sum of squared residuals at ``x``."""

    def blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) of one block of observations after another."""


@dataclass(frozen=True)
class Solution:
    """Outcome of a fit of P parameters to m residuals.

    ``std`` (P,) and ``covariance`` (P, P) in the parameters' own units, scaled by the residual
    variance ``cost / degrees_of_freedom``; NaN where undetermined. ``singular_values`` are of the
    whitened Jacobian in units of ``scale`` (after the frame columns are projected out), falling;
    ``rank`` of them exceed ``threshold`` times the largest; ``gap`` is the ratio across that cut
    (inf at full rank). ``last_step`` is the largest last change in units of ``scale``.
    """

    x: np.ndarray
    std: np.ndarray
    covariance: np.ndarray
    singular_values: np.ndarray
    rank: int
    gap: float
    threshold: float
    cost: float
    count: int
    degrees_of_freedom: int
    iterations: int
    last_step: float
    converged: bool


def triangle(system: System, x: np.ndarray, scale: np.ndarray) -> tuple[np.ndarray, int]:
    """Triangular factor (P+1, P+1) of ``[J scale | r]`` and the number of residuals.

    Orthogonal reduction block by block: singular values keep their digits, unlike through J'J.
    """
    size = system.size + 1
    factor, count = np.zeros((0, size)), 0
    for residual, jacobian in system.blocks(x):
        stacked = np.concatenate([jacobian * scale, residual[:, None]], axis=1)
        factor = np.linalg.qr(np.concatenate([factor, stacked]), mode="r")
        count += len(residual)
    if len(factor) < size:
        factor = np.concatenate([factor, np.zeros((size - len(factor), size))])
    return factor, count


def minimise_truncated(
    system: System,
    start: np.ndarray,
    nominal: np.ndarray,
    scale: np.ndarray,
    threshold: float,
    free: int = 0,
    name: str = "fit",
) -> Solution:
    """Gauss-Newton with truncated SVD, from ``start`` (P,), leaning on ``nominal`` (P,).

    The first ``free`` parameters (base and targets) are never truncated: what they can express is
    projected out first. Of the others, directions whose singular value is below ``threshold``
    times the largest keep their nominal value; ``scale`` (P,) is the unit in which displacement is
    measured (mm, and rad of one mrad). Raises FitError where it does not converge.
    """
    x = np.array(start, dtype=float)
    cost, rank, iterations, last = system.cost(x), None, 0, np.inf
    for iterations in range(1, MAX_ITERATIONS + 1):
        factor, count = triangle(system, x, scale)
        split = _Split.of(factor, free)
        found = int(np.sum(split.values > threshold * split.values[0])) if split.values.size else 0
        # A rank that has been lost is not taken back, so the iteration cannot swing between two.
        rank = found if rank is None or iterations <= 3 else min(rank, found)
        step = scale * split.step((x - nominal) / scale, rank)
        x, cost, last = _advance(system, x, step, cost, scale, name)
        if last <= STEP_TOLERANCE:
            break
    factor, count = triangle(system, x, scale)
    split = _Split.of(factor, free)
    cost = float(factor[-1, -1] ** 2 + np.sum(factor[:-1, -1] ** 2))
    freedom = count - free - rank
    _require(last <= STEP_TOLERANCE, name, iterations, last, cost, count)
    variance = cost / freedom if freedom > 0 else np.nan
    covariance = variance * split.inverse_gram(rank) * np.outer(scale, scale)
    undetermined = split.touched(rank)
    covariance[undetermined, :] = covariance[:, undetermined] = np.nan
    return Solution(
        x=x,
        std=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        singular_values=split.values,
        rank=rank,
        gap=_gap(split.values, rank),
        threshold=threshold,
        cost=cost,
        count=count,
        degrees_of_freedom=freedom,
        iterations=iterations,
        last_step=last,
        converged=True,
    )


@dataclass(frozen=True)
class _Split:
    """Triangular factor cut into free columns and the SVD of what is left of the others."""

    free_factor: np.ndarray
    coupling: np.ndarray
    free_rhs: np.ndarray
    left_rhs: np.ndarray
    values: np.ndarray
    right: np.ndarray

    @classmethod
    def of(cls, factor: np.ndarray, free: int) -> _Split:
        size = factor.shape[1] - 1
        left, values, right = np.linalg.svd(factor[free:, free:size], full_matrices=False)
        return cls(
            free_factor=factor[:free, :free],
            coupling=factor[:free, free:size],
            free_rhs=factor[:free, size],
            left_rhs=left.T @ factor[free:, size],
            values=values,
            right=right,
        )

    def step(self, displacement: np.ndarray, rank: int) -> np.ndarray:
        """Step (P,): least squares in the kept directions, back to nominal in the others."""
        free = len(self.free_rhs)
        kept, lost = self.right[:rank], self.right[rank:]
        others = -kept.T @ (self.left_rhs[:rank] / self.values[:rank])
        others -= lost.T @ (lost @ displacement[free:])
        if not free:
            return others
        goal = -(self.free_rhs + self.coupling @ others)
        return np.concatenate([np.linalg.lstsq(self.free_factor, goal, rcond=1e-12)[0], others])

    def inverse_gram(self, rank: int) -> np.ndarray:
        """Inverse (P, P) of J'J on the kept directions."""
        free = len(self.free_rhs)
        root = self.right[:rank].T / self.values[:rank]
        if not free:
            return root @ root.T
        back = np.linalg.pinv(self.free_factor, rcond=1e-12)
        full = np.block([[back, -back @ self.coupling @ root], [np.zeros((len(root), free)), root]])
        return full @ full.T

    def touched(self, rank: int) -> np.ndarray:
        """True (P,) where a truncated direction reaches a parameter."""
        share = np.sum(self.right[rank:] ** 2, axis=0) > TOUCH_SQUARED
        return np.concatenate([np.zeros(len(self.free_rhs), dtype=bool), share])


def minimise_with_prior(
    system: System,
    start: np.ndarray,
    prior_mean: np.ndarray,
    prior_std: np.ndarray,
    scale: np.ndarray,
    threshold: float,
    free: int = 0,
    name: str = "fit",
) -> Solution:
    """Gauss-Newton on residuals plus ``((x - prior_mean) / prior_std)^2``; inf = no prior.

    ``std`` is the posterior one with whitened residuals taken at their word (variance 1).
    ``rank``, ``singular_values`` and ``gap`` describe the data alone, without the prior.
    Raises FitError where it does not converge.
    """
    x = np.array(start, dtype=float)
    weight = scale / prior_std

    def total(at: np.ndarray) -> float:
        return system.cost(at) + float(np.sum(((at - prior_mean) / prior_std) ** 2))

    cost, iterations, last = total(x), 0, np.inf
    for iterations in range(1, MAX_ITERATIONS + 1):
        gram, gradient, count = _normal_equations(system, x, scale)
        gram[np.diag_indices_from(gram)] += weight**2
        gradient += weight**2 * (x - prior_mean) / scale
        chol = _cholesky(gram, name)
        step = -scale * cho_solve(chol, gradient)
        x, cost, last = _advance(system, x, step, cost, scale, name, total)
        if last <= STEP_TOLERANCE:
            break
    _require(last <= STEP_TOLERANCE, name, iterations, last, cost, count)
    factor, count = triangle(system, x, scale)
    values = np.linalg.svd(factor[free:, free:-1], compute_uv=False)
    rank = int(np.sum(values > threshold * values[0]))
    with_prior = np.linalg.qr(np.concatenate([factor[:, :-1], np.diag(weight)]), mode="r")
    root = solve_triangular(with_prior, np.eye(len(with_prior))) * 1.0
    covariance = (root @ root.T) * np.outer(scale, scale)
    return Solution(
        x=x,
        std=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        singular_values=values,
        rank=rank,
        gap=_gap(values, rank),
        threshold=threshold,
        cost=system.cost(x),
        count=count,
        degrees_of_freedom=count - free - rank,
        iterations=iterations,
        last_step=last,
        converged=True,
    )


def _normal_equations(
    system: System, x: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray, int]:
    gram = np.zeros((system.size, system.size))
    gradient, count = np.zeros(system.size), 0
    for residual, jacobian in system.blocks(x):
        gram += jacobian.T @ jacobian
        gradient += jacobian.T @ residual
        count += len(residual)
    return gram * np.outer(scale, scale), gradient * scale, count


def _cholesky(gram: np.ndarray, name: str) -> tuple[np.ndarray, bool]:
    try:
        return cho_factor(gram)
    except np.linalg.LinAlgError:
        raise FitError(
            f"{name}: the normal matrix of {len(gram)} parameters is not positive definite; "
            "give every undetermined direction a prior"
        ) from None


def _advance(system, x, step, cost, scale, name, objective=None):
    """Take ``step``, halved until the cost does not grow: new x, its cost, largest move."""
    objective = objective or system.cost
    size = float(np.max(np.abs(step / scale))) if step.size else 0.0
    if not np.isfinite(size):
        raise FitError(f"{name}: a step is not finite at cost {cost:.6g}")
    factor = 1.0
    for _ in range(MAX_HALVINGS):
        trial = x + factor * step
        trial_cost = objective(trial)
        # Close to the optimum the cost no longer resolves the step: accept what is level with it.
        if trial_cost <= cost * (1.0 + 1e-9) + 1e-18:
            return trial, trial_cost, size * factor
        factor *= 0.5
    return x, cost, size


def _gap(values: np.ndarray, rank: int) -> float:
    if rank == 0 or rank >= values.size or values[rank] == 0.0:
        return float("inf")
    return float(values[rank - 1] / values[rank])


def _require(converged: bool, name: str, iterations: int, last: float, cost: float, count: int):
    if not converged:
        raise FitError(
            f"{name}: not converged after {iterations} iterations; last step {last:.3g} mm or mrad "
            f"(wanted {STEP_TOLERANCE:g}), cost {cost:.6g} over {count} residuals"
        )
