"""What ``plan-campaign`` is asked, and its answer as a sheet, a picture and in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.assess.counts import binomial_interval
from kinacc.campaign import known_noise, power, simulate, slips, words
from kinacc.campaign.power import Aim, Row
from kinacc.cli import campaign_options, rows
from kinacc.cli.sheet import Field, Sheet
from kinacc.config.error_models import PLAINEST
from kinacc.deployment.record import default_point
from kinacc.errors import InputError, Problem, gathered, refuse
from kinacc.measurements.table import numbers
from kinacc.study import fields
from kinacc.study.fields import ErrorField
from kinacc.tables.columns import Columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DEFAULT_ERRORS = ("smooth", "workshop", "defect")
SHARES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)
_DRAW = 0
_JOINTS = 6  # of arms; what the recommended assessor lacks does not depend on it
_MOST_READINGS = 50_000_000  # a gigabyte: any pose may be the one that is read again and again


@dataclass(frozen=True)
class Simulation:
    """What is simulated, and what for."""

    fields: tuple[ErrorField, ...]
    points: int
    covariance_mm2: np.ndarray
    assessors: tuple[AdaptiveAssessor, ...]
    aim: Aim
    repetitions: int
    seed: int
    remarks: tuple[str, ...] = ()


def question(given: Mapping) -> Simulation:
    """The question of the command's options. Raises InputError listing what is wrong."""
    problems: list[Problem] = []
    assessors, chosen = [], []
    named = given["errors"] or DEFAULT_ERRORS
    folders = [Path(each) for each in named if each not in fields.FAMILIES and Path(each).is_dir()]
    if given["point"] is not None and not folders:
        what = "names a target of a results folder, and --errors names no such folder"
        problems.append(Problem("--point", what, fix="leave it out, or give --errors FOLDER"))
    tested = None
    with gathered(problems):
        tested = campaign_options.tested_noise(given["repeatability"])
    with gathered(problems):
        instruments = campaign_options.instruments(
            given["noise_mm"],
            given["covariance_mm2"],
            resolution_mm=given["resolution_mm"],
            calibrations=folders,
            tested=tested,
        )
        if not given["sure"]:
            problems += [*slips.of_noise(instruments), *known_noise.doubts(tested)]
            problems += [each for path in folders for each in slips.of_repeats(instruments, path)]
    lengths = ("width_mm", "tolerance_mm", "largest_mm")
    problems += campaign_options.not_positive(**{name: given[name] for name in lengths})
    points = given["poses"]
    budgets = given["budget"] or [max(round(share * points), 2) for share in SHARES]
    if points * max(budgets) > _MOST_READINGS:
        what = f"{points} poses with up to {max(budgets)} readings each"
        allowed = f"at most {_MOST_READINGS:g}, poses times the largest budget"
        problems.append(Problem("--poses, --budget", what, allowed))
    name, *method = (given[each] for each in ("assessor", "confidence", "settings"))
    for budget in sorted(set(budgets)):
        with gathered(problems):
            asked = campaign_options.workshop(given)
            made = campaign_options.assessor(name, budget, *method, asked=asked, tested=tested)
            assessors.append(campaign_options.with_references(made, points, given["references"]))
    for errors in named:
        with gathered(problems):
            chosen.append(field_of(errors, given["point"]))
            problems += _too_few(errors, chosen[-1], points)
    refuse(dict.fromkeys(problems), "Nothing was simulated")
    if given["largest_mm"] is not None:
        chosen = [_scaled(each, given["largest_mm"]) for each in chosen]
    aim = Aim(given["target"], given["width_mm"], given["tolerance_mm"], given["power"])
    return Simulation(
        tuple(chosen),
        points,
        instruments[0].covariance_mm2,
        tuple(assessors),
        aim,
        given["repetitions"],
        given["seed"],
        tuple(f"{path}: {each}" for path in folders for each in _one_of(path, given["point"])),
    )


def _too_few(named: str, field: ErrorField, points: int) -> list[Problem]:
    """Fewer errors than poses, with the ways out; nothing where there are enough."""
    if field.points >= points:
        return []
    meaning = f" ({field.meaning})" if field.meaning else ""
    what = f"holds {field.points} errors{meaning}, fewer than {points} poses"
    fix = f"give --poses {field.points}"
    if field.kind != "synthetic":
        fix += (
            "; or simulate with a family whose largest error is the one here: --errors smooth "
            f"--largest-mm {field.size_mm.max():.3g}"
        )
    return [Problem(f"--errors {named}", what, fix=fix)]


