"""The Monte Carlo study of the assessors over noise and repetitions (section IV-C, Fig. 4).

Every simulation is one world, and every assessor sees that same world. Its readings are addressed
by (seed, noise in nm, repetition, point, visit): a key from
``numpy.random.SeedSequence([seed, noise_nm, repetition])`` and a counter (visit, point). So a
simulation does not depend on which others run, in which part, in which order or on how many cores;
the first reading of a point is the same number for all assessors, and its v-th repeat is the same
whatever led there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from kinacc.assess.assessor import Assessor, every_reading
from kinacc.assess.registry import PAPER as ASSESSORS
from kinacc.assess.simulate import assess_world
from kinacc.assess.world import World, checked_errors, draw, error_vectors
from kinacc.config.records import of_section
from kinacc.errors import InputError, Problem
from kinacc.tables.columns import Columns
from kinacc.tables.contract import ARTEFACTS, columns_of

NM_PER_MM = 1_000_000
SWITCHES = tuple(switch for cls in ASSESSORS.values() for switch in cls.switches)
_SHUFFLE = 1  # keeps the key of the order apart from the key of the readings


@dataclass(frozen=True)
class Visits:
    """How a simulation spends its budget of ``measurements``.

    visiting_order: ``sequence`` (points in the order given) or ``shuffled`` (an order of its own
    for every simulation).
    """

    measurements: int
    visiting_order: str


@dataclass(frozen=True)
class StudySettings(Visits):
    """The simulations: noise_mm, standard deviations per axis; repetitions at each of them."""

    noise_mm: tuple[float, ...]
    repetitions: int


def assessors(section: Mapping[str, object], all_readings: bool = True) -> list[Assessor]:
    """The paper's assessors by the configuration's ``study``, in the order of the paper.

    Each under every reading of the paper (see :mod:`kinacc.assess`), or only the one configured.
    """
    if all_readings:
        return [assessor for cls in ASSESSORS.values() for assessor in every_reading(cls, section)]
    return [of_section(cls, section) for cls in ASSESSORS.values()]


def part_of(repetitions: int, number: int, of: int) -> range:
    """Repetitions of part ``number`` (1-based) of ``of``: every of-th, so that parts take alike."""
    if not 1 <= number <= of:
        raise InputError(Problem("part", f"{number} of {of}", "1 up to the number of parts"))
    return range(number - 1, repetitions, of)


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
    from kinacc.assess.random_numbers import key_of

    entropy = (seed, round(float(noise_mm) * NM_PER_MM), repetition)
    order = np.arange(error_mm.shape[0])
    if visits.visiting_order == "shuffled":
        order = np.random.default_rng([*entropy, _SHUFFLE]).permutation(order)
    order = order[: visits.measurements]
    sigma = np.full(order.size, float(noise_mm))
    return draw(error_mm[order], sigma, key_of(*entropy), visits.measurements, order)


def simulate(
    error_mm: ArrayLike,
    noise_mm: Sequence[float],
    repetitions: Iterable[int],
    visits: Visits,
    seed: int,
    assessors: Sequence[Assessor],
    progress=None,
) -> Columns:
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
    assessors : sequence of Assessor
        All see the same worlds.
    progress : callable, optional
        ``progress(iterable, what, total)`` reports on the simulations.

    Returns
    -------
    dict
        Columns of ``study_chunk``, one row per noise, repetition and assessor.

    Raises
    ------
    InputError
        For errors of the wrong shape or not finite.
    """
    errors = checked_errors(error_mm)
    jobs = [(noise, repetition) for noise in noise_mm for repetition in repetitions]
    rows = []
    for noise, repetition in progress(jobs, "simulations", len(jobs)) if progress else jobs:
        world = world_of(errors, noise, repetition, visits, seed)
        for assessor in assessors:
            switches = {switch: getattr(assessor, switch, None) for switch in SWITCHES}
            row = assessed_row(noise, repetition, assessor, world)
            row.pop("bounded_mm")
            rows.append({**row, **switches})
    return ordered(columns_of("study_chunk", rows))


def assessed_row(noise_mm: float, repetition: int, assessor, world: World) -> dict:
    """One assessment, with the size that its upper bound is held to (``bounded_mm``)."""
    assessment, bounded_mm = assess_world(assessor, world, world.visits)
    name = getattr(assessor, "name", type(assessor).__name__)
    place = {"noise_mm": noise_mm, "repetition": repetition, "assessor": name}
    return {**place, **assessment._asdict(), "bounded_mm": bounded_mm}


