"""Gauss-Newton on whitened residuals with two treatments of undetermined directions.

``minimise_truncated``: truncated SVD, smallest displacement from the nominal parameters.
``minimise_with_prior``: a Gaussian prior (ridge), solved by Cholesky.
Both take a system that hands out residual and Jacobian in blocks, so memory stays bounded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve, qr

from kinacc.errors import FitError

STEP_TOLERANCE = 1e-6  # in units of `scale`: mm and mrad
MAX_ITERATIONS = 60
MAX_HALVINGS = 12
COST_RESOLUTION = 1e-9  # close to the optimum the cost no longer resolves a step
# Going back to nominal where the data is (nearly) blind costs a little: the optimum of a truncated
# fit is not quite the least cost.
TRUNCATED_GROWTH = 1e-3
LEAST_COST = 1e-10  # mm^2: of noise-free data
MAX_VARIANCE_STEPS = 20
VARIANCE_TOLERANCE = 1e-5
FIRST_VARIANCE = 1e-6  # share of the mean squared misfit at the start
LEAST_VARIANCE = 1e-8  # mm^2: the prior must stay above rounding where data are free of noise
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
    """Outcome of a fit of P parameters to ``count`` residuals; only converged fits are returned.

    ``std`` (P,) and ``covariance`` (P, P) in the parameters' own units for residuals of
    ``variance``; NaN where undetermined. ``cost`` is the sum of squared residuals,
    ``degrees_of_freedom`` their number less the (effective) number of fitted parameters,
    ``last_step`` the largest last change in units of ``scale``. ``spectrum`` is None where a prior
    made it needless; see ``spectrum``.
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
    size = system.size + 1
    factor, count = np.zeros((0, size)), 0
    for residual, jacobian in system.blocks(x):
        stacked = np.concatenate([jacobian * scale, residual[:, None]], axis=1)
        stacked = np.concatenate([factor, stacked])
        factor = qr(stacked, overwrite_a=True, mode="r", check_finite=False)[0][:size]
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
        x, cost, last = _advance(system.cost, x, step, cost, scale, name, TRUNCATED_GROWTH)
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
        cost=cost,
        count=count,
        degrees_of_freedom=freedom,
        variance=variance,
        iterations=iterations,
        last_step=last,
        converged=True,
        spectrum=split.others.spectrum,
    )


@dataclass(frozen=True)
class _Truncated:
    """SVD ``left values right`` of a block of columns of which ``rank`` directions are kept."""

    left: np.ndarray
    right: np.ndarray
    spectrum: Spectrum

    @classmethod
    def of(cls, block: np.ndarray, threshold: float, most: int | None) -> _Truncated:
        left, values, right = np.linalg.svd(block)
        values = np.concatenate([values, np.zeros(len(right) - values.size)])
        return cls(left, right, Spectrum.of(values, threshold, most))

    @property
    def rank(self) -> int:
        return self.spectrum.rank

    @property
    def root(self) -> np.ndarray:
        """Matrix (P, rank) whose product with its transpose inverts the block's Gram matrix."""
        return self.right[: self.rank].T / self.spectrum.values[: self.rank]

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
    name: str = "fit",
) -> Solution:
    """Gauss-Newton on ``r'r / variance`` plus ``((x - prior_mean) / prior_std)^2``; inf = no prior.

    The variance of the residuals is estimated along with ``x``: what they leave over the number of
    residuals less the effective number of parameters (the trace of the hat matrix), so the balance
    against the prior follows the data. ``std`` is the posterior one.
    Raises FitError where it does not converge.
    """
    x = np.array(start, dtype=float)
    weight_sq = (scale / prior_std) ** 2
    last, iterations, balance = np.inf, 0, None
    while last > STEP_TOLERANCE and iterations < MAX_ITERATIONS:
        iterations += 1
        normal = _normal_equations(system, x, scale)
        balance = _balanced(normal, weight_sq, (x - prior_mean) / scale, balance, name)

        def total(at: np.ndarray, variance: float = balance.variance) -> float:
            return system.cost(at) + variance * float(np.sum(((at - prior_mean) / prior_std) ** 2))

        x, _, last = _advance(total, x, scale * balance.step, total(x), scale, name)
    cost = system.cost(x)
    _require(last <= STEP_TOLERANCE, name, iterations, last, cost, normal.count)
    covariance = balance.variance * balance.inverse * np.outer(scale, scale)
    return Solution(
        x=x,
        std=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        cost=cost,
        count=normal.count,
        degrees_of_freedom=normal.count - balance.effective,
        variance=balance.variance,
        iterations=iterations,
        last_step=last,
        converged=True,
    )


class _Normal(NamedTuple):
    """``gram`` = J'J and ``gradient`` = J'r in scaled parameters, r'r and the residual count."""

    gram: np.ndarray
    gradient: np.ndarray
    cost: float
    count: int


class _Balance(NamedTuple):
    """Step and residual variance that agree on the linearised residuals.

    ``inverse`` (P, P) of J'J plus the prior's part, all scaled; ``effective`` parameters fitted.
    """

    step: np.ndarray
    variance: float
    inverse: np.ndarray
    effective: float


def _balanced(
    normal: _Normal,
    weight_sq: np.ndarray,
    displacement: np.ndarray,
    before: _Balance | None,
    name: str,
) -> _Balance:
    # From below: started at the variance of the whole misfit, a tight prior could pass for truth
    # and everything it forbids for noise.
    least = FIRST_VARIANCE * normal.cost / normal.count
    variance = least if before is None else before.variance
    for _ in range(MAX_VARIANCE_STEPS):
        variance = max(variance, LEAST_VARIANCE)
        gram = normal.gram.copy()
        gram[np.diag_indices_from(gram)] += variance * weight_sq
        inverse = _inverse(gram, name)
        step = -inverse @ (normal.gradient + variance * weight_sq * displacement)
        cost = normal.cost + step @ (2.0 * normal.gradient + normal.gram @ step)
        effective = len(step) - variance * float(weight_sq @ np.diag(inverse))
        found = max(cost, 0.0) / max(normal.count - effective, 1.0)
        if abs(found - variance) <= VARIANCE_TOLERANCE * variance:
            break
        variance = found
    return _Balance(step, variance, inverse, effective)


def _normal_equations(system: System, x: np.ndarray, scale: np.ndarray) -> _Normal:
    gram = np.zeros((system.size, system.size))
    gradient, cost, count = np.zeros(system.size), 0.0, 0
    for residual, jacobian in system.blocks(x):
        gram += jacobian.T @ jacobian
        gradient += jacobian.T @ residual
        cost += float(residual @ residual)
        count += len(residual)
    return _Normal(gram * np.outer(scale, scale), gradient * scale, cost, count)


def _inverse(gram: np.ndarray, name: str) -> np.ndarray:
    try:
        return cho_solve(cho_factor(gram, check_finite=False), np.eye(len(gram)))
    except np.linalg.LinAlgError:
        raise FitError(
            f"{name}: the normal matrix of {len(gram)} parameters is not positive definite; "
            "give every undetermined direction a prior"
        ) from None


def _advance(
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


def _require(converged: bool, name: str, iterations: int, last: float, cost: float, count: int):
    if not converged:
        raise FitError(
            f"{name}: not converged after {iterations} iterations; last step {last:.3g} mm or mrad "
            f"(wanted {STEP_TOLERANCE:g}), cost {cost:.6g} over {count} residuals"
        )
