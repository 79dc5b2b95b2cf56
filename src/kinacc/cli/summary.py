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
    from kinacc.report import summarise as summaries
    from kinacc.report import terminal

    places = summaries.data_set_folders(folders or (Path(RESULTS),))
    result: list[CalibrationSummary | Problem]
    if len(places) == 1:
        try:
            result = [summaries.summarise(places[0], outdated=choice.say_outdated(places[0]))]
        except InputError as error:
            result = [summaries.of_folder(places[0], error)]
    else:
        result = summaries.summarise_all(places)
    known = [item for item in result if not isinstance(item, Problem)]
    verdicts = [item.verdict(by, tolerance_mm) for item in known]
    if by == HELD_OUT and not any(verdicts):
        message = "is not given, and no configuration has a tolerance of quantile_99"
        raise InputError(Problem("--tolerance-mm", message, "a number, in mm"))
    table = terminal.fleet_table(result, by, tolerance_mm)
    if out.table is not None or out.as_json:
        out.show(as_plain(result, by, tolerance_mm), table)
    elif len(known) == len(result) == 1:
        terminal.print_summary(known[0], out.verbose, by, tolerance_mm)
    else:
        terminal.print_fleet(table, by)
    if len(known) < len(result) or any(item and item.verdict != "accept" for item in verdicts):
        sys.exit(AGAINST)


def as_plain(
    calibrations: Sequence[CalibrationSummary | Problem],
    by: str = BOUND,
    tolerance_mm: float | None = None,
) -> dict[str, dict]:
    """Summaries by name of the data set as JSON has them, each with its verdict."""
    reported = {}
    for item in calibrations:
        if isinstance(item, Problem):
            reported[Path(item.where.removesuffix("/summary.parquet")).name] = {
                "problem": str(item)
            }
            continue
        verdict = item.verdict(by, tolerance_mm)
        reported[item.name] = plain(
            asdict(item) | {"verdict": asdict(verdict) if verdict else None}
        )
    return reported
