"""Campaigns of every assessor in every cell: field, candidates, noise, budget, setup, condition.

One repetition of a field, candidate count and noise is one world: the candidates drawn, their order
and every reading are fixed by (seed, field, candidates, noise, repetition). All assessors and
budgets see that world, whatever part of the work it is simulated in. In other conditions than
stated its readings are changed, the chance in them is the same.
"""

from __future__ import annotations

import dataclasses
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinacc.assess.adaptive import Campaign, Candidates
from kinacc.assess.attainable import NONE, limits_of
from kinacc.assess.registry import ADAPTIVE, ASSESSORS, RECOMMENDED
from kinacc.assess.statement import CANDIDATES, REGION, Reason, Statement
from kinacc.assess.world import (
    World,
    assess_world,
    carry_on,
    drawn_world,
    error_vectors,
    key_of,
    truth_mm,
)
from kinacc.config.records import of_section
from kinacc.study.fields import ErrorField, of_measurements
from kinacc.tables import store
from research import verdicts
from research.conditions import CONDITIONS, STATED, Course
from research.made_up_fields import ARMS, MADE_UP, made_up, synthetic

NM_PER_MM = 1_000_000
CONTESTANTS = tuple(ASSESSORS)
LIMITED = 20  # campaigns of a cell whose limits are computed: what worlds differ by is small


@dataclass(frozen=True)
class Setup:
    """Settings that assessors have in some worlds: names of how readings come about.

    An assessor without one of the ``settings`` takes no part, nor does one that looks back where
    readings are not as stated. ``least``: smallest budget that the settings are good for.
    """

    name: str = "plain"
    settings: Mapping[str, object] = dataclasses.field(default_factory=dict)
    worlds: tuple[str, ...] = (STATED,)
    least: int = 1

    def takes(self, assessor: str, world: str) -> bool:
        """Whether an assessor takes part in a world with these settings."""
        if world != STATED and assessor not in ADAPTIVE:
            return False
        return set(self.settings) <= {each.name for each in dataclasses.fields(ASSESSORS[assessor])}


@dataclass(frozen=True)
class Size:
    """How large a tournament is.

    ``budgets`` by number of candidates; ``repetitions`` of every cell; ``draws``: accepted draws of
    which every synthetic family is made; ``made_up``: names of fields that are made up; ``setups``:
    settings, and worlds in which they are tried; ``assessors``: who takes part where nobody is
    named.
    """

    noise_mm: tuple[float, ...]
    budgets: dict[int, tuple[int, ...]]
    repetitions: int
    draws: tuple[int, ...]
    made_up: tuple[str, ...] = ()
    setups: tuple[Setup, ...] = (Setup(),)
    assessors: tuple[str, ...] = CONTESTANTS


SETUPS = (
    Setup(
        worlds=("stated", "noise_1.2", "student_t4", "student_t4_whole", "wrong_1pct", "drift_3",
                "step_3", "repeatability"),
    ),
    Setup(
        "estimated",
        {"noise": "estimated"},
        ("stated", "noise_1.2", "student_t4", "student_t4_whole", "repeatability"),
    ),
    Setup("tested", {"noise": "estimated", "noise_freedom": 60}, ("tested_60",)),
    Setup("guarded", {"wrong_rate": 0.01}, ("stated", "wrong_1pct")),
    Setup("references", {"references": 20}, ("stated", "drift_3", "step_3"), 100),
    Setup("visit", {"error_of": "visit"}, ("stated",)),
    Setup("visit_estimated", {"error_of": "visit", "noise": "estimated"}, ("stated", "noise_1.2")),
)  # fmt: skip

