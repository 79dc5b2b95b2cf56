"""Assessors beside each other on errors that are known: bias, scatter, coverage and width."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from kinacc.assess.world import checked_errors
from kinacc.errors import InputError, Problem
from kinacc.study.monte_carlo import Visits, assessed_row, statistics, world_of

KEYS = ["assessor", "noise_mm"]


def evaluate_assessors(
    errors: ArrayLike,
    assessors: Sequence,
    noise_mm: float | Sequence[float],
    budget: int,
    repetitions: int,
    seed: int,
) -> pd.DataFrame:
    """Evaluate assessors on simulated readings of known errors.

    Every repetition of a noise is one world of readings, which all assessors see (common random
    numbers): the worlds of the study with the same ``seed``.

    Parameters
    ----------
    errors : (m, 3) array
        True errors in mm, robot base frame, of points in random order.
    assessors : sequence
        Of the paper (:data:`kinacc.assess.registry.PAPER`), of those that choose as they go
        (:data:`kinacc.assess.registry.ADAPTIVE`), or of one's own: an object whose
        ``begin(candidates)`` returns a campaign (:class:`kinacc.assess.adaptive.Campaign`).
        ``name`` is its name in the table; its field ``measurements`` is set to the budget.
    noise_mm : float or sequence of floats
        Standard deviations of a reading per axis, mm.
    budget : int
        Readings of an assessment.
    repetitions : int
        Worlds for each noise.
    seed : int
        Seed of all worlds.

    Returns
    -------
    DataFrame
        A row for each assessor and noise, with the columns of ``study_summary`` that Fig. 4 draws
        (mean_mm, min_mm, max_mm, bias_mm, rmse_mm against the largest true error, repetitions), and
        of the bounds: stated (share of worlds with an upper bound), coverage and lower_coverage
        (share of these whose upper, lower bound holds for the points it is about), width_mm (mean
        of upper less lower bound). NaN where no bound is stated.

    Raises
    ------
    InputError
        For errors, noise or numbers that cannot be used, and for names that occur twice.

    Examples
    --------
    >>> import numpy as np
    >>> from kinacc.assess.maximum import Maximum
    >>> from kinacc.assess.single_shot import SingleShot
    >>> errors = np.random.default_rng(1).normal(0.0, 0.2, (50, 3))
    >>> table = evaluate_assessors(errors, [Maximum(50), SingleShot(50)], 0.05, 50, 20, 1)
    >>> table["assessor"].tolist()
    ['maximum', 'single_shot']
    """
    rows = assess_worlds(errors, assessors, noise_mm, budget, repetitions, seed)
    truth = float(np.linalg.norm(checked_errors(errors), axis=1).max())
    stated = rows["upper_mm"].notna()
    rows["coverage"] = (rows["upper_mm"] >= rows["bounded_mm"]).where(stated).astype(float)
    rows["lower_coverage"] = (rows["lower_mm"] <= truth).where(stated).astype(float)
    rows["width_mm"] = rows["upper_mm"] - rows["lower_mm"]
    rows["stated"] = stated.astype(float)
    bounds = rows.groupby(KEYS)[["stated", "coverage", "lower_coverage", "width_mm"]].mean()
    return statistics(rows, KEYS, truth).join(bounds, on=KEYS)


def assess_worlds(
    errors: ArrayLike,
    assessors: Sequence,
    noise_mm: float | Sequence[float],
    budget: int,
    repetitions: int,
    seed: int,
) -> pd.DataFrame:
    """Return the single assessments behind :func:`evaluate_assessors`, a row each.

    Columns noise_mm, repetition, assessor, assessed_mm, measurements, points_visited, lower_mm,
    upper_mm, and bounded_mm: the true size that the upper bound is held to.
    """
    error_mm, levels = checked_errors(errors), np.atleast_1d(np.asarray(noise_mm, dtype=float))
    problems = [
        Problem(name, f"{value!r}", "a whole number, at least 1")
        for name, value in (("budget", budget), ("repetitions", repetitions))
        if not isinstance(value, (int, np.integer)) or value < 1
    ]
    if not levels.size or not np.all(np.isfinite(levels) & (levels > 0.0)):
        problems.append(Problem("noise_mm", f"{noise_mm}", "above 0, in mm"))
    chosen = [_with_budget(assessor, budget) for assessor in assessors]
    names = [getattr(assessor, "name", type(assessor).__name__) for assessor in chosen]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        problems.append(Problem("assessors", f"{', '.join(twice)} occurs twice", "a name each"))
    if problems:
        raise InputError(problems)
    visits = Visits(budget, "sequence")
    rows = []
    for noise in levels.tolist():
        for repetition in range(repetitions):
            world = world_of(error_mm, noise, repetition, visits, seed)
            rows += [assessed_row(noise, repetition, assessor, world) for assessor in chosen]
    table = pd.DataFrame(rows)
    bounds = ["lower_mm", "upper_mm", "bounded_mm"]
    return table.astype(dict.fromkeys(bounds, float))


def _with_budget(assessor, budget: int):
    """The assessor with its field ``measurements`` set to the budget, where it has one."""
    if not dataclasses.is_dataclass(assessor) or not hasattr(assessor, "measurements"):
        return assessor
    return dataclasses.replace(assessor, measurements=budget)