def answer(asked: Simulation, progress: Callable | None = None) -> list[Row]:
    """Simulate."""
    found = simulate.outcomes(
        asked.fields, asked.points, asked.covariance_mm2, asked.assessors, asked.repetitions,
        asked.seed, progress, asked.aim.target,
    )  # fmt: skip
    return power.rows(found, asked.aim)


def field_of(name: str, point: str | None = None) -> ErrorField:
    """Errors by the name of a family, a results folder or a file.

    ``point``: the target of a results folder, the one a campaign would be about if not given.
    """
    path = Path(name)
    if name in fields.FAMILIES:
        return replace(fields.synthetic(name, _DRAW), name=name)
    if path.is_dir():
        return _of_folder(path, point)
    if path.is_file():
        table, problems = rows.open_table(path), []
        names = ("ex_mm", "ey_mm", "ez_mm")
        missing = [each for each in names if each not in table.columns]
        if missing:
            raise InputError(Problem(name, f"has no column {', '.join(missing)}", ", ".join(names)))
        # A point that was not measured has no error: it is no fault, and nothing to simulate with.
        measured = ~np.all([table.gaps(each) for each in names], axis=0)
        errors = np.stack([numbers(table, each, problems, gaps=True) for each in names], axis=1)
        partly = np.flatnonzero(measured & np.isnan(errors).any(axis=1))
        if partly.size and not problems:
            where = f"{name}: {table.rows_in_words(partly)}"
            problems.append(Problem(where, "an error is not complete", ", ".join(names)))
        if not measured.any():
            problems.append(Problem(name, "holds no measured error", ", ".join(names)))
        refuse(problems)
        return ErrorField(path.stem, errors[measured])
    allowed = f"a results folder, a file, {', '.join(fields.FAMILIES)}"
    raise InputError(Problem("--errors", f"{name!r} is not there", allowed))


def _of_folder(path: Path, point: str | None) -> ErrorField:
    from kinacc.tables import store

    name = path.resolve().name
    if measured := _measured(path):
        errors, seen = measured["pose_errors"], measured["measurements"]
        model, targets = _model_and_targets(measured)
        target = point or default_point(targets)
        if target not in targets:
            what = f"{target!r} is no target of {path}"
            raise InputError(Problem("--point", what, ", ".join(targets)))
        several = len(targets) > 1
        return fields.of_measurements(name, errors, seen, model, target if several else None)
    if (path / "assessment_points.parquet").is_file():
        return fields.of_points(name, store.read(path / "assessment_points.parquet"))
    what = "holds neither pose_errors with measurements nor assessment_points"
    raise InputError(Problem(str(path), what, "a results folder", "run the workflow first"))


def _measured(path: Path) -> dict[str, Columns]:
    """Tables of a results folder about what was measured; empty where it lacks one needed."""
    from kinacc.tables import store

    needed, wanted = ("pose_errors", "measurements"), ("model_selection", "frames")
    there = [each for each in (*needed, *wanted) if (path / f"{each}.parquet").is_file()]
    if not {*needed} <= {*there}:
        return {}
    return {each: store.read(path / f"{each}.parquet") for each in there}


def _model_and_targets(tables: Mapping[str, Columns]) -> tuple[str, list[str]]:
    """The model that a campaign would be about, and its targets in their order."""
    from kinacc.deployment.folder import recorded_model, targets_of

    model = recorded_model(tables) or PLAINEST
    seen = list(dict.fromkeys(np.asarray(tables["measurements"]["target"]).astype(str)))
    if "frames" not in tables:
        return model, seen
    return model, [each for each in targets_of(tables["frames"], model) if each in seen]


def _one_of(path: Path, point: str | None) -> list[str]:
    """Which of several targets of a results folder the errors are of."""
    if not (measured := _measured(path)):
        return []
    targets = _model_and_targets(measured)[1]
    return words.one_of(point or default_point(targets), targets)


def _scaled(field: ErrorField, largest_mm: float) -> ErrorField:
    largest = float(np.linalg.norm(field.error_mm, axis=1).max())
    return replace(field, error_mm=field.error_mm * (largest_mm / largest))