SIZES = {
    "smoke": Size((0.1, 0.2), {50: (200,)}, 20, (), ("even",)),
    "default": Size((0.05, 0.1, 0.2, 0.3), {200: (50, 200), 1000: (200,)}, 20, (0,)),
    "coverage": Size((0.05, 0.1, 0.2, 0.3), {200: (200,)}, 1000, (0,)),
    "budgets": Size((0.1,), {200: (50, 100, 500), 1000: (200,)}, 200, (0,)),
    "workshop": Size(
        (0.1,),
        {200: (200, 300, 400)},
        2000,
        (),
        tuple(MADE_UP),
        SETUPS,
        (RECOMMENDED,),
    ),
    "full": Size(
        (0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        {200: (50, 100, 150, 200, 300, 400, 500, 1000), 1000: (50, 200, 500, 1000, 1500)},
        2000,
        (0, 1),
        tuple(MADE_UP),
        SETUPS,
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


def contested(folders: Sequence[str | Path], size: Size) -> list[ErrorField]:
    """Every field: of results folders of kinacc, of synthetic families, and those made up."""
    found: list[ErrorField] = [field_of(Path(each)) for each in folders]
    found += [synthetic(each, draw, ARMS[each]) for each in ARMS for draw in size.draws]
    return found + [made_up(name) for name in size.made_up]


def field_of(folder: Path) -> ErrorField:
    """Held-out errors of a measured arm, or errors at the operating points of a synthetic one."""

    def table(name: str) -> Mapping[str, np.ndarray]:
        return store.read(folder / f"{name}.parquet")

    if (folder / "data_check.parquet").is_file():  # of measured files alone
        return of_measurements(folder.name, table("pose_errors"))
    return ErrorField(folder.name, error_vectors(table("assessment_points")))


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
    """All campaigns of one cell with one budget: what a part of the work consists of.

    ``setup``: what assessors are told; ``world``: how readings come about.
    """

    cell: Cell
    budget: int
    setup: Setup = Setup()
    world: str = STATED


def jobs(fields: Sequence[ErrorField], size: Size) -> list[Job]:
    """Every job of a tournament, in a fixed order."""
    return [
        Job(cell, budget, setup, world)
        for cell in cells(fields, size)
        for budget in size.budgets[_listed(size, cell.candidates)]
        for setup in size.setups
        for world in setup.worlds
        if budget >= setup.least
    ]


def summed(work: Sequence[Job], contest: Contest) -> pd.DataFrame:
    """Summary of every job: rows as in :func:`research.verdicts.cells`.

    The campaigns themselves are not kept.
    """
    found: list[pd.DataFrame] = []
    for job in work:
        for name in (each for each in contest.assessors if job.setup.takes(each, job.world)):
            alone = replace(contest, assessors=(name,))
            found.append(verdicts.cells(campaigns(job, range(contest.size.repetitions), alone)))
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame()


class Assessed(NamedTuple):
    """What an assessor says in the end, what it took; rows read (None: it looks back); alarms."""

    statements: tuple[Statement, ...]
    measurements: int
    points_visited: int
    visited: list[int] | None
    alarms: tuple[Reason, ...] = ()


def conduct(assessor, world: World, condition: str = STATED) -> Campaign:
    """Run a campaign to its end on the readings of a world.

    ``condition``: how readings come about, a name of :data:`research.conditions.CONDITIONS`.
    """
    course = Course(CONDITIONS[condition], world, assessor.measurements)
    campaign = assessor.begin(Candidates.with_equal_noise(course.stated_mm()))
    carry_on(campaign, world.reading_mm if condition == STATED else course.reading_mm)
    return campaign


def assessed(
    name: str,
    settings: Mapping[str, object],
    world: World,
    condition: str = STATED,
) -> Assessed:
    """What an assessor says of a world, whichever its interface.

    ``settings``: values of which it takes those that it has. One that looks back has readings as
    stated, whatever the ``condition``.
    """
    assessor = of_section(ASSESSORS[name], settings)
    if name in ADAPTIVE:
        campaign = conduct(assessor, world, condition)
        taken, rows = campaign.ledger.taken, campaign.ledger.visited
        return Assessed(campaign.statements(), taken, len(rows), rows, campaign.alarms())
    found, _ = assess_world(assessor, world, assessor.measurements)
    said = Statement(CANDIDATES, found.assessed_mm)
    return Assessed((said,), found.measurements, found.points_visited, None)


def campaigns(job: Job, repetitions: Iterable[int], contest: Contest) -> pd.DataFrame:
    """One row per campaign and statement, with the truth it is graded against."""
    rows: list[dict] = []
    cell = job.cell
    settings = {**contest.study, "measurements": job.budget, **job.setup.settings}
    for repetition in repetitions:
        place = {
            "field": cell.field.name,
            "candidates": cell.candidates,
            "noise_mm": cell.noise_mm,
            "budget": job.budget,
            "setup": job.setup.name,
            "world": job.world,
            "repetition": repetition,
        }
        world = world_of(cell, repetition, job.budget, contest.seed)
        size_mm = np.linalg.norm(world.error_mm, axis=1)
        for name in contest.assessors:
            own = {**place, "assessor": name}
            found = assessed(name, settings, world, job.world)
            graded = _graded(found, world, cell.field, job)
            for each, said in zip(graded, found.statements, strict=True):
                limits = NONE
                if repetition < LIMITED:
                    visited = found.visited or ()
                    limits = limits_of(said, visited, size_mm, world.sigma_mm, job.budget)
                each |= {"attainable_mm": limits.attainable_mm, "proven_mm": limits.proven_mm}
                rows.append({**own, **each})
    return pd.DataFrame(rows)


def world_of(cell: Cell, repetition: int, visits: int, seed: int) -> World:
    """The world of one repetition, ``visits`` readings of each point.

    A campaign may spend its whole budget on one point; so the budget is what ``visits`` should be.
    """
    noise_nm = round(cell.noise_mm * NM_PER_MM)
    entropy = (seed, zlib.crc32(cell.field.name.encode()), cell.candidates, noise_nm, repetition)
    error_mm = cell.field.error_mm[candidates(cell.field, cell.candidates, entropy)]
    return drawn_world(error_mm, cell.noise_mm, key_of(*entropy), visits)


def candidates(field: ErrorField, count: int, entropy: tuple[int, ...]) -> np.ndarray:
    """Rows of ``count`` configurations drawn without replacement, in random order.

    The first of a field that is made up, as many as it keeps, are among them.
    """
    rng = np.random.default_rng([*entropy, 0])
    kept = MADE_UP[field.name].kept if field.name in MADE_UP else 0
    if not kept:
        return rng.permutation(field.points)[:count]
    others = kept + rng.permutation(field.points - kept)
    return rng.permutation(np.append(np.arange(kept), others)[:count])


def _graded(found: Assessed, world: World, field: ErrorField, job: Job) -> list[dict]:
    """The statements of one campaign, each with its truth."""
    size = np.linalg.norm(world.error_mm, axis=1)
    own_mm = job.setup.settings.get("arm_mm")
    arm_mm = CONDITIONS[job.world].factor * world.sigma_mm if own_mm is None else own_mm
    return [
        {
            "target": each.target,
            "true_mm": _truth(replace(each, excepted=0), size, found.visited, field, arm_mm),
            "bounded_mm": _truth(each, size, found.visited, field, arm_mm),
            "value_mm": each.value_mm,
            "lower_mm": each.lower_mm,
            "upper_mm": each.upper_mm,
            "confidence": each.confidence,
            "excepted": each.excepted,
            "alarmed": bool(found.alarms),
            "assumption": _assumption(each, size),
            "measurements": found.measurements,
            "points_visited": found.points_visited,
        }
        for each in found.statements
    ]


def _truth(
    said: Statement, size: np.ndarray, visited: list[int] | None, field: ErrorField, arm_mm
) -> float:
    """What an upper bound is graded against; of the region: what its share does not exceed."""
    if said.target != REGION:
        return truth_mm(said, size, visited, arm_mm)
    return float(np.quantile(field.size_mm, said.share, method="inverted_cdf"))


def _assumption(said: Statement, size: np.ndarray) -> str:
    """Whether what a statement rests on is true of the field: none, holds, broken or unknown."""
    if said.assumption is None:
        return "none"
    known = said.assumption.numbers
    if "crowd" not in known:
        return "unknown"
    company = np.sum(size >= size.max() / known["isolation"])
    return "broken" if company < known["crowd"] else "holds"
