"""Gauss-Newton on whitened residuals with two treatments of undetermined directions.

``minimise_truncated``: truncated SVD, smallest displacement from the nominal parameters.
``minimise_with_prior``: a Gaussian prior (ridge), solved by Cholesky.
Both take a system that hands out residual and Jacobian in blocks, so memory stays bounded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from kinacc.errors import FitError

STEP_TOLERANCE = 1e-6  # in units of `scale`: mm and mrad
MAX_ITERATIONS = 60
MAX_HALVINGS = 12
MAX_VARIANCE_STEPS = 20
VARIANCE_TOLERANCE = 1e-9
LEAST_VARIANCE = 1e-14  # mm^2: noise-free data must not divide by zero
FRAME_THRESHOLD = 1e-6  # frames have no nominal value to keep: only exact ambiguities are cut
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
    ``variance``; NaN where undetermined. ``singular_values`` are of the
    whitened Jacobian in units of ``scale`` (after the frame columns are projected out), falling;
    ``rank`` of them exceed ``threshold`` times the largest; ``gap`` is the ratio across that cut
    (inf at full rank); ``frame_rank`` of the frame coordinates are kept.
    ``last_step`` is the largest last change in units of ``scale``.
    """

    x: np.ndarray
    std: np.ndarray
    covariance: np.ndarray
    singular_values: np.ndarray
    rank: int
    gap: float
    frame_rank: int
    threshold: float
    cost: float
    count: int
    degrees_of_freedom: int
    iterations: int
    last_step: float
    converged: bool
    variance: float


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
    frames: int = 0,
    name: str = "fit",
) -> Solution:
    """Gauss-Newton with truncated SVD, from ``start`` (P,), leaning on ``nominal`` (P,).

    Two blocks are judged one after the other: the first ``frames`` parameters (base and targets),
    then the others after what the frames can express is projected out of them. In each, directions
    whose singular value is below a share of the block's largest (``FRAME_THRESHOLD``, then
    ``threshold``) keep their nominal value; ``scale`` (P,) is the unit in which displacement is
    measured (mm, and rad of one mrad).
    Raises FitError where it does not converge.
    """
    x = np.array(start, dtype=float)
    cost, ranks, last = system.cost(x), None, np.inf
    iterations = 0
    while last > STEP_TOLERANCE and iterations < MAX_ITERATIONS:
        iterations += 1
        factor, count = triangle(system, x, scale)
        # A rank that has been lost is not taken back, so the iteration cannot swing between two.
        split = _Split.of(factor, frames, threshold, ranks if iterations > 3 else None)
        ranks = split.ranks
        step = scale * split.step((x - nominal) / scale)
        x, cost, last = _advance(system, x, step, cost, scale, name)
    _require(last <= STEP_TOLERANCE, name, iterations, last, cost, count)
    factor, count = triangle(system, x, scale)
    split = _Split.of(factor, frames, threshold, ranks)
    cost = float(np.sum(factor[:, -1] ** 2))
    freedom = count - sum(split.ranks)
    variance = cost / freedom if freedom > 0 else np.nan
    covariance = variance * split.inverse_gram() * np.outer(scale, scale)
    undetermined = split.touched()
    covariance[undetermined, :] = covariance[:, undetermined] = np.nan
    return Solution(
        x=x,
        std=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        singular_values=split.others.values,
        rank=split.others.rank,
        gap=split.others.gap,
        frame_rank=split.frames.rank,
        threshold=threshold,
        cost=cost,
        count=count,
        degrees_of_freedom=freedom,
        iterations=iterations,
        last_step=last,
        converged=True,
        variance=variance,
    )


