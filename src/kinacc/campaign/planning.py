"""Simulated campaigns on known errors: the bounds that a budget of readings brings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from kinacc.assess.adaptive import AdaptiveAssessor, Candidates
from kinacc.assess.attainable import limits_of
from kinacc.assess.statement import ACCEPT, CANDIDATES, REJECT, UNDECIDED, decide
from kinacc.assess.world import carry_on, noisy, truth_mm
from kinacc.errors import Problem, input_error, refuse
from kinacc.progress import with_progress
from kinacc.study.fields import ErrorField


@dataclass(frozen=True)
class Aim:
    """Aim of a campaign: bounds at most ``width_mm`` apart, or a decision on ``tolerance_mm``.

    ``power``: share of campaigns that have to reach it.
    """

    width_mm: float | None = None
    tolerance_mm: float | None = None
    power: float = 0.8

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
    ``holding`` of ``judged`` hold. ``within``: share as narrow as wanted. ``accept``, ``reject``,
    ``undecided``: shares decided so. ``reached``: campaigns that reach the aim; ``reached_low``:
    the share that they show with 97.5 % confidence.

    ``budget``: the smallest for which the simulations show with 97.5 % confidence that the share
    ``power`` of campaigns reaches the aim on all errors, as every larger one does. None where there
    is none, or no aim.
    """

    assessor: str
    candidates: int
    noise_mm: tuple[float, ...]
    width_mm: float | None
    tolerance_mm: float | None
    power: float
    repetitions: int
    seed: int
    budget: int | None
    rows: pd.DataFrame


def plan_budget(
    fields: Sequence[ErrorField],
    candidates: int,
    covariance_mm2: np.ndarray,
    assessors: Sequence[AdaptiveAssessor],
    aim: Aim,
    repetitions: int = 30,
    seed: int = 0,
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

    Returns
    -------
    BudgetPlan

    Raises
    ------
    InputError
        Where a field has too few errors, or an assessor states nothing about candidates.
    """
    runs = simulate(fields, candidates, covariance_mm2, assessors, repetitions, seed, aim)
    rows = counted(runs, aim)
    return BudgetPlan(
        assessor=assessors[0].name,
        candidates=candidates,
        noise_mm=tuple(np.sqrt(np.diag(covariance_mm2)).tolist()),
        **vars(aim),
        repetitions=repetitions,
        seed=seed,
        budget=smallest_budget(rows["budget"], rows["reached_low"], aim),
        rows=rows,
    )


def simulate(
    fields: Sequence[ErrorField],
    points: int,
    covariance_mm2: np.ndarray,
    assessors: Sequence[AdaptiveAssessor],
    repetitions: int,
    seed: int,
    aim: Aim,
) -> pd.DataFrame:
    """Return one row for each simulated campaign; see :func:`plan_budget`."""
    refuse(
        Problem(
            f"errors {field.name}",
            f"only {field.points}, fewer than {points} candidates",
            fix=f"--candidates {field.points}, or --errors smooth",
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
    for number, repetition in with_progress(work, "simulated sets of readings"):
        field, entropy = fields[number], (seed, number, repetition)
        drawn = np.random.default_rng(entropy).permutation(field.points)[:points]
        size_mm = field.size_mm[drawn]
        reading = noisy(field.error_mm[drawn], root, most, *entropy)
        for assessor in assessors:
            campaign = assessor.begin(candidates)
            readings, visited = carry_on(campaign, reading), campaign.ledger.visited
            stated = [item for item in campaign.statements() if item.target == CANDIDATES]
            if not stated:
                raise input_error("--assessor", f"{assessor.name} states nothing about candidates")
            statement, arm_mm = stated[0], getattr(assessor, "arm_mm", None)
            limits = limits_of(statement, visited, size_mm, sigma_mm, assessor.measurements)
            arm_mm = sigma_mm if arm_mm is None else arm_mm
            allowed_mm = aim.tolerance_mm
            verdict = decide(statement, allowed_mm).verdict if allowed_mm else UNDECIDED
            runs.append(
                {
                    "errors": field.name,
                    "budget": assessor.measurements,
                    "repetition": repetition,
                    "readings": readings,
                    "true_mm": truth_mm(statement, size_mm, visited, arm_mm),
                    "excepted": statement.excepted,
                    "lower_mm": statement.lower_mm,
                    "upper_mm": statement.upper_mm,
                    "verdict": verdict,
                    "attainable_mm": limits.attainable_mm,
                    "proven_mm": limits.proven_mm,
                }
            )
    return pd.DataFrame(runs)


def counted(runs: pd.DataFrame, aim: Aim) -> pd.DataFrame:
    """Return the rows of a :class:`BudgetPlan` for simulated campaigns (:func:`simulate`)."""
    width_mm, excess_mm = runs["upper_mm"] - runs["lower_mm"], runs["upper_mm"] - runs["true_mm"]
    width_mm = width_mm.where(runs["excepted"] == 0).clip(lower=0.0).fillna(math.inf)
    stated = runs["upper_mm"].notna()
    within = stated & (width_mm <= (aim.width_mm or math.inf))
    accept, reject = runs["verdict"] == ACCEPT, runs["verdict"] == REJECT
    decided = accept | reject
    reached = within if aim.tolerance_mm is None else decided
    groups = runs.assign(
        width_mm=width_mm, excess_mm=excess_mm, stated=stated, holding=excess_mm >= 0.0,
        within=within, accept=accept, reject=reject, undecided=~decided,
        reached=reached if aim.width_mm is None else reached & within,
    ).groupby(["errors", "budget"], sort=False)  # fmt: skip
    means = ["readings", "true_mm", "excess_mm", "attainable_mm", "proven_mm", "within"]
    rows = groups[[*means, "accept", "reject", "undecided", "stated"]].mean()
    rows["excepted"] = groups["excepted"].max()
    for name, share in (("q05", 0.05), ("median", 0.5), ("q95", 0.95)):
        # Of order, without interpolation: some widths are infinite.
        rows[f"width_{name}_mm"] = groups["width_mm"].agg(np.quantile, share, method="inverted_cdf")
    counts = groups[["holding", "stated", "reached"]].sum()
    rows[["holding", "judged", "reached"]] = counts.to_numpy()
    shown = zip(rows["reached"], groups.size(), strict=True)
    rows["reached_low"] = [binomial_interval(*pair)[0] for pair in shown]
    return rows.reset_index()


def smallest_budget(budget: pd.Series, share: pd.Series, aim: Aim) -> int | None:
    """Return the smallest budget from which on all errors have the wanted share; None if none.

    ``budget`` and ``share``: of campaigns that reach the aim, a value for each row.
    """
    worst = share.groupby(budget).min().sort_index(ascending=False)
    enough = worst[(worst >= aim.power).cummin()]
    return int(enough.index[-1]) if aim.is_set and len(enough) else None


def binomial_interval(hits: int, trials: int) -> tuple[float, float]:
    """Return two-sided 95 % limits on the probability of ``hits`` in ``trials``.

    References
    ----------
    Clopper and Pearson, Biometrika 26 (1934) 404-413.
    """
    low, high = binomtest(hits, trials).proportion_ci(0.95, "exact")
    return float(low), float(high)
