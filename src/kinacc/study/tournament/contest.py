"""Campaigns of every assessor in every cell: field, candidates, noise, budget, repetition.

One repetition of a field, candidate count and noise is one world: the candidates drawn, their order
and every reading are fixed by (seed, field, candidates, noise, repetition). All assessors and
budgets see that world, whatever part of the work it is simulated in.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.contract import columns_of
from kinacc.assess.random_numbers import key_of
from kinacc.assess.registry import ASSESSORS
from kinacc.assess.simulate import Assessed, assessed, is_broken, truth_mm
from kinacc.assess.statement import REGION, Statement
from kinacc.assess.world import World, drawn_world
from kinacc.errors import InputError, Problem
from kinacc.study.tournament import summary
from kinacc.study.tournament.fields import ErrorField

NM_PER_MM = 1_000_000
CONTESTANTS = tuple(ASSESSORS)
_TEXTS = ("field", "assessor", "target", "assumption")


@dataclass(frozen=True)
class Size:
    """How large a tournament is.

    ``budgets`` by number of candidates; ``repetitions`` of every cell, and ``repetitions_slow`` for
    assessors that take more than 50 ms; ``draws``: accepted draws of which every synthetic family
    is made.
    """

    noise_mm: tuple[float, ...]
    budgets: dict[int, tuple[int, ...]]
    repetitions: int
    repetitions_slow: int
    draws: tuple[int, ...]

    def only(self, noise_mm: Sequence[float]) -> Size:
        """The same with this noise alone, of its own; with all of it where none is given."""
        unknown = [each for each in noise_mm if each not in self.noise_mm]
        if unknown:
            allowed = ", ".join(f"{each:g}" for each in self.noise_mm)
            raise InputError([Problem("noise_mm", f"{each:g}", allowed) for each in unknown])
        return replace(self, noise_mm=tuple(noise_mm) or self.noise_mm)


SIZES = {
    "default": Size((0.05, 0.1, 0.2, 0.3), {200: (50, 200), 1000: (200,)}, 20, 6, (0,)),
    "coverage": Size((0.05, 0.1, 0.2, 0.3), {200: (200,)}, 1000, 200, (0,)),
    "budgets": Size((0.1,), {200: (50, 100, 500), 1000: (200,)}, 200, 200, (0,)),
    "full": Size(
        (0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        {200: (50, 100, 200, 500, 1000), 1000: (50, 200, 500, 1000)},
        1000,
        200,
        (0, 1),
    ),
}


@dataclass(frozen=True)
class Contest:
    """Who takes part in how large a tournament.

    ``study``: settings that assessors share with the configuration's section of that name.
    """

    size: Size
    seed: int
    assessors: tuple[str, ...]
    study: Mapping[str, object]

    @classmethod
    def of(cls, settings: Mapping) -> Contest:
        """The contest of a stage's settings: all assessors and noises where none is named."""
        size = SIZES[settings["size"]].only(settings["noise_mm"])
        names = tuple(settings["assessors"]) or CONTESTANTS
        return cls(size, settings["seed"], names, settings["study"])


@dataclass(frozen=True)
class Cell:
    """One field at one candidate count and noise: what a world belongs to."""

    field: ErrorField
    candidates: int
    noise_mm: float


def cells(fields: Sequence[ErrorField], size: Size) -> Iterator[Cell]:
    """Every cell that the fields are large enough for; a small field counts as it is."""
    for field in fields:
        for count in sorted({min(each, field.points) for each in size.budgets}):
            if count in size.budgets or count < min(size.budgets):
                yield from (Cell(field, count, noise) for noise in size.noise_mm)


def _listed(size: Size, candidates: int) -> int:
    """The candidate count whose budgets are used: the smallest listed for a small field."""
    return candidates if candidates in size.budgets else min(size.budgets)


@dataclass(frozen=True)
class Job:
    """All campaigns of one cell with one budget: what a part of the work consists of."""

    cell: Cell
    budget: int


def jobs(fields: Sequence[ErrorField], size: Size) -> list[Job]:
    """Every job of a tournament, in a fixed order."""
    return [
        Job(cell, budget)
        for cell in cells(fields, size)
        for budget in size.budgets[_listed(size, cell.candidates)]
    ]


def part_of(work: Sequence[Job], number: int, of: int) -> Sequence[Job]:
    """Jobs of part ``number`` (1-based) of ``of``."""
    if not 1 <= number <= of:
        raise InputError(Problem("part", f"{number} of {of}", "1 up to the number of parts"))
    return work[number - 1 :: of]


