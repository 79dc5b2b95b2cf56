"""Simulated campaigns on known errors: the bounds that a budget of readings brings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.attainable import limits_of
from kinacc.assess.population import binomial_interval
from kinacc.assess.simulate import carry_on, noisy, truth_mm
from kinacc.assess.statement import ACCEPT, CANDIDATES, REJECT, UNDECIDED, decide
from kinacc.errors import InputError, Problem, refuse
from kinacc.study.fields import ErrorField


@dataclass(frozen=True)
class Aim:
    """Aim of a campaign: bounds at most ``width_mm`` apart, or a decision on ``tolerance_mm``.

    ``power``: share of campaigns that have to reach it. ``target`` of the bounds.
    """

    width_mm: float | None = None
    tolerance_mm: float | None = None
    power: float = 0.8
    target: str = CANDIDATES

    @property
    def is_set(self) -> bool:
        """Whether there is a width or a tolerance."""
        return self.width_mm is not None or self.tolerance_mm is not None


@dataclass(frozen=True)
class BudgetPlan:
    """Answer of ``kinacc campaign plan``: ``rows``, one for each kind of errors and budget.

    ``true_mm``: mean largest error of the candidates that the bound is on (all but ``excepted``).
    ``width_*_mm``: quantiles of upper minus lower bound; 0 where they contradict each other,
    infinite without a bound on all. ``stated``: share with an upper bound. Of these upper bounds:
    ``excess_mm``, mean of bound minus truth; ``attainable_mm``, the same of the best design that
    knows all errors; ``proven_mm``, the excess below which no reliable bound stays (NaN: none);
    ``holding`` of ``judged`` hold, with exact 95 % limits of the share. ``within``: share as narrow
    as wanted. ``accept``, ``reject``, ``undecided``: shares decided so. ``reached``: campaigns that
    reach the aim; ``reached_low``: the share that they show with 97.5 % confidence.

    ``budget``: the smallest that reaches the aim in the share ``power`` of the simulated campaigns
    on all errors, as every larger one does; ``budget_shown``: the smallest for which so many
    simulations show it with 97.5 % confidence. None where there is none, or no aim.
    """

    assessor: str
    candidates: int
    noise_mm: tuple[float, ...]
    target: str
    width_mm: float | None
    tolerance_mm: float | None
    power: float
    repetitions: int
    seed: int
    budget: int | None
    budget_shown: int | None
    rows: pd.DataFrame


def plan_budget(
    fields: Sequence[ErrorField],
    candidates: int,
    covariance_mm2: np.ndarray,
    assessors: Sequence[AdaptiveAssessor],
    aim: Aim,
    repetitions: int = 30,
    seed: int = 0,
    progress: Callable | None = None,
) -> BudgetPlan:
    """Simulate campaigns of assessors, one for each budget, on every kind of errors.

    Parameters
    ----------
    fields : sequence of ErrorField
        Errors in mm from which candidates are drawn.
    candidates : int
        Number of candidates of a campaign.
    covariance_mm2 : (3, 3) array
        Covariance of a reading, mm^2, robot base frame.
    assessors : sequence
        Adaptive assessors that differ in their budget ``measurements``.
    aim : Aim
        Width or decision that a campaign is for.
    repetitions, seed : int
        Campaigns simulated for each row; the same readings serve all budgets.
    progress : callable, optional
        Reports on an iterable.

    Returns
    -------
    BudgetPlan

    Raises
    ------
    InputError
        Where a field has too few errors, or an assessor states no bound on the target.
    """
    runs = simulate(fields, candidates, covariance_mm2, assessors, repetitions, seed, aim, progress)
    groups = runs.groupby(["errors", "budget"], sort=False)
    rows = pd.DataFrame([_row(str(key[0]), int(key[1]), group, aim) for key, group in groups])
    return BudgetPlan(
        assessors[0].name,
        candidates,
        tuple(np.sqrt(np.diag(covariance_mm2)).tolist()),
        aim.target,
        *(aim.width_mm, aim.tolerance_mm, aim.power, repetitions, seed),
        smallest_budget(rows["budget"], rows["reached"] / repetitions, aim),
        smallest_budget(rows["budget"], rows["reached_low"], aim),
        rows,
    )


def simulate(
    fields: Sequence[ErrorField],
    points: int,
    covariance_mm2: np.ndarray,
    assessors: Sequence[AdaptiveAssessor],
    repetitions: int,
    seed: int,
    aim: Aim,
    progress: Callable | None = None,
) -> pd.DataFrame:
    """Return one row for each simulated campaign; see :func:`plan_budget`."""
    refuse(
        Problem(
            f"errors {field.name}",
            f"only {field.points}, fewer than {points} candidates",
            fix=f"--candidates {field.points}, or --errors smooth "
            f"--largest-mm {field.size_mm.max():.3g}",
        )
        for field in fields
        if field.points < points
    )
    candidates = Candidates(np.tile(covariance_mm2, (points, 1, 1)))
    root, sigma_mm = np.linalg.cholesky(covariance_mm2), candidates.sigma_mm
    most = max(item.measurements for item in assessors)
    work = [
        (number, repetition) for number in range(len(fields)) for repetition in range(repetitions)
    ]
    runs = []
    for number, repetition in progress(work, "simulated sets of readings") if progress else work:
        field, entropy = fields[number], (seed, number, repetition)
        drawn = np.random.default_rng(entropy).permutation(field.points)[:points]
        size_mm = field.size_mm[drawn]
        reading = noisy(field.error_mm[drawn], root, most, *entropy)
        for assessor in assessors:
            campaign = assessor.begin(candidates)
            readings, visited = carry_on(campaign, reading), campaign.ledger.visited
            stated = [item for item in campaign.statements() if item.target == aim.target]
            if not stated:
                message = f"{assessor.name} states nothing about {aim.target}"
                raise InputError(Problem("--assessor", message, fix="choose another, or --target"))
            statement, arm_mm = stated[0], getattr(assessor, "arm_mm", None)
            limits = limits_of(statement, visited, size_mm, sigma_mm, assessor.measurements)
            width_mm = math.nan if statement.excepted else statement.upper_mm - statement.lower_mm
            tolerance_mm = aim.tolerance_mm
            runs.append(
                {
                    "errors": field.name,
                    "budget": assessor.measurements,
                    "repetition": repetition,
                    "readings": readings,
                    "true_mm": truth_mm(
                        statement, size_mm, visited, sigma_mm if arm_mm is None else arm_mm
                    ),
                    "excepted": statement.excepted,
                    "lower_mm": statement.lower_mm,
                    "upper_mm": statement.upper_mm,
                    "width_mm": math.inf if math.isnan(width_mm) else max(width_mm, 0.0),
                    "verdict": decide(statement, tolerance_mm).verdict
                    if tolerance_mm
                    else UNDECIDED,
                    "attainable_mm": limits.attainable_mm,
                    "proven_mm": limits.proven_mm,
                }
            )
    return pd.DataFrame(runs)


def smallest_budget(budget: pd.Series, share: pd.Series, aim: Aim) -> int | None:
    """Return the smallest budget from which on all errors have the wanted share; None if none.

    ``budget`` and ``share``: of campaigns that reach the aim, a value for each row.
    """
    enough = None
    worst = share.groupby(budget).min().sort_index(ascending=False)
    for level, lowest in worst.items() if aim.is_set else ():
        if lowest < aim.power:
            break
        enough = int(level)
    return enough


def _row(errors: str, budget: int, runs: pd.DataFrame, aim: Aim) -> dict:
    count, stated = len(runs), runs[runs["upper_mm"].notna()]
    above_mm = stated["upper_mm"] - stated["true_mm"]
    holding, judged = int((above_mm >= 0.0).sum()), len(stated)
    within = int((stated["width_mm"] <= (aim.width_mm or math.inf)).sum())
    accept, reject = (float((runs["verdict"] == verdict).mean()) for verdict in (ACCEPT, REJECT))
    reached = within if aim.width_mm is not None or aim.tolerance_mm is None else count
    if aim.tolerance_mm is not None:
        reached = min(reached, round(count * (accept + reject)))
    # Of order, without interpolation: some widths are infinite.
    widths = np.quantile(runs["width_mm"], (0.05, 0.5, 0.95), method="inverted_cdf").tolist()
    limits = binomial_interval(holding, judged) if judged else (math.nan, math.nan)
    return {
        "errors": errors,
        "budget": budget,
        **runs[["readings", "true_mm"]].mean(),
        "excepted": int(runs["excepted"].max()),
        **dict(zip(("width_q05_mm", "width_median_mm", "width_q95_mm"), widths, strict=True)),
        "excess_mm": float(above_mm.mean()),
        **stated[["attainable_mm", "proven_mm"]].mean(),
        "stated": judged / count,
        "holding": holding,
        "judged": judged,
        **dict(zip(("holds_low", "holds_high"), limits, strict=True)),
        "within": within / count,
        "undecided": 1.0 - (accept + reject),
        "reached": reached,
        "reached_low": binomial_interval(reached, count)[0],
        "accept": accept,
        "reject": reject,
    }
