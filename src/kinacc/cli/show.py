"""``kinacc show``: the tables of a folder, and one table in the terminal or in a file."""

from __future__ import annotations

import shlex
from pathlib import Path

import click
import pandas as pd
import pyarrow as pa

from kinacc.cli.output import answers
from kinacc.config.values import nearest
from kinacc.errors import InputError, Problem, first_few
from kinacc.tables import store
from kinacc.tables.contract import ARTEFACTS


@click.command("show")
@click.argument("path", type=click.Path(path_type=Path), default=Path("results"))
@click.argument("name", metavar="[TABLE]", required=False)
@click.option("--describe", is_flag=True, help="Unit, meaning and range of every column.")
@answers(table=True)
def show(path, name, describe, out) -> None:
    """Show a TABLE of results, or list the tables of the folder PATH.

    \b
    Example:
      kinacc show results/ur10_b
      kinacc show results/ur10_b residuals -o residuals.xlsx
    """
    place = find(path, name)
    if place.is_dir():
        table = listing(place)
        first = shlex.join(["kinacc", "show", str(place / str(table.iloc[0, 0]))])
        out.show({"rows": table}, table, [f"The first of these: {first}"], most=len(table))
        return
    table = described(place) if describe else frame(store.read_arrow(place, any_type=True), place)
    meaning = ARTEFACTS[place.stem].meaning if place.stem in ARTEFACTS else ""
    lines = [f"{place}: {len(table)} {'columns' if describe else 'rows'}. {meaning}".rstrip()]
    out.show({"rows": table}, table, lines, most=len(table) if describe else 24)


def find(path: Path, name: str | None) -> Path:
    """The file or folder meant. Raises InputError with what is there instead."""
    asked = path / (name or "")
    named = asked.with_name(f"{asked.name}.parquet") if asked.name else asked
    if place := next((item for item in (asked, named) if item.is_file()), None):
        return place
    if asked.is_dir():
        return asked
    there = sorted(item.stem for item in asked.parent.glob("*") if item.name[0] != ".")
    close = nearest(asked.stem, tuple(there))
    fix = f"did you mean {asked.with_name(close)}?" if close else ""
    raise InputError(Problem(str(asked), "no such table or folder", first_few(there, 30), fix))


def listing(folder: Path) -> pd.DataFrame:
    """Tables of a folder with rows and meaning, or its folders with tables. InputError if none."""
    rows = []
    for path in sorted(folder.glob("*.parquet")):
        meaning = ARTEFACTS[path.stem].meaning if path.stem in ARTEFACTS else ""
        try:
            rows.append((path.stem, str(store.row_count(path)), meaning.partition(". ")[0]))
        except InputError as error:
            rows.append((path.stem, "", error.problems[0].what))
    if rows:
        return pd.DataFrame(rows, columns=["table", "rows", "meaning"])
    within = [(item.name, len([*item.glob("*.parquet")])) for item in sorted(folder.iterdir())]
    if not any(count for _, count in within):
        raise InputError(Problem(str(folder), "holds no table", "the folder of a data set"))
    return pd.DataFrame([item for item in within if item[1]], columns=["folder", "tables"])


def frame(table: pa.Table, path: Path) -> pd.DataFrame:
    """A table read from a file. InputError where it is damaged."""
    try:
        table.validate(full=True)
        return table.to_pandas()
    except (ValueError, pa.ArrowException) as error:
        message = f"cannot be shown: {error}"
        raise InputError(Problem(str(path), message, fix=store.remake(path))) from None


def described(path: Path) -> pd.DataFrame:
    """Unit, meaning and range of every column of a file."""
    table = store.read_arrow(path, any_type=True)
    values, rows = frame(table, path), []
    for field in table.schema:
        known = {key.decode(): text.decode() for key, text in (field.metadata or {}).items()}
        there = values[field.name].dropna()
        if pd.api.types.is_numeric_dtype(there) and len(there):
            holds = f"{float(there.min()):.6g} to {float(there.max()):.6g}"
        else:
            holds = f"{there.astype(str).nunique()} different texts"
        rows.append((field.name, known.get("unit"), known.get("meaning"), holds))
    return pd.DataFrame(rows, columns=["column", "unit", "meaning", "holds"])