def as_sheet(asked: Simulation, found: list[Row]) -> Sheet:
    """One row per kind of errors and budget."""
    aim = asked.aim

    def column(make) -> np.ndarray:
        return np.array([make(row) for row in found], dtype=float)

    def finite(values: np.ndarray) -> np.ndarray:
        return np.where(np.isfinite(values), values, np.nan)

    # A screen holds no more: files have all columns.
    widths = ("median", "q95") if aim.tolerance_mm is None else ("median",)
    fields = [
        Field("errors", np.array([row.errors for row in found], dtype=object), "", "simulated"),
        Field("budget", np.array([row.budget for row in found]), "1", "readings allowed"),
        Field("readings", column(lambda row: row.readings), "1", "mean readings taken", False),
        Field("true_mm", column(lambda row: row.truth_mm), "mm", "mean largest error"),
        *(
            Field(f"width_{name}_mm", finite(column(lambda row, i=i: row.width_mm[i])), "mm",
                  "upper minus lower bound; none where no bound is stated", name in widths)
            for i, name in enumerate(("q05", "median", "q95"))
        ),
        Field("excess_mm", column(lambda row: row.excess_mm), "mm", "mean of upper minus truth"),
        Field("attainable_mm", finite(column(lambda row: row.attainable_mm)), "mm",
              "excess of the best design that knows the errors; none where it has no bound"),
        Field("proven_mm", finite(column(lambda row: row.proven_mm)), "mm",
              "excess below which no bound stays that can be relied on"),
        Field("stated", column(lambda row: row.stated), "1", "share with an upper bound"),
        Field("holds", column(lambda row: row.holds), "1",
              "share of the upper bounds that hold", False),
        Field("bounds_held", np.array([_counted(row) for row in found], dtype=object), "",
              "the same, counted"),
        Field("holds_low", column(lambda row: row.holds_interval[0]), "1", "95 % limits", False),
        Field("holds_high", column(lambda row: row.holds_interval[1]), "1", "95 % limits", False),
    ]  # fmt: skip
    if aim.width_mm is not None:
        fields += [
            Field("within", column(lambda row: row.within), "1", "share as narrow as wanted"),
            Field("within_low", column(lambda row: row.interval[0]), "1", "95 % limits", False),
            Field("within_high", column(lambda row: row.interval[1]), "1", "95 % limits", False),
        ]
    if aim.tolerance_mm is not None:
        for verdict in power.VERDICTS:
            shares = np.array([row.decisions[verdict] for row in found])
            fields.append(Field(verdict, shares, "1", "share decided so"))
    std = np.sqrt(np.diag(asked.covariance_mm2))
    facts = {
        "assessor": asked.assessors[0].name,
        "poses": asked.points,
        "noise_mm": [float(each) for each in std],
        "target": aim.target,
        "wanted_width_mm": aim.width_mm,
        "tolerance_mm": aim.tolerance_mm,
        "power": aim.power,
        "repetitions": asked.repetitions,
        "seed": asked.seed,
        "budget": power.smallest_budget(found, aim) if _aims(aim) else None,
        "budget_shown": power.smallest_budget(found, aim, shown=True) if _aims(aim) else None,
    }
    title = (
        f"{asked.assessors[0].name}: largest error of {_TARGETS[aim.target]} of {asked.points} "
        f"poses, {asked.repetitions} simulated campaigns a row"
    )
    return Sheet(title, facts, fields, shown_rows=60)


_TARGETS = {"candidates": "all", "measured": "those measured"}


def _counted(row: Row) -> str | None:
    return f"{row.holding} of {row.judged}" if row.judged else None


def in_words(asked: Simulation, found: list[Row]) -> str:
    """Which errors were meant, the budget that does, and what more skill could still save."""
    said = [*asked.remarks, *_left_out(asked), _verdict(asked, found), *_nearness(found)]
    return "\n".join(said)


def _left_out(asked: Simulation) -> list[str]:
    """Budgets whose bound leaves candidates out."""
    short = []
    for each in asked.assessors:
        why = each.shortfall(asked.points, _JOINTS)
        if why is not None and why.code == "excepted_ahead":
            short.append(f"{why.numbers['excepted']:.0f} with {each.measurements}")
    if not short:
        return []
    return [
        f"candidates that the bound leaves out, whichever they are: {', '.join(short)} readings; "
        "true_mm and excess_mm are then of all others, and no width counts"
    ]


