"""Campaigns of every assessor in every cell: field, candidates, noise, budget, repetition.

One repetition of a field, candidate count and noise is one world: the candidates drawn, their order
and every reading are fixed by (seed, field, candidates, noise, repetition). All assessors and
budgets see that world, whatever part of the work it is simulated in.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.assess import ASSESSORS
from kinacc.assess.adaptive import conduct
from kinacc.assess.registry import ADAPTIVE
from kinacc.assess.statement import CANDIDATES, MEASURED, Statement
from kinacc.assess.streams import key_of
from kinacc.assess.world import World, drawn_world
from kinacc.errors import InputError, Problem
from kinacc.tournament.fields import Field

Columns = dict[str, np.ndarray]
NM_PER_MM = 1_000_000


@dataclass(frozen=True)
class Size:
    """How large a tournament is.

    ``budgets`` by number of candidates; ``repetitions`` of every cell; ``draws``: accepted draws
    of which every synthetic family is made.
    """

    noise_mm: tuple[float, ...]
    budgets: dict[int, tuple[int, ...]]
    repetitions: int
    draws: tuple[int, ...]


SIZES = {
    "default": Size((0.05, 0.1, 0.2, 0.3), {200: (50, 200), 1000: (200,)}, 20, (0,)),
    "full": Size(
        (0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        {200: (50, 100, 200, 500, 1000), 1000: (50, 200, 500, 1000)},
        1000,
        (0, 1, 2),
    ),
}


@dataclass(frozen=True)
class Cell:
    """One field at one candidate count and noise: what a world belongs to."""

    field: Field
    candidates: int
    noise_mm: float


def cells(fields: Sequence[Field], size: Size) -> Iterator[Cell]:
    """Every cell that the fields are large enough for."""
    for field in fields:
        for count in size.budgets:
            if count <= field.points:
                yield from (Cell(field, count, noise) for noise in size.noise_mm)


def part_of(repetitions: int, number: int, of: int) -> range:
    """Repetitions of part ``number`` (1-based) of ``of``."""
    if not 1 <= number <= of:
        raise InputError(Problem("part", f"{number} of {of}", "1 up to the number of parts"))
    return range(number - 1, repetitions, of)


def simulate(
    fields: Sequence[Field],
    size: Size,
    repetitions: Iterable[int],
    seed: int,
    progress=None,
    assessors: Sequence[str] = (*ASSESSORS, *ADAPTIVE),
) -> tuple[Columns, Columns]:
    """Statements and times of all campaigns; ``progress(iterable, what, total)`` reports.

    Statements: one row per campaign and statement, with the truth it is graded against. Times are
    kept apart, for they differ from run to run.
    """
    jobs = [(cell, each) for cell in cells(fields, size) for each in repetitions]
    rows: list[dict] = []
    times: list[dict] = []
    for cell, repetition in progress(jobs, "worlds", len(jobs)) if progress else jobs:
        for budget in size.budgets[cell.candidates]:
            # A world is drawn anew for every budget, so that a campaign can exhaust one point.
            place = {
                "field": cell.field.name,
                "candidates": cell.candidates,
                "noise_mm": cell.noise_mm,
                "budget": budget,
                "repetition": repetition,
            }
            world = world_of(cell, repetition, budget, seed)
            for name in assessors:
                own = {**place, "assessor": name}
                begun = time.perf_counter()
                campaign = _campaign(name, world, budget)
                times.append({**own, "time_ms": 1e3 * (time.perf_counter() - begun)})
                rows += [{**own, **graded} for graded in campaign]
    return _columns(rows, ROW_KINDS), _columns(times, TIME_KINDS)


def world_of(cell: Cell, repetition: int, visits: int, seed: int) -> World:
    """The world of one repetition: candidates in random order, ``visits`` readings of each."""
    noise_nm = round(cell.noise_mm * NM_PER_MM)
    entropy = (seed, zlib.crc32(cell.field.name.encode()), cell.candidates, noise_nm, repetition)
    chosen = cell.field.candidates(cell.candidates, entropy)
    return drawn_world(cell.field.error_mm[chosen], cell.noise_mm, key_of(*entropy), visits)


def _campaign(name: str, world: World, budget: int) -> list[dict]:
    """The statements of one campaign, each with its truth."""
    size = np.linalg.norm(world.error_mm, axis=1)
    if name in ASSESSORS:
        found = ASSESSORS[name](measurements=budget).assess(world)
        said = Statement(CANDIDATES, found.assessed_mm)
        return [_graded(said, size, float("nan"), found.measurements, found.points_visited)]
    campaign = conduct(ADAPTIVE[name](measurements=budget), world)
    taken, visited = campaign.taken()
    largest = float(size[visited].max())
    return [_graded(each, size, largest, taken, len(visited)) for each in campaign.statements()]


def _graded(said: Statement, size: np.ndarray, measured: float, taken: int, visited: int) -> dict:
    truth = {CANDIDATES: float(size.max()), MEASURED: measured}.get(said.target)
    if truth is None:
        truth = float(np.quantile(size, said.share, method="higher"))
    return {
        "target": said.target,
        "true_mm": truth,
        "value_mm": said.value_mm,
        "lower_mm": said.lower_mm,
        "upper_mm": said.upper_mm,
        "confidence": said.confidence,
        "withheld": said.withheld or None,
        "assumption": _assumption(said, size),
        "measurements": taken,
        "points_visited": visited,
    }


def _assumption(said: Statement, size: np.ndarray) -> str:
    """Whether what a statement rests on is true of the field: none, holds, broken or unknown."""
    if not said.assumption:
        return "none"
    if not said.crowd:
        return "unknown"
    company = int(np.sum(size >= size.max() / said.isolation))
    return "holds" if company >= said.crowd else "broken"


ROW_KINDS = {
    "field": object,
    "candidates": np.int64,
    "noise_mm": float,
    "budget": np.int64,
    "repetition": np.int64,
    "assessor": object,
    "target": object,
    "true_mm": float,
    "value_mm": float,
    "lower_mm": float,
    "upper_mm": float,
    "confidence": float,
    "withheld": object,
    "assumption": object,
    "measurements": np.int64,
    "points_visited": np.int64,
}
TIME_KINDS = {name: ROW_KINDS[name] for name in [*ROW_KINDS][:6]} | {"time_ms": float}


def _columns(rows: list[dict], kinds: dict[str, type]) -> Columns:
    return {name: np.array([row[name] for row in rows], kind) for name, kind in kinds.items()}
