"""``kinacc summary``, ``report``, ``show`` and ``check-results``: looking at a results folder."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import click
import pandas as pd
import pyarrow as pa

from kinacc.campaign.beside_results import of_results
from kinacc.checks.configuration import load
from kinacc.cli.choice import CONFIG, FOLDER, PATH, REASON, option, positive, print_outdated
from kinacc.cli.output import Output, answers, plain
from kinacc.cli.process import AGAINST
from kinacc.config.values import nearest
from kinacc.deployment.folder import read_tables
from kinacc.errors import InputError, Problem, first_few, input_error
from kinacc.gate import accepted as accepted_runs
from kinacc.gate import check, outputs
from kinacc.report import summarise as summaries
from kinacc.report import terminal
from kinacc.report.summary import BOUND, HELD_OUT, CalibrationSummary
from kinacc.tables import store, sums
from kinacc.tables.atomic import write_whole
from kinacc.tables.contract import ARTEFACTS
from kinacc.workflow.data_sets import RESULTS, campaign_files

_PAGE = "report.html"


@click.command("summary")
@click.argument("folders", type=click.Path(path_type=Path), nargs=-1, metavar="[FOLDER]...")
@option("--tolerance-mm", type=positive, help="Largest error allowed. [campaign, configuration]")
@option(
    "--by",
    type=click.Choice([BOUND, HELD_OUT]),
    default=BOUND,
    help="Statistic of the verdict: upper bound of the campaign, or 99 % held-out error.",
)
@answers(table=True, verbose=True)
def summary(folders: tuple[Path, ...], tolerance_mm: float | None, by: str, out: Output) -> None:
    """Summarise the calibration in FOLDER: half a page for one data set, a table for many.

    FOLDER is the results folder of a data set, or a folder of these [results]. Exit code 1: a data
    set has no results, or its verdict is not accept.

    \b
    Example:
      kinacc summary results --tolerance-mm 0.5 -o robots.xlsx
    """
    places = summaries.data_set_folders(folders or (Path(RESULTS),))
    reason = print_outdated(places[0]) if len(places) == 1 else ""
    result = summaries.summarise_all(places, reason)
    table = terminal.fleet_table(result, by, tolerance_mm)
    if by == HELD_OUT and (table["verdict"] == "").all():
        message = "is not given, and no configuration has a tolerance of quantile_99"
        raise input_error("--tolerance-mm", message, "a number, in mm")
    if out.table is not None or out.as_json:
        out.show(as_plain(result, by, tolerance_mm), table)
    elif len(result) == 1 and isinstance(result[0], CalibrationSummary):
        terminal.print_summary(result[0], out.verbose, by, tolerance_mm)
    else:
        terminal.print_fleet(table, by)
    if not table["verdict"].isin(["accept", ""]).all():
        sys.exit(AGAINST)


def as_plain(
    calibrations: Sequence[CalibrationSummary | Problem],
    by: str = BOUND,
    tolerance_mm: float | None = None,
) -> dict[str, Any]:
    """Summaries by name of the data set as JSON has them, each with its verdict."""
    reported: dict[str, Any] = {}
    for item in calibrations:
        if isinstance(item, Problem):
            reported[Path(item.where).name] = {"problem": str(item)}
        else:
            reported[item.name] = plain(vars(item) | {"verdict": item.verdict(by, tolerance_mm)})
    return reported


@click.command("report")
@FOLDER
@option("--out", "-o", "path", type=PATH, help=f"Page to write. [FOLDER/{_PAGE}]")
@answers()
def report(folder: str, path: str | None, out: Output) -> None:
    """Write one page on the results of a data set in FOLDER, to read, mail and keep.

    \b
    Example:
      kinacc report results/ur10_b --out ur10_b.html
    """
    page = written(folder, path)
    out.show({"page": str(page)}, lines=[f"{page}: one file that needs no network"])


def written(folder: str, out: str | None = None) -> Path:
    """Write the page of a results folder, and return where it is.

    Raises InputError naming all tables missing.
    """
    # Plots take half of a start, and other commands draw none.
    from kinacc.report import dataset as pages
    from kinacc.report.page import html

    place, reason, needed = Path(folder), print_outdated(folder), summaries.PAGE_TABLES
    old = summaries.made_of_others(place) - {Path(_PAGE).stem, *needed}
    optional = [name for name in summaries.ON_PAGE if name not in old]
    tables: dict[str, Any] = dict(read_tables(place, needed=needed, optional=optional))
    tables |= {role: Path(path) for role, path in campaign_files(of_results(place)).items()}
    page = pages.run(tables, folder, sorted(old), reason)
    path = Path(out or place / _PAGE)
    write_whole(path, html(page, {}).encode())
    return path


@click.command("show")
@click.argument("path", type=click.Path(path_type=Path), default=Path(RESULTS))
@click.argument("name", metavar="[TABLE]", required=False)
@option("--describe", is_flag=True, help="Unit, meaning and range of every column, and the key.")
@answers(table=True)
def show(path: Path, name: str | None, describe: bool, out: Output) -> None:
    """Show a TABLE of results, or list the tables of the folder PATH.

    \b
    Example:
      kinacc show results/ur10_b residuals -o residuals.xlsx
    """
    place = _find(path / (name or ""))
    if place.is_dir():
        table = _listing(place)
        first = shlex.join(["kinacc", "show", str(place / str(table.iloc[0, 0]))])
        out.show({"rows": table}, table, [f"The first of these: {first}"], most=len(table))
        return
    content = store.read_arrow(place, any_type=True)
    try:
        table = content.to_pandas()
    except (ValueError, pa.ArrowException) as error:
        message = f"cannot be shown: {error}"
        raise input_error(str(place), message, fix=sums.remake(place)) from None
    known = ARTEFACTS.get(place.stem)
    line = f"{place}: {table.shape[describe]} {'columns' if describe else 'rows'}. "
    line += known.meaning if known else ""
    if describe:
        table = _described(content.schema, table, known.key if known else ())
    out.show({"rows": table}, table, [line.rstrip()], most=len(table) if describe else 24)


def _find(path: Path) -> Path:
    """The file or folder meant. Raises InputError with what is there instead."""
    if path.exists():
        return path
    table = path.with_name(f"{path.name}.parquet")
    if table.is_file():
        return table
    there = sorted(item.stem for item in path.parent.glob("[!.]*"))
    close = nearest(path.stem, tuple(there))
    fix = f"did you mean {path.with_name(close)}?" if close else ""
    raise input_error(str(path), "no such table or folder", first_few(there, 30), fix)


def _listing(folder: Path) -> pd.DataFrame:
    """Tables of a folder with rows and meaning, or its folders with tables. InputError if none."""
    rows = []
    for path in sorted(folder.glob("*.parquet")):
        meaning = ARTEFACTS[path.stem].meaning if path.stem in ARTEFACTS else ""
        try:
            count = str(store.row_count(path))
        except InputError as error:
            count, meaning = "", error.problems[0].what
        rows.append((path.stem, count, re.split(r"(?<!Fig)(?<!Figs)[.] ", meaning)[0]))
    if rows:
        return pd.DataFrame(rows, columns=["table", "rows", "meaning"])
    tables = pd.Series([path.parent.name for path in folder.glob("*/*.parquet")], dtype=object)
    if tables.empty:
        raise input_error(str(folder), "holds no table", "the folder of a data set")
    return tables.value_counts().sort_index().rename_axis("folder").reset_index(name="tables")


def _described(schema: pa.Schema, table: pd.DataFrame, key: Collection[str]) -> pd.DataFrame:
    """Unit, meaning and range of every column, and whether it belongs to the key of a row."""
    rows = []
    for field in schema:
        known = {name.decode(): text.decode() for name, text in (field.metadata or {}).items()}
        values = table[field.name].dropna()
        if pd.api.types.is_numeric_dtype(values) and len(values):
            holds = f"{float(values.min()):.6g} to {float(values.max()):.6g}"
        else:
            holds = f"{values.astype(str).nunique()} different texts"
        is_key = "key" if field.name in key else ""
        rows.append((field.name, is_key, known.get("unit"), known.get("meaning"), holds))
    return pd.DataFrame(rows, columns=["column", "key", "unit", "meaning", "holds"])


@click.command("check-results")
@click.argument("results", type=click.Path(path_type=Path), default=Path(RESULTS))
@option("--config", multiple=True, help=f"Configuration file; repeatable. [{CONFIG}]")
@option("--against", type=click.Path(path_type=Path), metavar="FOLDER", help="Accepted run.")
@option("--dataset", "datasets", multiple=True, help="Data set; repeatable. [all]")
@option("--accept", "accepted", type=click.Path(path_type=Path), metavar="FOLDER",
        help="Folder of the accepted run, made from RESULTS where nothing fails.")  # fmt: skip
@REASON
@option("--out", "-o", "files", multiple=True, type=click.Path(path_type=Path),
        help="Further output file: .json, .xml (JUnit) or .md.")  # fmt: skip
@answers()
def check_results(
    results: Path,
    config: tuple[str, ...],
    against: Path | None,
    datasets: tuple[str, ...],
    accepted: Path | None,
    reason: str | None,
    files: tuple[Path, ...],
    out: Output,
) -> None:
    """Check tables, digests, thresholds and, with --against, an accepted run.

    Exit code 0: nothing failed; 1: something did; 2: the input cannot be used.

    \b
    Example:
      kinacc check-results results --config tracker.yaml --against accepted --out check.xml
    """
    if (results / sums.FOLDER).is_dir():  # one data set was named in place of the folder of all
        results, datasets = results.resolve().parent, (*datasets, results.resolve().name)
    configs = config
    if not config and Path(CONFIG).is_file():  # beside another workflow it may be that workflow's
        is_own = re.search("^datasets:", Path(CONFIG).read_text("utf-8", "replace"), re.MULTILINE)
        configs = (CONFIG,) if is_own else ()
    report = check.check_results(results, load(configs) if configs else {}, against, datasets)
    for path in files:
        outputs.write(report, path)
    text = outputs.as_json(report) if out.as_json else outputs.as_text(report)
    click.echo(text, nl=not out.as_json)
    if not report.passed:
        raise SystemExit(AGAINST)
    if accepted is not None:
        names = list(datasets) or check.data_sets_in(results)
        note = accepted_runs.accept(results, accepted, names, reason or "")
        click.echo(f"accepted: {', '.join(note['datasets'])} in {accepted}", err=out.as_json)