def summed(work: Sequence[Job], contest: Contest, progress=None) -> Columns:
    """Summary of every job: rows as in :func:`kinacc.study.tournament.summary.summed`.

    ``progress(iterable, what, total)`` reports. The campaigns themselves are not kept.
    """
    found: list[dict] = []
    size = contest.size
    for job in progress(work, "kinds of campaigns simulated", len(work)) if progress else work:
        for count, is_slow in ((size.repetitions, False), (size.repetitions_slow, True)):
            own = tuple(each for each in contest.assessors if ASSESSORS[each].is_slow == is_slow)
            if own:
                some = replace(contest, assessors=own)
                found += summary.cells(campaigns(job, range(count), some)[0])
    return columns_of("tournament_chunk", found)


def times_ms(job: Job, contest: Contest) -> dict[str, float]:
    """Processor time of one campaign of every assessor, median of three, after one to warm up."""
    found = {}
    for name in contest.assessors:
        _, times = campaigns(job, range(4), replace(contest, assessors=(name,)))
        found[name] = float(np.median(times[1:]))
    return found


def campaigns(
    job: Job, repetitions: Iterable[int], contest: Contest
) -> tuple[Columns, list[float]]:
    """Statements of the campaigns of one job, and the processor time of each campaign in ms.

    Statements: one row per campaign and statement, with the truth it is graded against. Times are
    kept apart, for they differ from run to run.
    """
    rows: list[dict] = []
    times: list[float] = []
    cell, settings = job.cell, {**contest.study, "measurements": job.budget}
    for repetition in repetitions:
        place = {
            "field": cell.field.name,
            "candidates": cell.candidates,
            "noise_mm": cell.noise_mm,
            "budget": job.budget,
            "repetition": repetition,
        }
        world, chosen = world_of(cell, repetition, job.budget, contest.seed)
        for name in contest.assessors:
            own = {**place, "assessor": name}
            begun = time.process_time()
            found = assessed(name, settings, world, **cell.field.known(chosen))
            times.append(1e3 * (time.process_time() - begun))
            rows += [{**own, **graded} for graded in _graded(found, world, cell.field)]
    kinds = {name: object if name in _TEXTS else None for name in rows[0]} if rows else {}
    return {name: np.array([row[name] for row in rows], kinds[name]) for name in kinds}, times


def world_of(cell: Cell, repetition: int, visits: int, seed: int) -> tuple[World, np.ndarray]:
    """The world of one repetition, ``visits`` readings of each point, and its rows of the field.

    A campaign may spend its whole budget on one point; so the budget is what ``visits`` should be.
    """
    noise_nm = round(cell.noise_mm * NM_PER_MM)
    entropy = (seed, zlib.crc32(cell.field.name.encode()), cell.candidates, noise_nm, repetition)
    chosen = cell.field.candidates(cell.candidates, entropy)
    error_mm = cell.field.error_mm[chosen]
    return drawn_world(error_mm, cell.noise_mm, key_of(*entropy), visits), chosen


def _graded(found: Assessed, world: World, field: ErrorField) -> list[dict]:
    """The statements of one campaign, each with its truth."""
    size = np.linalg.norm(world.error_mm, axis=1)
    return [
        {
            "target": each.target,
            "true_mm": _truth(each, size, found.visited, field),
            "value_mm": each.value_mm,
            "lower_mm": each.lower_mm,
            "upper_mm": each.upper_mm,
            "confidence": each.confidence,
            "assumption": _assumption(each, size),
            "measurements": found.measurements,
            "points_visited": found.points_visited,
        }
        for each in found.statements
    ]


def _truth(
    said: Statement, size: np.ndarray, visited: list[int] | None, field: ErrorField
) -> float:
    """What a statement is graded against; of the region: what its share does not exceed."""
    if said.target != REGION:
        return truth_mm(said, size, visited)
    return float(np.quantile(field.size_mm, said.share, method="inverted_cdf"))


def _assumption(said: Statement, size: np.ndarray) -> str:
    """Whether what a statement rests on is true of the field: none, holds, broken or unknown."""
    if said.assumption is None:
        return "none"
    if "crowd" not in said.assumption.numbers:
        return "unknown"
    return "broken" if is_broken(said, size) else "holds"
