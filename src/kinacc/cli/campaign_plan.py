"""``kinacc campaign plan``: the bounds that a budget of readings brings, by simulation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.output import Output, answers

if TYPE_CHECKING:
    from kinacc.campaign.planning import Aim, BudgetPlan
    from kinacc.study.fields import ErrorField

DEFAULT_ERRORS = ("smooth", "workshop", "defect")
SHARES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)  # of the candidates: budgets by default
_MOST_READINGS = 50_000_000  # a gigabyte: any pose may be read again and again
_SHOWN = (
    *("errors", "budget", "true_mm", "excepted", "width_median_mm", "width_q95_mm"),
    *("holding", "judged"),
)


@click.command("plan")
@option("--candidates", default=200, type=click.IntRange(2, 100_000),
        help="Number of candidates of the campaign.")  # fmt: skip
@choice.campaign_options
@option("--budget", multiple=True, type=click.IntRange(1, 1_000_000),
        help="Readings in all; repeatable. [1/4 to 3 times the candidates]")  # fmt: skip
@option("--power", default=0.8, type=click.FloatRange(0.0, 1.0),
        help="Share of campaigns that reach the aim.")  # fmt: skip
@option("--errors", multiple=True,
        help="Errors to simulate; repeatable. [smooth, workshop, defect]")  # fmt: skip
@option("--point", help="Target of a results folder. [the tool, else the first]")
@option("--largest-mm", type=float, help="Largest error to scale the errors to.")
@option("--repetitions", default=30, type=click.IntRange(2, 100_000),
        help="Simulated campaigns per budget.")  # fmt: skip
@answers(table=True, picture="Picture of width against budget: .svg, .png, .pdf.")
def plan(out, **given) -> None:
    """Simulate campaigns: the width of the bounds by budget, and the budget for a wanted width.

    --errors is a results folder (its held-out errors), a file with columns ex_mm, ey_mm, ez_mm, or
    a family of synthetic arms: smooth, gravity, ripple, thermal, workshop, defect, rare.

    \b
    Example:
      kinacc campaign plan --noise-mm 0.05 --candidates 200 --width-mm 0.3 --errors results/arm
    """
    from kinacc.campaign.planning import Aim, plan_budget
    from kinacc.progress import reporting

    aim = Aim(given["width_mm"], given["tolerance_mm"], given["power"], given["target"])
    fields, points, covariance, assessors = _question(given)
    with reporting("campaign plan", bar=True) as progress:
        runs = (given["repetitions"], given["seed"], progress)
        found = plan_budget(fields, points, covariance, assessors, aim, *runs)
    if out.picture is not None:
        _draw(found, aim, out)
    table = found.rows.replace(math.inf, math.nan)
    shown = [each for each in _SHOWN if each != "excepted" or table[each].any()]
    shown += ["within"] if aim.width_mm is not None else []
    shown += ["accept", "reject", "undecided"] if aim.tolerance_mm is not None else []
    out.show(found, table, _lines(found, aim), table[shown])


def _question(given: Mapping) -> tuple:
    """Fields, number of candidates, covariance and assessors of the options."""
    from kinacc.campaign import known_noise, slips
    from kinacc.campaign.plan import with_references
    from kinacc.cli import campaign_options
    from kinacc.errors import Problem, gathered, refuse
    from kinacc.study import fields

    problems: list[Problem] = []
    named, points = given["errors"] or DEFAULT_ERRORS, given["candidates"]
    folders = [Path(each) for each in named if each not in fields.FAMILIES and Path(each).is_dir()]
    if given["point"] is not None and not folders:
        problems.append(Problem("--point", "needs a results folder", "--errors FOLDER"))
    tested, instruments, chosen, assessors = None, (), [], []
    with gathered(problems):
        tested = campaign_options.tested_noise(given["repeatability"])
    with gathered(problems):
        instruments = campaign_options.instruments(given, tested, folders)
        if not given["sure"]:
            problems += [*slips.of_noise(instruments), *known_noise.doubts(tested)]
            for path in folders:
                problems += slips.of_little_noise(instruments, slips.noise_of(path))
    lengths = ("width_mm", "tolerance_mm", "largest_mm")
    problems += campaign_options.not_positive(**{name: given[name] for name in lengths})
    budgets = sorted({*(given["budget"] or [max(round(s * points), 2) for s in SHARES])})
    if points * budgets[-1] > _MOST_READINGS:
        what = f"{points} candidates with up to {budgets[-1]} readings each"
        allowed = f"a product of at most {_MOST_READINGS:,}"
        problems.append(Problem("--candidates, --budget", what, allowed))
    for budget in budgets:
        with gathered(problems):
            made = campaign_options.assessor(given, budget, tested)
            assessors.append(with_references(made, points, given["references"]))
    for errors in named:
        with gathered(problems):
            chosen.append(errors_of(errors, given["point"]))
    refuse(dict.fromkeys(problems), "Nothing was simulated")
    if (largest_mm := given["largest_mm"]) is not None:
        chosen = [
            replace(each, error_mm=each.error_mm * (largest_mm / each.size_mm.max()))
            for each in chosen
        ]
    return chosen, points, instruments[0].covariance_mm2, assessors


def errors_of(name: str, point: str | None = None) -> ErrorField:
    """Return the errors of a family, a results folder or a file.

    ``point``: target of a results folder, by default the one that a campaign is about.
    """
    from kinacc.errors import InputError, Problem, refuse
    from kinacc.measurements.rows import open_table
    from kinacc.measurements.table import numbers
    from kinacc.study import fields

    path, names = Path(name), ("ex_mm", "ey_mm", "ez_mm")
    if name in fields.FAMILIES:
        return replace(fields.synthetic(name, 0), name=name)
    if path.is_dir():
        return _errors_of_folder(path, point)
    if not path.is_file():
        allowed = f"a results folder, a file, {', '.join(fields.FAMILIES)}"
        raise InputError(Problem("--errors", f"{name!r} does not exist", allowed))
    problems: list[Problem] = []
    table = open_table(path)[0]
    missing = [each for each in names if each not in table.columns]
    if missing:
        raise InputError(Problem(name, f"has no column {', '.join(missing)}", ", ".join(names)))
    measured = ~np.all([table.gaps(each) for each in names], axis=0)
    errors = np.stack([numbers(table, each, problems, gaps=True) for each in names], axis=1)
    if not measured.any() or (not problems and np.isnan(errors[measured]).any()):
        problems.append(
            Problem(name, "has no error, or one that is not complete", ", ".join(names))
        )
    refuse(problems)
    return fields.ErrorField(path.stem, errors[measured])


def _errors_of_folder(path: Path, point: str | None) -> ErrorField:
    from kinacc.config.error_models import PLAINEST
    from kinacc.deployment.folder import recorded_model, targets_of
    from kinacc.deployment.record import default_point
    from kinacc.errors import InputError, Problem
    from kinacc.study import fields
    from kinacc.tables import store

    names = ("pose_errors", "measurements", "model_selection", "frames", "assessment_points")
    tables = {
        each: store.read(path / f"{each}.parquet")
        for each in names
        if (path / f"{each}.parquet").is_file()
    }
    name = path.resolve().name
    if not {"pose_errors", "measurements"} <= {*tables}:
        if "assessment_points" in tables:
            return fields.of_points(name, tables["assessment_points"])
        what = "holds neither pose_errors with measurements nor assessment_points"
        raise InputError(Problem(str(path), what, "a results folder"))
    model = recorded_model(tables) or PLAINEST
    targets = list(dict.fromkeys(np.asarray(tables["measurements"]["target"]).astype(str)))
    if "frames" in tables:
        targets = [each for each in targets_of(tables["frames"], model) if each in targets]
    target = point or default_point(targets)
    if target not in targets:
        raise InputError(Problem("--point", f"{target!r} is no target", ", ".join(targets)))
    several = len(targets) > 1
    if several:
        known = ", ".join(targets)
        click.echo(f"{path}: errors of {target} ({known}); --point names another", err=True)
    return fields.of_measurements(
        name, tables["pose_errors"], tables["measurements"], model, target if several else None
    )


def _lines(found: BudgetPlan, aim: Aim) -> Iterator[str]:
    """The budget, the simulation, and how near an upper bound can come."""
    yield _verdict(found, aim)
    yield (
        f"Simulated: {found.repetitions} campaigns a row with {found.assessor}, largest error of "
        f"{found.target} among {found.candidates}, noise {max(found.noise_mm):.3g} mm."
    )
    judged = found.rows.dropna(subset="attainable_mm")
    if len(judged):
        last = judged[judged["budget"] == judged["budget"].max()]
        worst = last.loc[last["excess_mm"].idxmax()]
        yield (
            f"Mean excess of the upper bound with {worst['budget']} readings (errors: "
            f"{worst['errors']}): {worst['excess_mm']:.3g} mm. With all errors known beforehand: "
            f"{worst['attainable_mm']:.3g} mm. Limit of any reliable bound: "
            f"{worst['proven_mm']:.3g} mm."
        )


def _draw(found: BudgetPlan, aim: Aim, out: Output) -> None:
    """Draw width and share of campaigns that reach the aim against the budget."""
    from kinacc.figures import campaign_plan

    curves = [
        campaign_plan.Curve(
            str(name),
            group["budget"].to_numpy(float),
            group[["width_q05_mm", "width_median_mm", "width_q95_mm"]].to_numpy(),
            group["reached"].to_numpy() / found.repetitions,
        )
        for name, group in found.rows.groupby("errors", sort=False)
    ]
    power = aim.power if aim.is_set else None
    out.draw(campaign_plan.draw(curves, aim.width_mm, power, found.budget_shown or found.budget))


def _verdict(found: BudgetPlan, aim: Aim) -> str:
    if not aim.is_set:
        return "No budget named: give --width-mm or --tolerance-mm."
    wanted = [f"bounds at most {aim.width_mm:g} mm apart"] if aim.width_mm is not None else []
    wanted += [f"a decision on {aim.tolerance_mm:g} mm"] if aim.tolerance_mm is not None else []
    goal = " and ".join(wanted)
    rows = found.rows
    budget = found.budget_shown or found.budget or int(rows["budget"].max())
    of_budget = rows[rows["budget"] == budget]
    worst = of_budget.loc[of_budget["reached"].idxmin()]
    count = (
        f"{worst['reached']} of {found.repetitions} simulated campaigns (errors: "
        f"{worst['errors']}; at least {worst['reached_low']:.0%} with 97.5 % confidence)"
    )
    if found.budget is None:
        return f"No budget up to {budget} gives {goal} in {aim.power:.0%} of campaigns: {count}."
    if found.budget_shown is None:
        return (
            f"{budget} readings may suffice for {goal}: {count}. Show it with more --repetitions."
        )
    text = f"{budget} readings give {goal} in at least {aim.power:.0%} of campaigns: {count}."
    return text if found.budget == budget else f"{text} {found.budget} may suffice."
