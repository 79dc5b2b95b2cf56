"""``kinacc campaign plan``: the bounds that a budget of readings brings, by simulation."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.campaign.begin import noise_doubts, noise_of
from kinacc.campaign.planning import Aim, plan_budget
from kinacc.cli import choice
from kinacc.cli.campaign_start import assessor_of, instruments_of
from kinacc.cli.choice import Options, calibration_of, option
from kinacc.cli.output import Output, answers
from kinacc.deployment.folder import read_tables
from kinacc.errors import input_error, refuse
from kinacc.progress import reporting
from kinacc.report.rendering import lines
from kinacc.study import fields
from kinacc.study.fields import ErrorField

DEFAULT_ERRORS = ("smooth", "workshop", "defect")
SHARES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)  # of the candidates: budgets by default
_MOST_READINGS = 50_000_000  # a gigabyte: any pose may be read again and again
_NOISY = 0.5  # of the rms of held-out errors: noise larger than this is reported
# Columns on the screen, with their heads.
_SHOWN = {
    "errors": "Errors",
    "budget": "Readings",
    "true_mm": "Largest\nerror, mm",
    "excepted": "Candidates\nleft out",
    "width_median_mm": "Width, mm\nmedian",
    "width_q95_mm": "Width, mm\n95 % below",
    "holding": "Upper bounds\nthat hold",
    "reached": "Campaigns that\nreach the aim",
}


@click.command("plan")
@option("--candidates", default=200, type=click.IntRange(2, 100_000),
        help="Number of candidates of the campaign.")  # fmt: skip
@choice.campaign_options
@option("--budget", multiple=True, type=click.IntRange(1, 1_000_000),
        help="Readings in all; repeatable. [1/4 to 3 times the candidates]")  # fmt: skip
@option("--width-mm", type=choice.positive, help="Wanted distance of upper from lower bound.")
@option("--power", default=0.8, type=click.FloatRange(0.0, 1.0),
        help="Share of campaigns that reach the aim.")  # fmt: skip
@option("--errors", multiple=True,
        help="Errors to simulate; repeatable. [smooth, workshop, defect]")  # fmt: skip
@option("--point", help="Target of a results folder. [the tool, else the first]")
@option("--repetitions", default=30, type=click.IntRange(2, 100_000),
        help="Simulated campaigns per budget.")  # fmt: skip
@answers(table=True, picture="Picture of width against budget: .svg, .png, .pdf.")
def plan(out: Output, **options: Any) -> None:
    """Simulate campaigns: the width of the bounds by budget, and the budget for a wanted width.

    --errors is a results folder (its held-out errors) or made-up errors: smooth, workshop (larger),
    defect (larger still at 2 % of the poses).

    \b
    Example:
      kinacc campaign plan --noise-mm 0.05 --candidates 200 --width-mm 0.3 --errors results/arm
    """
    aim = Aim(options["width_mm"], options["tolerance_mm"], options["power"])
    errors, covariance, assessors = _question(options)
    points, repetitions, seed = (options[name] for name in ("candidates", "repetitions", "seed"))
    with reporting("campaign plan"):
        budgets = plan_budget(errors, points, covariance, assessors, aim, repetitions, seed)
    if out.picture is not None:
        from kinacc.figures.campaign import draw_budgets

        rows = budgets.rows.assign(share=budgets.rows["reached"] / repetitions)
        power = aim.power if aim.is_set else None
        out.draw(draw_budgets(rows, aim.width_mm, power, budgets.budget))
    table = budgets.rows.replace(math.inf, math.nan)
    absent = [] if table["excepted"].any() else ["excepted"]
    absent += [] if aim.is_set else ["reached"]
    holding = [f"{row.holding} of {row.judged}" for row in table.itertuples()]
    shown = table.assign(holding=holding)[[*_SHOWN]].drop(columns=absent).rename(columns=_SHOWN)
    budget = budgets.budget or int(table["budget"].max())
    worst = table[table["budget"] == budget].nsmallest(1, "reached").iloc[0]
    texts = lines("campaign_plan.txt", plan=budgets, aim=aim, worst=worst)
    out.show(budgets, table, texts, shown)


def _question(
    options: Options,
) -> tuple[list[ErrorField], np.ndarray, list[AdaptiveAssessor]]:
    """Errors, covariance and assessors of the options."""
    names, points = options["errors"] or DEFAULT_ERRORS, options["candidates"]
    instruments, freedom, doubts = instruments_of(options)
    if not options["sure"]:
        measured = (Path(name) for name in names if name not in fields.FAMILIES)
        for known in (None, *map(noise_of, measured)):
            doubts += noise_doubts(instruments, known=known)
        refuse(dict.fromkeys(doubts), "Nothing was simulated")
    budgets = sorted({*(options["budget"] or [max(round(s * points), 2) for s in SHARES])})
    if points * budgets[-1] > _MOST_READINGS:
        message = f"{points} candidates with up to {budgets[-1]} readings each"
        allowed = f"a product of at most {_MOST_READINGS:,}"
        raise input_error("--candidates, --budget", message, allowed)
    assessors = [assessor_of(options, budget, points, freedom) for budget in budgets]
    chosen = [errors_of(name, options["point"]) for name in names]
    covariance_mm2 = instruments[0].covariance_mm2
    noise_mm = math.sqrt(np.trace(covariance_mm2))
    for field in (item for item in chosen if item.name not in fields.FAMILIES):
        rms_mm = math.sqrt(np.mean(np.sum(field.error_mm**2, axis=1)))
        if noise_mm > _NOISY * rms_mm:
            click.echo(
                f"warning: errors of {field.name} include reading noise ({noise_mm:.3g} of "
                f"{rms_mm:.3g} mm rms). The plan counts it as error: real widths can be larger.",
                err=True,
            )
    return chosen, covariance_mm2, assessors


def errors_of(name: str, point: str | None = None) -> ErrorField:
    """Return made-up errors, or those of a results folder.

    ``point``: target of a results folder, by default the one that a campaign is about.
    """
    path = Path(name)
    if name in fields.FAMILIES:
        return fields.made_up(name)
    if not path.is_dir():
        allowed = f"a results folder, {', '.join(fields.FAMILIES)}"
        raise input_error("--errors", f"{name!r} is no folder", allowed)
    tables, arm = read_tables(path, needed=("pose_errors",), optional=()), calibration_of(path)
    target = point or arm.default_point
    if target not in arm.targets:
        raise input_error("--point", f"{target!r} is no target", ", ".join(arm.targets))
    return fields.of_measurements(path.resolve().name, tables["pose_errors"], arm.choice, target)
