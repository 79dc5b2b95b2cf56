"""Gauss-Newton under a Gaussian prior whose weight follows the residuals the data leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from kinacc.calibration import solve
from kinacc.calibration.solve import Solution, System
from kinacc.errors import FitError

MAX_ITERATIONS = 200  # weak directions are valleys, in which steps shorten slowly
PATIENCE = 40  # steps after which standing still counts as arrived
MAX_VARIANCE_STEPS = 20
VARIANCE_TOLERANCE = 1e-9  # a prior that is weighed otherwise pulls weak directions elsewhere
FIRST_TOLERANCE = 1e-3  # of the first step, which leads elsewhere
FIRST_VARIANCE = 1e-6  # share of the mean squared misfit at the start
CLOSE = 1e-3  # mm and mrad from the end: a Gram matrix from there has the same inverse
MEMORY = 20  # steps that the inverse has learned from
NO_CHANGE = 1e-4  # of chi-square: a hundredth of a standard deviation along one direction
LEAST_VARIANCE = 1e-8  # mm^2: the prior must stay above rounding where data are free of noise


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
    The Gram matrix of the Jacobian is formed where the fit starts, after the first step and close
    to the end. In between, its inverse learns from exact gradients (L-BFGS; Nocedal and Wright,
    Numerical Optimization, 7.2): these cost less, and find their way through directions that poses
    hardly show, in which Gauss-Newton steps die out slowly.
    Converged where the step that the last gradient asks for, ``last_step``, is not above
    ``solve.STEP_TOLERANCE``, or where a step moves the objective by less than NO_CHANGE (or
    ``solve.STANDSTILL`` of itself) after ``PATIENCE`` of them; then ``converged`` is False.
    Raises FitError where it does not converge.
    """
    x = np.array(start, dtype=float)
    weight_sq = (scale / prior_std) ** 2
    prior = _Prior(prior_mean, weight_sq, scale)
    iterations, variance = 0, None
    while iterations < MAX_ITERATIONS:
        normal = _normal_equations(system, x, scale)
        balance = _balanced(normal, weight_sq, prior.displacement(x), variance, name)
        here = _Point(x, normal.gradient, normal.cost)
        end = _descended(system, here, normal.count, balance, prior, iterations, name)
        iterations += end.steps
        moved = np.max(np.abs(end.at.x - x) / scale, initial=0.0)
        x, last, variance = end.at.x, end.wanted, end.variance
        if end.stands or (moved <= CLOSE and last <= solve.STEP_TOLERANCE):
            break
    else:
        solve.require_converged(name, iterations, last, end.at.cost, normal.count)
    held = _held(normal, end.variance, weight_sq, name)
    cost, freedom = end.at.cost, normal.count - held.effective
    covariance = end.variance * (held.half.T @ held.half) * np.outer(scale, scale)
    return Solution(
        x=x,
        std=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        cost=cost,
        count=normal.count,
        degrees_of_freedom=freedom,
        variance=end.variance,
        iterations=iterations,
        last_step=last,
        converged=last <= solve.STEP_TOLERANCE,
    )


class _Prior(NamedTuple):
    """Means, squared weights of displacements in units of ``scale``, and these units."""

    mean: np.ndarray
    weight_sq: np.ndarray
    scale: np.ndarray

    def displacement(self, x: np.ndarray) -> np.ndarray:
        return (x - self.mean) / self.scale

    def cost(self, x: np.ndarray) -> float:
        return float(self.weight_sq @ self.displacement(x) ** 2)


class _End(NamedTuple):
    """Where steps have led, how many, the size of the one still wanted, and whether they stood.

    ``variance``: that of the residuals there.
    """

    at: _Point
    steps: int
    wanted: float
    stands: bool
    variance: float


class _Point(NamedTuple):
    """A point with J'r in scaled parameters and r'r."""

    x: np.ndarray
    gradient: np.ndarray
    cost: float


