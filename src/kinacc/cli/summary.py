"""``kinacc summary``: what one calibration is worth, or a table of many."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.exit_codes import AGAINST
from kinacc.cli.output import answers, plain
from kinacc.errors import InputError, Problem
from kinacc.workflow.data_sets import RESULTS

if TYPE_CHECKING:
    from kinacc.report.summary import CalibrationSummary

BOUND, HELD_OUT = "bound", "held-out"


@click.command("summary")
@click.argument("folders", type=click.Path(path_type=Path), nargs=-1, metavar="[FOLDER]...")
@click.option(
    "--tolerance-mm",
    type=click.FloatRange(0.0, min_open=True),
    help="Largest error allowed.  [that of the campaign or the configuration]",
)
@click.option(
    "--by",
    type=click.Choice([BOUND, HELD_OUT]),
    default=BOUND,
    show_default=True,
    help="Statistic of the verdict: upper bound of the campaign, or 99 % held-out error.",
)
@answers(table=True, verbose=True)
def summary(folders: tuple[Path, ...], tolerance_mm: float | None, by: str, out) -> None:
    """Summarise the calibration in FOLDER: half a page for one data set, a table for many.

    FOLDER is the results folder of a data set, or a folder of these [results]. The exit code is 1
    where a data set has no results or its verdict is not accept.

    \b
    Example:
      kinacc summary results/ur10_b
      kinacc summary results --tolerance-mm 0.5 -o robots.xlsx
    """
    from kinacc.report import summary as summaries
    from kinacc.report import terminal

    places = summaries.data_set_folders(folders or (Path(RESULTS),))
    found: list[CalibrationSummary | Problem]
    if len(places) == 1:
        try:
            found = [summaries.summarise(places[0], outdated=choice.say_outdated(places[0]))]
        except InputError as error:
            found = [error.problems[0]]
    else:
        found = summaries.summarise_all(places)
    known = [each for each in found if not isinstance(each, Problem)]
    verdicts = [each.verdict(by, tolerance_mm) for each in known]
    if by == HELD_OUT and not any(verdicts):
        what = "is not given, and no configuration has a tolerance of quantile_99"
        raise InputError(Problem("--tolerance-mm", what, "a number, in mm"))
    table = terminal.fleet_table(found, by, tolerance_mm)
    if out.table is not None or out.as_json:
        out.show(as_plain(found, by, tolerance_mm), table)
    elif len(known) == len(found) == 1:
        terminal.print_summary(known[0], out.verbose, by, tolerance_mm)
    else:
        terminal.print_fleet(table, by)
    if len(known) < len(found) or any(each and each.verdict != "accept" for each in verdicts):
        sys.exit(AGAINST)


def as_plain(
    found: Sequence[CalibrationSummary | Problem],
    by: str = BOUND,
    tolerance_mm: float | None = None,
) -> dict[str, dict]:
    """Summaries by name of the data set as JSON has them, each with its verdict."""
    told = {}
    for each in found:
        if isinstance(each, Problem):
            told[Path(each.where.removesuffix("/summary.parquet")).name] = {"problem": str(each)}
            continue
        verdict = each.verdict(by, tolerance_mm)
        told[each.name] = plain(asdict(each) | {"verdict": asdict(verdict) if verdict else None})
    return told
