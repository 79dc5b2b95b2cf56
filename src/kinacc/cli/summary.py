"""``kinacc summary``: what many calibrations are worth, one of them a row."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli.exit_codes import AGAINST
from kinacc.cli.output import Output, answers
from kinacc.cli.show import Answer, at_odds
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.tables.columns import texts
from kinacc.workflow.data_sets import RESULTS

if TYPE_CHECKING:
    from kinacc.cli.sheet import Sheet
    from kinacc.report.fleet import Standing, Verdict

_BOUND, _HELD_OUT = "bound", "held-out"
# Columns of the terminal, by narrower names.
_ON_SCREEN = {
    "data_set": "data_set",
    "verdict": "verdict",
    "bound_mm": "bound_mm",
    "confidence": "confidence",
    "model": "model",
    "held_out_mean_mm": "mean_mm",
    "held_out_99_mm": "99_%_mm",
    "held_out_largest_mm": "largest_mm",
    "campaign_date": "campaign_date",
    "file_date": "file_date",
}
_MEANT = "mean, 99 % empirical, largest: errors of the model selected, at poses no fit has seen"
_OF_VERDICTS = ("verdict", "tolerance_mm", "because")


@click.command("summary")
@click.argument("folders", type=click.Path(path_type=Path), nargs=-1, metavar="[FOLDER]...")
@click.option(
    "--tolerance-mm",
    type=click.FloatRange(0.0, min_open=True),
    help="Hold every robot to it.  [that of its campaign, or of its configuration]",
)
@click.option(
    "--by",
    type=click.Choice([_BOUND, _HELD_OUT]),
    default=_BOUND,
    show_default=True,
    help="What the verdict is by: a campaign's bound, or the error that 99 % held out stay below.",
)
@click.option("--csv", "as_csv", is_flag=True, help="Print rows with all digits as CSV.")
@answers("Print rows as JSON.", table=True)
def summary(
    folders: tuple[Path, ...], tolerance_mm: float | None, by: str, as_csv: bool, out: Output
) -> None:
    """Say what the calibrations of many robots are worth, a row each.

    FOLDER is the folder of all results, or of one data set [results]. A row has the model selected,
    its errors at poses held out, the upper bound of the campaign on that calibration with its
    confidence, and the verdict on the tolerance: accept, reject or undecided. What a bound hangs
    on stands below. Where there is no campaign there is no bound, and nothing is accepted by it.
    Errors held out are those of the poses measured: they bound nothing.

    campaign_date is the day of the last entry in the campaign's journal, file_date that on which
    the file of the calibration's summary was written here: tables hold no time.

    Exit code 1 where a data set has no results to tell of, or its verdict is not accept.

    \b
    Example:
      kinacc summary
      kinacc summary results --tolerance-mm 0.5 --out robots.xlsx
      kinacc summary line1/results line2/results --tolerance-mm 1.5 --by held-out
    """
    from kinacc.report.fleet import data_sets, standings

    refuse(at_odds({"--csv": as_csv, "--json": out.as_json, "--out": out.table is not None}))
    found = standings(data_sets(folders or (Path(RESULTS),)))
    verdicts = [each.verdict(by, tolerance_mm) for each in found]
    if by == _HELD_OUT and not any(verdicts):
        what = "is not given, and no configuration has a tolerance of quantile_99"
        raise InputError(Problem("--tolerance-mm", what, "a number, in mm"))
    if out.as_json or out.table is not None or as_csv:
        Answer(out, as_csv).give(sheet(found, verdicts, by), None)
    else:
        show(found, verdicts, by)
    if any(each.problem for each in found) or _counted(verdicts).keys() - {"accept"}:
        sys.exit(AGAINST)


def show(
    found: Sequence[Standing], verdicts: Sequence[Verdict | None], by: str, more: Sequence[str] = ()
) -> None:
    """Print the table, what its figures hang on, and ``more``."""
    lines = [*below(found, verdicts), *more]
    Answer(Output()).give(on_screen(sheet(found, verdicts, by)), None, [_MEANT], lines)


def sheet(found: Sequence[Standing], verdicts: Sequence[Verdict | None], by: str = _BOUND) -> Sheet:
    """One row a robot, with its verdict where there are any, which are ``by`` what is said."""
    from kinacc.cli.sheet import Field, Sheet

    rows = [_row(*each) for each in zip(found, verdicts, strict=True)]
    unseen = "position error at poses that no fit has seen"
    columns = [
        ("data_set", "", "name of the data set"),
        ("verdict", "", f"whether it is within tolerance_mm, by {by}"),
        ("bound_mm", "mm", "upper bound on the largest error, by a campaign"),
        ("confidence", "1", "how surely the bound holds"),
        ("model", "", "error model that is selected"),
        ("held_out_mean_mm", "mm", f"mean {unseen}"),
        ("held_out_99_mm", "mm", f"99 % of them have at most this {unseen}"),
        ("held_out_largest_mm", "mm", f"largest {unseen}"),
        ("campaign_date", "", "day of the last entry in the campaign's journal"),
        ("file_date", "", "day on which the file of the summary was written here"),
        ("held_out_rows", "1", "rows that were held out"),
        ("lower_mm", "mm", "lower bound on the largest error, equally sure"),
        ("bound_of", "", "what is bounded: of which candidates, point and model"),
        ("bound_if", "", "what the bound hangs on"),
        ("readings", "1", "readings of the campaign"),
        ("campaign", "", "folder of the campaign"),
        ("tolerance_mm", "mm", "what the verdict is about"),
        ("because", "", "why the verdict is what it is"),
        ("remarks", "", "what else has to be known"),
        ("robot", "", "name of the arm"),
        ("folder", "", "results folder"),
    ]
    fields = [
        Field(name, texts(row.get(name) for row in rows), unit, meaning)
        for name, unit, meaning in columns
        if name not in _OF_VERDICTS or any(verdicts)
    ]
    told = [f"{number} {says}" for says, number in _counted(verdicts).items()]
    count = f"{len(rows)} calibration{'s' if len(rows) != 1 else ''}"
    title = f"{count}: {', '.join(told)}, by {by}" if told else count
    return Sheet(title, {"calibrations": len(rows), "by": by if told else None}, fields)


def on_screen(whole: Sheet) -> Sheet:
    """Of a sheet what a terminal has room for, to a micrometre."""
    there = {each.name: each for each in whole.fields}
    fields = [
        replace(there[name], name=shown, values=texts(map(_rounded, there[name].values)))
        for name, shown in _ON_SCREEN.items()
        if name in there
    ]
    return replace(whole, fields=fields)


def _rounded(value: object) -> object:
    return round(value, 3) if isinstance(value, float) else value


def _row(each: Standing, verdict: Verdict | None) -> dict[str, object]:
    known = each.held_out
    row = {
        "data_set": each.name,
        "model": each.model,
        "held_out_mean_mm": known.get("mean"),
        "held_out_99_mm": known.get("quantile_99"),
        "held_out_largest_mm": known.get("largest"),
        "held_out_rows": int(known["n"]) if known else None,
        **each.bound(),
        "file_date": each.written,
        "remarks": "; ".join(each.doubts()) or None,
        "robot": each.robot,
        "folder": str(each.folder),
    }
    if verdict is None:
        return row
    judged = {"verdict": verdict.says, "because": verdict.because}
    return row | judged | {"tolerance_mm": verdict.tolerance_mm}


def below(found: Sequence[Standing], verdicts: Sequence[Verdict | None]) -> list[str]:
    """What figures hang on, and why verdicts are what they are; what several share is said once."""
    said: dict[str, list[str]] = {}
    for each, verdict in zip(found, verdicts, strict=True):
        bound, lines = each.bound(), each.doubts()
        if "bound_if" in bound:
            lines.insert(0, f"the bound is on {bound['bound_of']}, if {bound['bound_if']}")
        if verdict is not None:
            whose = f" ({verdict.whose} tolerance)" if verdict.whose else ""
            allowed = f"{verdict.tolerance_mm:g} mm{whose}"
            lines.append(f"{verdict.says} by {allowed}: {verdict.because}")
        for line in lines:
            said.setdefault(line, []).append(each.name)
    return [f"{_named(names, len(found))}: {line}" for line, names in said.items()]


def _named(names: Sequence[str], all_there_are: int) -> str:
    return f"all {len(names)}" if len(names) == all_there_are > 1 else first_few(names)


def _counted(verdicts: Sequence[Verdict | None]) -> dict[str, int]:
    """How many robots have each verdict."""
    says = [each.says for each in verdicts if each]
    return {each: says.count(each) for each in dict.fromkeys(says)}