def _descended(
    system: System,
    here: _Point,
    count: int,
    balance: _Balance,
    prior: _Prior,
    begun: int,
    name: str,
) -> _End:
    """Down the objective after ``begun`` steps; the next one is that of ``balance``.

    The first of all is taken alone: the Gram matrix may be another where it leads.
    """
    scale, step, variance = prior.scale, balance.step, balance.variance
    wanted = first = float(np.max(np.abs(step), initial=0.0))
    moves: list[tuple[np.ndarray, np.ndarray]] = []  # steps, and how the data's gradient changed
    for taken in range(1, MAX_ITERATIONS + 1 if begun else 2):
        latest = here

        def objective(at: np.ndarray, variance: float = variance) -> float:
            nonlocal latest
            found = solve.gradient(system, at)
            latest = _Point(at, found[:-1] * scale, float(found[-1]))
            return latest.cost + variance * prior.cost(at)

        before = here.cost + variance * prior.cost(here.x)
        x, after, _ = solve.advance(objective, here.x, scale * step, before, scale, name)
        if x is here.x:
            return _End(here, taken, wanted, True, variance)
        moves.append(((x - here.x) / scale, latest.gradient - here.gradient))
        if after > before:
            moves.clear()  # rounding has been learned from
        here = latest
        variance = max(here.cost / max(count - balance.effective, 1.0), LEAST_VARIANCE)
        step = _learned_step(here, balance.half, variance, prior, moves[-MEMORY:])
        wanted = float(np.max(np.abs(step), initial=0.0))
        least = max(NO_CHANGE * variance, solve.STANDSTILL * before)
        stands = begun + taken >= PATIENCE and abs(before - after) <= least
        # A step longer than the first speaks of another Gram matrix than the one frozen.
        if wanted <= solve.STEP_TOLERANCE or stands or wanted >= max(first, CLOSE):
            break
    return _End(here, taken, wanted, stands, variance)


def _learned_step(
    here: _Point,
    half: np.ndarray,
    variance: float,
    prior: _Prior,
    moves: list[tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """The L-BFGS step, which begins with ``half`` of the inverse Hessian."""
    rest = here.gradient + variance * prior.weight_sq * prior.displacement(here.x)
    pairs = [(step, change + variance * prior.weight_sq * step) for step, change in moves]
    pairs = [(step, change, step @ change) for step, change in pairs if step @ change > 0.0]
    shares = []
    for step, change, product in reversed(pairs):
        shares.append(step @ rest / product)
        rest = rest - shares[-1] * change
    found = half.T @ (half @ rest)
    for (step, change, product), share in zip(pairs, reversed(shares), strict=True):
        found = found + (share - change @ found / product) * step
    return -found


class _Normal(NamedTuple):
    """``gram`` = J'J and ``gradient`` = J'r in scaled parameters, r'r and the residual count."""

    gram: np.ndarray
    gradient: np.ndarray
    cost: float
    count: int


class _Balance(NamedTuple):
    """Step and residual variance that agree on the linearised residuals.

    ``half`` (P, P) and ``effective`` are those of ``_HeldGram``.
    """

    step: np.ndarray
    variance: float
    half: np.ndarray
    effective: float


def _balanced(
    normal: _Normal,
    weight_sq: np.ndarray,
    displacement: np.ndarray,
    variance: float | None,
    name: str,
) -> _Balance:
    # From below: started at the variance of the whole misfit, a tight prior could pass for truth
    # and everything it forbids for noise.
    tolerance = VARIANCE_TOLERANCE
    if variance is None:
        tolerance = FIRST_TOLERANCE
        variance = max(FIRST_VARIANCE * normal.cost / normal.count, LEAST_VARIANCE)
    for _ in range(MAX_VARIANCE_STEPS):
        half, effective = _held(normal, variance, weight_sq, name)
        step = -half.T @ (half @ (normal.gradient + variance * weight_sq * displacement))
        cost = normal.cost + step @ (2.0 * normal.gradient + normal.gram @ step)
        found = max(cost / max(normal.count - effective, 1.0), LEAST_VARIANCE)
        if abs(found - variance) <= tolerance * variance:
            break
        variance = found
    return _Balance(step, variance, half, effective)


class _HeldGram(NamedTuple):
    """Triangular ``half`` (P, P): half' half inverts J'J plus the prior's part.

    ``effective``: how many parameters the data decide.
    """

    half: np.ndarray
    effective: float


def _held(normal: _Normal, variance: float, weight_sq: np.ndarray, name: str) -> _HeldGram:
    gram = normal.gram.copy()
    gram[np.diag_indices_from(gram)] += variance * weight_sq
    factor, failed = scipy.linalg.lapack.dpotrf(gram, lower=1)
    if failed:
        raise FitError(
            f"{name}: the normal matrix of {len(gram)} parameters is not positive definite; "
            "give every undetermined direction a prior"
        )
    half, _ = scipy.linalg.lapack.dtrtri(factor, lower=1, overwrite_c=1)
    return _HeldGram(half, len(gram) - variance * float(weight_sq @ np.sum(half**2, axis=0)))


def _normal_equations(system: System, x: np.ndarray, scale: np.ndarray) -> _Normal:
    full, count = solve.gram(system, x), system.count
    gram, gradient = full[:-1, :-1] * np.outer(scale, scale), full[:-1, -1] * scale
    return _Normal(gram, gradient, float(full[-1, -1]), count)
