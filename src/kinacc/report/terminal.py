"""The summary of a calibration on the terminal, and the table of many."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.table import Table

from kinacc.assess.statement import UNDECIDED
from kinacc.calibration.summary import LARGE_SHARE
from kinacc.config.error_models import PLAINEST
from kinacc.errors import Problem, as_seen, first_few
from kinacc.report.rendering import counted, lines
from kinacc.report.summarise import summarise, summarise_all
from kinacc.report.summary import BOUND, CalibrationSummary, Verdict

FEW = 4  # data sets whose summaries are printed one after another
WIDTH = 100
_WIDE = 4000  # characters: a terminal wraps what is wider than it
_MOST = 3  # findings, rows and parameters without --verbose
_DAY = 10  # characters of a time


class _Console(Console):
    """A console whose reader may have gone: the command ends as others do then."""

    def on_broken_pipe(self) -> None:
        """Leave the error to the command."""
        raise BrokenPipeError


def screen(width: int) -> Console:
    """The standard output, so many characters wide."""
    return _Console(file=sys.stdout, width=width, highlight=False, markup=False, emoji=False)


def print_summary(
    summary: CalibrationSummary,
    verbose: bool = False,
    by: str = BOUND,
    tolerance_mm: float | None = None,
) -> None:
    """Print half a page on one calibration, with the verdict ``by`` a statistic; see ``verdict``.

    ``verbose``: every finding and parameter.
    """
    console = screen(WIDTH)
    first, *answers = headline(summary, by, tolerance_mm)
    console.print(first, soft_wrap=True)
    console.print("\n".join(answers), end="\n\n")
    where = "Held-out" if summary.is_held_out else "Training"
    errors = summary.error_table()
    table = Table(box=None, pad_edge=False)
    table.add_column(f"{where} errors ({counted(summary.best.n, 'reading')})", no_wrap=True)
    for name in errors.columns[1:]:
        table.add_column(name.replace(", ", "\n"), justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    for model, row in errors.iterrows():
        table.add_row(*map(as_seen, row), "<- selected" if model == summary.selected else "")
    console.print(table)
    grid = Table.grid(padding=(0, 2))
    grid.add_column(no_wrap=True)
    grid.add_column(overflow="fold")
    for topic, texts in notes(summary, None if verbose else _MOST).items():
        grid.add_row(topic, "\n".join(texts))
    console.print(grid)
    for purpose, command in summary.next_steps.items():
        console.print(f"{purpose[:1].upper()}{purpose[1:]}:")
        console.print(f"  {command}", soft_wrap=True)


def print_summaries(folders: Sequence[Path]) -> None:
    """Print half a page each for a few results folders of data sets, a table for many."""
    if len(folders) > FEW:
        print_fleet(fleet_table(summarise_all(folders), BOUND), BOUND)
        return
    for folder in folders:
        print()
        print_summary(summarise(folder))


def headline(
    summary: CalibrationSummary, by: str = BOUND, tolerance_mm: float | None = None
) -> list[str]:
    """The data set in a line; then errors before and after, and the verdicts."""
    verdicts = [summary.verdict(by, tolerance_mm)]
    if tolerance_mm is None:
        verdicts.append(summary.of_configuration())
    return lines("headline.txt", s=summary, verdicts=dict.fromkeys(filter(None, verdicts)))


def notes(summary: CalibrationSummary, most: int | None) -> dict[str, list[str]]:
    """Texts by topic; at most ``most`` findings, rows and parameters each, all for None."""
    topics: dict[str, list[str]] = {}
    for line in lines("notes.txt", s=summary, most=most, why=selection(summary)):
        topic, _, text = line.partition(": ")
        topics.setdefault(topic, []).append(text)
    return topics


def selection(summary: CalibrationSummary) -> str:
    """Which model was selected, by which figures."""
    models = summary.selection.set_index("model")
    return lines("selection.txt", s=summary, models=models, plainest=PLAINEST)[0]


def fleet_table(
    results: Sequence[CalibrationSummary | Problem], by: str, tolerance_mm: float | None = None
) -> pd.DataFrame:
    """One row a calibration: errors in mm, the bound of its campaign, the verdict."""
    rows: list[dict[str, object]] = []
    for result in results:
        if isinstance(result, Problem):
            name, folder = Path(result.where).name, result.where
            unread = {"verdict": UNDECIDED, "reason": str(result), "folder": folder}
            rows.append({"data_set": name, **unread})
            continue
        best = result.best if result.is_held_out else None
        status, bound = result.campaign, result.bound
        verdict = result.verdict(by, tolerance_mm) or Verdict("", "", math.nan)
        rows.append(
            {
                "data_set": result.name,
                "verdict": verdict.verdict,
                "model": result.selected,
                "held_out_mean_mm": getattr(best, "mean", math.nan),
                "held_out_99_mm": getattr(best, "quantile_99", math.nan),
                "held_out_largest_mm": getattr(best, "largest", math.nan),
                "bound_mm": getattr(bound, "upper_mm", math.nan),
                "confidence": getattr(bound, "confidence", math.nan),
                "campaign_date": status.recorded[:_DAY] if status else "",
                "measured": result.measured,
                "file_date": result.written,
                "tolerance_mm": verdict.tolerance_mm,
                "reason": verdict.reason,
                "bound_of": f"{bound.about}, {status.point}" if bound and status else "",
                "assumptions": status.assumes if status else "",
                "remarks": "; ".join([*result.remarks, *result.doubts]),
                "robot": result.robot,
                "folder": result.folder,
            }
        )
    return pd.DataFrame(rows)


def print_fleet(table: pd.DataFrame, by: str) -> None:
    """Print the table of many calibrations, then reasons and remarks."""
    console = screen(WIDTH)
    verdicts = table["verdict"][table["verdict"] != ""].value_counts()
    counts = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())
    first = counted(len(table), "calibration")
    console.print(f"{first}: {counts}, by {by}" if counts else first)
    columns = {
        "data_set": "data set",
        "verdict": "verdict",
        "bound_mm": "bound mm",
        "confidence": "confidence",
        "model": "model",
        "held_out_mean_mm": "mean mm",
        "held_out_99_mm": f"{LARGE_SHARE:.0%} mm",
        "held_out_largest_mm": "largest mm",
        "measured": "measured",
        "file_date": "date",
    }
    shown = table.reindex(columns=[*columns]).replace("", None).dropna(axis=1, how="all")
    print_table(shown.rename(columns=columns), len(shown))
    console.print("Position errors of the selected model at held-out poses.")
    texts = table.melt("data_set", [name for name in ("reason", "remarks") if name in table])
    texts = texts[texts["value"].fillna("") != ""]
    for text, names in texts.groupby("value", sort=False)["data_set"]:
        console.print(as_seen(f"{first_few([*names], _MOST)}: {text}"), soft_wrap=True)


def print_table(table: pd.DataFrame, most: int = 24) -> None:
    """Print the first rows of a table.

    Parameters
    ----------
    table
        Numbers with four decimals, a dash where there is none.
    most
        Number of rows that are printed.
    """
    grid = Table(box=None, pad_edge=False)
    for name, values in table.items():
        numeric = pd.api.types.is_numeric_dtype(values)
        grid.add_column(as_seen(str(name)), justify="right" if numeric else "left", no_wrap=True)
    for row in table.head(most).itertuples(index=False):
        grid.add_row(*map(_shown, row))
    screen(_WIDE).print(grid)
    if len(table) > most:
        print(f".. {len(table) - most} more rows (--out)")


def _shown(value: object) -> str:
    if value is None or value != value:
        return "-"
    if not isinstance(value, float):
        return as_seen(str(value))
    return f"{value:.4f}" if abs(value) >= 0.01 or abs(value) < 5e-5 else f"{value:.3g}"
