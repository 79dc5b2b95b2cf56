"""Gauss-Newton under a Gaussian prior whose weight follows the residuals the data leave."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from kinacc.calibration import solve
from kinacc.calibration.solve import Solution, System
from kinacc.errors import FitError

MAX_ITERATIONS = 200  # weak directions are valleys, in which steps shorten slowly
MAX_VARIANCE_STEPS = 20
VARIANCE_TOLERANCE = 1e-5
FIRST_VARIANCE = 1e-6  # share of the mean squared misfit at the start
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
    Converged where the step falls below ``solve.STEP_TOLERANCE``, or where after ``solve.PATIENCE``
    steps the objective moves by less than NO_CHANGE (or ``solve.STANDSTILL`` of itself): steps
    along directions that poses hardly show die out slowly, and change nothing but these.
    Raises FitError where it does not converge.
    """
    x = np.array(start, dtype=float)
    weight_sq = (scale / prior_std) ** 2
    last, iterations, balance = np.inf, 0, None
    while last > solve.STEP_TOLERANCE and iterations < MAX_ITERATIONS:
        iterations += 1
        normal = _normal_equations(system, x, scale)
        balance = _balanced(normal, weight_sq, (x - prior_mean) / scale, balance, name)

        def held(at: np.ndarray, variance: float = balance.variance) -> float:
            return variance * float(np.sum(((at - prior_mean) / prior_std) ** 2))

        before = normal.cost + held(x)
        x, after, last = solve.advance(
            lambda at, held=held: system.cost(at) + held(at),
            x,
            scale * balance.step,
            before,
            scale,
            name,
        )
        if iterations >= solve.PATIENCE and abs(before - after) <= _least(balance, before):
            break
    else:
        solve.require_converged(name, iterations, last, system.cost(x), normal.count)
    cost = system.cost(x)
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


def _least(balance: _Balance, objective: float) -> float:
    """Change of the objective that is none: nothing to chi-square, or to its own digits."""
    return max(NO_CHANGE * balance.variance, solve.STANDSTILL * objective)


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
    full, count = solve.gram(system, x), system.count
    gram, gradient = full[:-1, :-1] * np.outer(scale, scale), full[:-1, -1] * scale
    return _Normal(gram, gradient, float(full[-1, -1]), count)


def _inverse(gram: np.ndarray, name: str) -> np.ndarray:
    try:
        return cho_solve(cho_factor(gram, check_finite=False), np.eye(len(gram)))
    except np.linalg.LinAlgError:
        raise FitError(
            f"{name}: the normal matrix of {len(gram)} parameters is not positive definite; "
            "give every undetermined direction a prior"
        ) from None