@dataclass(frozen=True)
class _Truncated:
    """SVD ``left values right`` of a block of columns of which ``rank`` directions are kept."""

    left: np.ndarray
    values: np.ndarray
    right: np.ndarray
    rank: int

    @classmethod
    def of(cls, block: np.ndarray, threshold: float, most: int | None) -> _Truncated:
        left, values, right = np.linalg.svd(block)
        values = np.concatenate([values, np.zeros(len(right) - values.size)])
        rank = int(np.sum(values > threshold * values[0])) if values.size else 0
        return cls(left, values, right, rank if most is None else min(rank, most))

    @property
    def gap(self) -> float:
        return _gap(self.values, self.rank)

    @property
    def root(self) -> np.ndarray:
        """Matrix (P, rank) whose product with its transpose inverts the block's Gram matrix."""
        return self.right[: self.rank].T / self.values[: self.rank]

    def step(self, rhs: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Least squares in the kept directions, back to nominal in the others."""
        lost = self.right[self.rank :]
        kept = self.root @ (self.left[:, : self.rank].T @ rhs)
        return -kept - lost.T @ (lost @ displacement)

    def touched(self) -> np.ndarray:
        return np.sum(self.right[self.rank :] ** 2, axis=0) > TOUCH_SQUARED


@dataclass(frozen=True)
class _Split:
    """Triangular factor cut into the frames' columns and what is left of the others."""

    frames: _Truncated
    others: _Truncated
    coupling: np.ndarray
    frames_rhs: np.ndarray
    others_rhs: np.ndarray

    @classmethod
    def of(
        cls, factor: np.ndarray, count: int, threshold: float, most: tuple[int, int] | None
    ) -> _Split:
        upper, lower = factor[:count], factor[count:]
        frames = _Truncated.of(upper[:, :count], FRAME_THRESHOLD, most and most[0])
        # Rows of truncated frame directions are equations the frames do not take up.
        unused = frames.left[:, frames.rank :].T @ upper
        rows = np.concatenate([lower, unused])
        others = _Truncated.of(rows[:, count:-1], threshold, most and most[1])
        return cls(frames, others, upper[:, count:-1], upper[:, -1], rows[:, -1])

    @property
    def ranks(self) -> tuple[int, int]:
        return self.frames.rank, self.others.rank

    def step(self, displacement: np.ndarray) -> np.ndarray:
        count = len(self.frames_rhs)
        others = self.others.step(self.others_rhs, displacement[count:])
        frames = self.frames.step(self.frames_rhs + self.coupling @ others, displacement[:count])
        return np.concatenate([frames, others])

    def inverse_gram(self) -> np.ndarray:
        """Inverse (P, P) of J'J on the kept directions."""
        kept = self.frames.left[:, : self.frames.rank]
        seen = -self.frames.root @ (kept.T @ self.coupling @ self.others.root)
        blank = np.zeros((len(self.others.right), self.frames.rank))
        full = np.block([[self.frames.root, seen], [blank, self.others.root]])
        return full @ full.T

    def touched(self) -> np.ndarray:
        """True (P,) where a truncated direction reaches a parameter."""
        return np.concatenate([self.frames.touched(), self.others.touched()])


def minimise_with_prior(
    system: System,
    start: np.ndarray,
    prior_mean: np.ndarray,
    prior_std: np.ndarray,
    scale: np.ndarray,
    threshold: float,
    frames: int = 0,
    name: str = "fit",
) -> Solution:
    """Gauss-Newton on ``r'r / variance`` plus ``((x - prior_mean) / prior_std)^2``; inf = no prior.

    The variance of the residuals is estimated along with ``x``: what they leave over the number of
    residuals less the effective number of parameters (the trace of the hat matrix), so the balance
    against the prior follows the data. ``std`` is the posterior one. ``rank``,
    ``singular_values`` and ``gap`` describe the data alone, without the prior.
    Raises FitError where it does not converge.
    """
    x = np.array(start, dtype=float)
    weight_sq = (scale / prior_std) ** 2
    last, iterations, variance = np.inf, 0, np.inf
    while last > STEP_TOLERANCE and iterations < MAX_ITERATIONS:
        iterations += 1
        normal = _normal_equations(system, x, scale)
        displacement = (x - prior_mean) / scale
        step, variance = _step_with_prior(normal, weight_sq, displacement, variance, name)

        def total(at: np.ndarray, variance: float = variance) -> float:
            return system.cost(at) + variance * float(np.sum(((at - prior_mean) / prior_std) ** 2))

        x, _, last = _advance(system, x, scale * step, total(x), scale, name, total)
    cost, count = system.cost(x), normal.count
    _require(last <= STEP_TOLERANCE, name, iterations, last, cost, count)
    factor, count = triangle(system, x, scale)
    values = np.linalg.svd(factor[frames:, frames:-1], compute_uv=False)
    rank = int(np.sum(values > threshold * values[0])) if values.size else 0
    weight = np.diag(np.sqrt(variance * weight_sq))
    with_prior = np.linalg.qr(np.concatenate([factor[:, :-1], weight]), mode="r")
    root = solve_triangular(with_prior, np.eye(len(with_prior)))
    covariance = variance * (root @ root.T) * np.outer(scale, scale)
    return Solution(
        x=x,
        std=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        singular_values=values,
        rank=rank,
        gap=_gap(values, rank),
        frame_rank=frames,
        threshold=threshold,
        cost=cost,
        count=count,
        degrees_of_freedom=count - frames - rank,
        iterations=iterations,
        last_step=last,
        converged=True,
        variance=variance,
    )


class _Normal(NamedTuple):
    """``gram`` = J'J and ``gradient`` = J'r in scaled parameters, r'r and the residual count."""

    gram: np.ndarray
    gradient: np.ndarray
    cost: float
    count: int


def _step_with_prior(
    normal: _Normal,
    weight_sq: np.ndarray,
    displacement: np.ndarray,
    variance: float,
    name: str,
) -> tuple[np.ndarray, float]:
    """Scaled step and residual variance that agree with each other on the linearised residuals."""
    if not np.isfinite(variance):
        variance = normal.cost / normal.count
    for _ in range(MAX_VARIANCE_STEPS):
        floored = max(variance, LEAST_VARIANCE)
        gram = normal.gram.copy()
        gram[np.diag_indices_from(gram)] += floored * weight_sq
        chol = _cholesky(gram, name)
        step = -cho_solve(chol, normal.gradient + floored * weight_sq * displacement)
        cost = normal.cost + step @ (2.0 * normal.gradient + normal.gram @ step)
        inverse_diagonal = np.diag(cho_solve(chol, np.eye(len(step))))
        effective = len(step) - floored * float(weight_sq @ inverse_diagonal)
        found = max(cost, 0.0) / max(normal.count - effective, 1.0)
        if abs(found - variance) <= VARIANCE_TOLERANCE * variance:
            return step, floored
        variance = found
    return step, max(variance, LEAST_VARIANCE)


def _normal_equations(system: System, x: np.ndarray, scale: np.ndarray) -> _Normal:
    gram = np.zeros((system.size, system.size))
    gradient, cost, count = np.zeros(system.size), 0.0, 0
    for residual, jacobian in system.blocks(x):
        gram += jacobian.T @ jacobian
        gradient += jacobian.T @ residual
        cost += float(residual @ residual)
        count += len(residual)
    return _Normal(gram * np.outer(scale, scale), gradient * scale, cost, count)


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