def _nearness(found: list[Row]) -> list[str]:
    """How near upper bounds come with the largest budget, and how near they could come."""
    judged = [row for row in found if row.judged and np.isfinite(row.attainable_mm)]
    if not judged:
        return []
    most = max(row.budget for row in judged)
    worst = max((row for row in judged if row.budget == most), key=lambda row: row.excess_mm)
    return [
        f"how near upper bounds are after {most} readings (errors: {worst.errors}), on average:",
        f"  simulated: {worst.excess_mm:.2g} mm too high",
        f"  with every error known beforehand: {worst.attainable_mm:.2g} mm",
        f"  no rule whose bounds hold gets below: {worst.proven_mm:.2g} mm",
    ]


def _verdict(asked: Simulation, found: list[Row]) -> str:
    """The budget that does, or that none did, and how surely so many repetitions show it."""
    aim = asked.aim
    if not _aims(aim):
        return "give --width-mm or --tolerance-mm to be told a budget"
    wanted = []
    if aim.width_mm is not None:
        wanted.append(f"bounds at most {aim.width_mm:g} mm apart")
    if aim.tolerance_mm is not None:
        wanted.append(f"a decision on {aim.tolerance_mm:g} mm")
    said = " and ".join(wanted)
    enough = power.smallest_budget(found, aim)
    if enough is None:
        return _none_did(asked, found, said)
    shown = power.smallest_budget(found, aim, shown=True)
    proof = "" if shown is None else _shown_by(asked, found, shown, said)
    if shown == enough:
        return proof
    gave = "may be enough:" if shown else f"gave {said} in"
    hits, low = _hits(asked, found, enough)
    if low >= aim.power:
        return (
            f"{enough} readings gave {said} in {hits} of {asked.repetitions} simulated campaigns "
            "or more; with more readings so few campaigns do not show it yet: give --repetitions"
        )
    needed = power.repetitions_to_show(hits / asked.repetitions, aim.power)
    more = "only more readings would" if needed is None else f"--repetitions {needed} would, if"
    more += "" if needed is None else " as large a share of them does"
    tried = (
        f"{enough} readings {gave} {hits} of {asked.repetitions} simulated campaigns or more on "
        f"all errors; that shows at least {low:.0%} of campaigns with 97.5 % confidence, not yet "
        f"{aim.power:.0%}: {more}"
    )
    return f"{proof}\n{tried}" if proof else tried


def _shown_by(asked: Simulation, found: list[Row], budget: int, said: str) -> str:
    """What a budget is shown to bring."""
    hits, low = _hits(asked, found, budget)
    return (
        f"{budget} readings give {said} in at least {asked.aim.power:.0%} of campaigns on all "
        f"errors simulated: {hits} of {asked.repetitions} there (at least {low:.0%} with 97.5 % "
        "confidence)"
    )


def _hits(asked: Simulation, found: list[Row], budget: int) -> tuple[int, float]:
    """Campaigns of a budget that reach the aim where fewest do, and the share these show."""
    worst = min((r for r in found if r.budget == budget), key=lambda row: row.reaches(asked.aim))
    return round(worst.reaches(asked.aim) * asked.repetitions), worst.shows(asked.aim)


def _none_did(asked: Simulation, found: list[Row], said: str) -> str:
    aim, most = asked.aim, max(row.budget for row in found)
    best = min(row.reaches(aim) for row in found if row.budget == most)
    hits = round(best * asked.repetitions)
    _, high = binomial_interval(hits, asked.repetitions)
    few = f"; so few repetitions do not rule out {high:.0%}" if high >= aim.power else ""
    return (
        f"no budget up to {most} gave {said} in {aim.power:.0%} of the simulated campaigns on all "
        f"errors: {hits} of {asked.repetitions} with {most}{few}"
    )


def drawn(asked: Simulation, found: list[Row]) -> Figure:
    """Width against budget."""
    from kinacc.figures import campaign_plan

    by_errors: dict[str, list[Row]] = {}
    for row in found:
        by_errors.setdefault(row.errors, []).append(row)
    curves = [
        campaign_plan.Curve(
            name,
            np.array([row.budget for row in group], dtype=float),
            np.array([row.width_mm for row in group]),
            np.array([row.reaches(asked.aim) for row in group]),
        )
        for name, group in by_errors.items()
    ]
    aim = asked.aim
    shown = power.smallest_budget(found, aim, shown=True)
    enough = (shown or power.smallest_budget(found, aim)) if _aims(aim) else None
    return campaign_plan.draw(curves, aim.width_mm, aim.power if _aims(aim) else None, enough)


def _aims(aim: Aim) -> bool:
    return aim.width_mm is not None or aim.tolerance_mm is not None
