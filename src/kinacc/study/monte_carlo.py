"""Simulations of assessors on known errors: the study of section IV-C (Fig. 4), and others.

Every simulation is one world, and every assessor sees that same world. Its readings are addressed
by (seed, noise in nm, repetition, point, visit): a key from
``numpy.random.SeedSequence([seed, noise_nm, repetition])`` and a counter (visit, point). So a
simulation does not depend on which others run, in which part, in which order or on how many cores;
the first reading of a point is the same number for all assessors, and its v-th repeat is the same
whatever led there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from kinacc.assess.registry import PAPER as ASSESSORS
from kinacc.assess.world import (
    Assessor,
    World,
    assess_world,
    checked_errors,
    drawn_world,
    error_vectors,
    key_of,
)
from kinacc.config.records import Settings, of_section
from kinacc.errors import Problem, refuse
from kinacc.geometry import numbers
from kinacc.progress import with_progress
from kinacc.tables.columns import Columns, Tables
from kinacc.tables.contract import columns_from

NM_PER_MM = 1_000_000
SWITCHES = tuple(switch for cls in ASSESSORS.values() for switch in cls.switches)
KEYS = ["assessor", "noise_mm"]
ORDER = ("noise_mm", "repetition", "assessor", *SWITCHES)
_SHUFFLE = 1  # keeps the key of the order apart from the key of the readings


@dataclass(frozen=True)
class Visits:
    """How a simulation spends its budget of ``measurements``.

    visiting_order: ``sequence`` (points in the order given) or ``shuffled`` (an order of its own
    for every simulation).
    """

    measurements: int
    visiting_order: str


def assessors(section: Settings, all_readings: bool = True) -> list[Assessor]:
    """The paper's assessors by the configuration's ``study``, in the order of the paper.

    Each under every combination of its switches, the readings of the paper, or only the one
    configured.
    """
    return [
        of_section(cls, {**section, **dict(zip(cls.switches, values, strict=True))})
        for cls in ASSESSORS.values()
        for values in product(
            *(
                choices if all_readings else (section[name],)
                for name, choices in cls.switches.items()
            )
        )
    ]


def world_of(
    error_mm: np.ndarray,
    noise_mm: float,
    repetition: int,
    visits: Visits,
    seed: int,
) -> World:
    """The world of one simulation: true errors (m, 3), robot base frame, mm, plus its noise.

    Holds the points the budget can reach, in visiting order.
    """
    entropy = (seed, round(float(noise_mm) * NM_PER_MM), repetition)
    order = np.arange(error_mm.shape[0])
    if visits.visiting_order == "shuffled":
        order = np.random.default_rng([*entropy, _SHUFFLE]).permutation(order)
    order = order[: visits.measurements]
    return drawn_world(error_mm, noise_mm, key_of(*entropy), visits.measurements, order)


def simulate(
    error_mm: ArrayLike,
    noise_mm: Sequence[float],
    repetitions: Iterable[int],
    visits: Visits,
    seed: int,
    assessors: Sequence[Any],
) -> pd.DataFrame:
    """Run every assessor on repetitions of each noise.

    Parameters
    ----------
    error_mm : (m, 3) array
        True errors at the operating points, mm, robot base frame.
    noise_mm : sequence of float
        Standard deviations of a reading per axis, mm.
    repetitions : iterable of int
        Numbers of the simulations.
    visits : Visits
        Budget and visiting order.
    seed : int
        Seed of the study.
    assessors : sequence
        All see the same worlds.

    Returns
    -------
    DataFrame
        A row per noise, repetition and assessor: columns of ``study_chunk``, and bounded_mm, the
        true size that the upper bound is held to.

    Raises
    ------
    InputError
        For errors of the wrong shape or not finite.
    """
    errors = checked_errors(error_mm)
    jobs = [(noise, repetition) for noise in noise_mm for repetition in repetitions]
    rows = []
    for noise, repetition in with_progress(jobs, "simulations"):
        world = world_of(errors, noise, repetition, visits, seed)
        for assessor in assessors:
            assessment, bounded_mm = assess_world(assessor, world, world.visits)
            place = {"noise_mm": noise, "repetition": repetition, "assessor": name_of(assessor)}
            switches = {switch: getattr(assessor, switch, None) for switch in SWITCHES}
            rows.append({**place, **assessment._asdict(), **switches, "bounded_mm": bounded_mm})
    return pd.DataFrame(rows).astype({"lower_mm": float, "upper_mm": float})


def name_of(assessor: object) -> str:
    """Name of an assessor in tables."""
    return str(getattr(assessor, "name", type(assessor).__name__))


def evaluate_assessors(
    errors: ArrayLike,
    assessors: Sequence[Any],
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
        of the bounds: stated (share of worlds with an upper bound), coverage (share of these whose
        upper bound holds for the points it is about), lower_coverage (share whose lower bound is
        not above the largest error), width_mm (mean of upper less lower bound). NaN where no bound
        is stated.

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
    error_mm, levels = checked_errors(errors), np.atleast_1d(numbers("noise_mm", noise_mm))
    problems = [
        Problem(name, f"{value!r}", f"a whole number, at least {least}")
        for name, value, least in (
            ("budget", budget, 1),
            ("repetitions", repetitions, 1),
            ("seed", seed, 0),
        )
        if not isinstance(value, (int, np.integer)) or value < least
    ]
    can_assess = (
        not isinstance(item, type) and (hasattr(item, "begin") or hasattr(item, "assess"))
        for item in assessors
    )
    if not assessors or not all(can_assess):
        problems.append(Problem("assessors", f"{assessors}", "objects with begin(candidates)"))
    if not levels.size or not np.all(np.isfinite(levels) & (levels > 0.0)):
        problems.append(Problem("noise_mm", f"{noise_mm}", "above 0, in mm"))
    names = [name_of(assessor) for assessor in assessors]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        problems.append(Problem("assessors", f"{', '.join(twice)} occurs twice", "a name each"))
    refuse(problems)
    chosen: list[Any] = list(assessors)
    for place, each in enumerate(chosen):
        if "measurements" in getattr(each, "__dataclass_fields__", ()):
            chosen[place] = dataclasses.replace(each, measurements=int(budget))
    visits = Visits(budget, "sequence")
    rows = simulate(error_mm, levels.tolist(), range(repetitions), visits, seed, chosen)
    truth, stated = float(np.linalg.norm(error_mm, axis=1).max()), rows["upper_mm"].notna()
    rows["coverage"] = (rows["upper_mm"] >= rows["bounded_mm"]).where(stated).astype(float)
    rows["lower_coverage"] = (rows["lower_mm"] <= truth).where(stated).astype(float)
    rows["width_mm"] = rows["upper_mm"] - rows["lower_mm"]
    rows["stated"] = stated.astype(float)
    bounds = rows.groupby(KEYS)[["stated", "coverage", "lower_coverage", "width_mm"]].mean()
    return statistics(rows, KEYS, truth).join(bounds, on=KEYS)


def ordered(rows: pd.DataFrame, keys: Sequence[str] = ORDER) -> pd.DataFrame:
    """Rows by the keys, assessors as in the paper, switches alphabetically."""
    rank = rows["assessor"].map(list(ASSESSORS).index)
    return rows.loc[rows.assign(assessor=rank).sort_values([*keys]).index]


def default_reading(rows: pd.DataFrame, section: Settings) -> pd.DataFrame:
    """The rows of the reading that the section ``study`` names: the columns of ``study``."""
    named = pd.Series({switch: section[switch] for switch in SWITCHES})
    keep = (rows[[*SWITCHES]].isna() | (rows[[*SWITCHES]] == named)).all(axis=1)
    return rows[keep].drop(columns=[*SWITCHES])


def statistics(rows: pd.DataFrame, keys: Sequence[str], true_mm: float) -> pd.DataFrame:
    """Statistics of ``assessed_mm`` over the rows that agree in the key columns, a row each.

    Columns mean_mm, min_mm, max_mm, bias_mm and rmse_mm against the true accuracy, repetitions and
    std_error_mm of the mean (NaN of one value).
    """
    rows = rows.assign(square=(rows["assessed_mm"] - true_mm) ** 2)
    groups = rows.groupby(list(keys), sort=False, dropna=False)
    chosen = {"mean_mm": "mean", "min_mm": "min", "max_mm": "max"}
    table = groups["assessed_mm"].agg(**chosen, repetitions="size", std_error_mm="sem")
    table["bias_mm"] = table["mean_mm"] - true_mm
    table["rmse_mm"] = np.sqrt(groups["square"].mean())
    return table.reset_index()


def summary(study: pd.DataFrame, true_mm: float) -> Columns:
    """Columns of ``study_summary``: each assessor and noise against the true accuracy (mm)."""
    return columns_from("study_summary", ordered(statistics(study, KEYS, true_mm), KEYS))


def readings(rows: pd.DataFrame, true_mm: float) -> Columns:
    """Columns of ``readings``: every reading of the assessors that have more than one."""
    switched = [name for name, cls in ASSESSORS.items() if cls.switches]
    rows, keys = rows[rows["assessor"].isin(switched)], ["assessor", *SWITCHES, "noise_mm"]
    return columns_from("readings", ordered(statistics(rows, keys, true_mm), keys))


def simulated(
    inputs: Tables,
    settings: Settings,
) -> Tables:
    """Return ``study_chunk`` for ``settings["part"]`` (default: all repetitions).

    ``settings["all_readings"]`` false: the reading that ``study`` names alone.
    """
    study = settings["study"]
    part = settings.get("part") or {"number": 1, "of": 1}
    # Every of-th, so that parts take alike.
    repetitions = range(part["number"] - 1, study["repetitions"], part["of"])
    rows = simulate(
        error_vectors(inputs["assessment_points"]),
        study["noise_mm"],
        repetitions,
        of_section(Visits, study),
        settings["seed"],
        assessors(study, settings.get("all_readings", True)),
    )
    return {"study_chunk": columns_from("study_chunk", ordered(rows))}


def summed_up(inputs: Tables, settings: Settings) -> Tables:
    """Return ``study``, ``study_summary`` and ``readings``."""
    true_mm = float(np.max(inputs["assessment_points"]["true_error_mm"]))
    rows = ordered(pd.DataFrame(dict(inputs["study_chunk"])))
    default = default_reading(rows, settings["study"])
    return {
        "study": columns_from("study", default),
        "study_summary": summary(default, true_mm),
        "readings": readings(rows, true_mm),
    }