def ordered(rows: Columns) -> Columns:
    """Rows by noise, repetition, assessor (as in the paper) and switches (alphabetically)."""
    ranks = {name: rank for rank, name in enumerate(ASSESSORS)}
    keys = [np.array([ranks[name] for name in rows["assessor"]], np.int64)]
    for switch in SWITCHES:
        keys.append(np.array(["" if value is None else value for value in rows[switch]], str))
    keys = [rows["noise_mm"], rows["repetition"], *keys]
    order = np.lexsort(keys[::-1])
    return {name: np.asarray(column)[order] for name, column in rows.items()}


def default_reading(rows: Columns, section: Mapping[str, object]) -> Columns:
    """The rows of the reading that the section ``study`` names: the columns of ``study``."""
    keep = np.ones(rows["noise_mm"].size, bool)
    for switch in SWITCHES:
        keep &= np.array([value in (None, section[switch]) for value in rows[switch]], bool)
    return {name: column[keep] for name, column in rows.items() if name not in SWITCHES}


def statistics(rows: Columns | pd.DataFrame, keys: Sequence[str], true_mm: float) -> pd.DataFrame:
    """Statistics of ``assessed_mm`` over the rows that agree in the key columns, a row each.

    Columns mean_mm, min_mm, max_mm, bias_mm and rmse_mm against the true accuracy, repetitions and
    std_error_mm of the mean (NaN of one value).
    """
    frame = pd.DataFrame(dict(rows))
    frame["square"] = (frame["assessed_mm"] - true_mm) ** 2
    groups = frame.groupby(list(keys), sort=False, dropna=False)
    chosen = {"mean_mm": "mean", "min_mm": "min", "max_mm": "max"}
    table = groups["assessed_mm"].agg(**chosen, repetitions="size", std_error_mm="sem")
    table["bias_mm"] = table["mean_mm"] - true_mm
    table["rmse_mm"] = np.sqrt(groups["square"].mean())
    return table.reset_index()


def summary(study: Columns, true_mm: float) -> Columns:
    """Columns of ``study_summary``: each assessor and noise against the true accuracy (mm)."""
    return _by_assessor("study_summary", study, ["assessor", "noise_mm"], true_mm)


def readings(rows: Columns, true_mm: float) -> Columns:
    """Columns of ``readings``: every reading of the assessors that have more than one."""
    keep = np.array([bool(ASSESSORS[name].switches) for name in rows["assessor"]], bool)
    chosen = {name: column[keep] for name, column in rows.items()}
    return _by_assessor("readings", chosen, ["assessor", *SWITCHES, "noise_mm"], true_mm)


def _by_assessor(artefact: str, rows: Columns, keys: list[str], true_mm: float) -> Columns:
    """Columns of an artefact, by assessor as in the paper, then by the other keys."""
    table = statistics(rows, keys, true_mm)
    rank = table["assessor"].map(list(ASSESSORS).index)
    table = table.assign(rank=rank).sort_values(["rank", *keys[1:]], kind="stable")
    known = [column.name for column in ARTEFACTS[artefact].columns]
    table = table[[name for name in known if name in table]].astype(object)
    return columns_of(artefact, table.where(table.notna(), None).to_dict("records"))


def true_accuracy_mm(true_error_mm: ArrayLike) -> float:
    """True accuracy of a set of points (eq. 7): the largest magnitude of their true errors."""
    values = np.asarray(true_error_mm, dtype=np.float64)
    if values.size == 0 or not np.all(np.isfinite(values)):
        raise InputError(
            Problem("true_error_mm", "no values, or values that are not finite", "numbers in mm")
        )
    return float(values.max())


def simulated(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, dict]:
    """Return ``study_chunk`` for ``settings["part"]`` (default: all repetitions).

    ``settings["all_readings"]`` false: the reading that ``study`` names alone;
    ``settings["only"]``: the repetitions simulated.
    """
    points = inputs["assessment_points"]
    study = of_section(StudySettings, settings["study"])
    part = settings.get("part") or {"number": 1, "of": 1}
    error_mm = error_vectors(points)
    repetitions = settings.get("only") or part_of(study.repetitions, part["number"], part["of"])
    rows = simulate(
        error_mm,
        study.noise_mm,
        repetitions,
        study,
        settings["seed"],
        assessors(settings["study"], settings.get("all_readings", True)),
        progress,
    )
    return {"study_chunk": rows}


def summed_up(inputs: Mapping, settings: Mapping) -> dict[str, dict]:
    """Return ``study``, ``study_summary`` and ``readings``."""
    true_mm = true_accuracy_mm(inputs["assessment_points"]["true_error_mm"])
    rows = ordered(inputs["study_chunk"])
    default = default_reading(rows, settings["study"])
    return {
        "study": default,
        "study_summary": summary(default, true_mm),
        "readings": readings(rows, true_mm),
    }
