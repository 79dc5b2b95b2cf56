"""``kinacc show``: the tables of a folder, and one table in the terminal or in a file."""

from __future__ import annotations

import re
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
    place = find(path / (name or ""))
    if place.is_dir():
        table = listing(place)
        first = shlex.join(["kinacc", "show", str(place / str(table.iloc[0, 0]))])
        out.show({"rows": table}, table, [f"The first of these: {first}"], most=len(table))
        return
    content = store.read_arrow(place, any_type=True)
    try:
        content.validate(full=True)
        table = content.to_pandas()
    except (ValueError, pa.ArrowException) as error:
        message = f"cannot be shown: {error}"
        raise InputError(Problem(str(place), message, fix=store.remake(place))) from None
    lines = [f"{place}: {table.shape[describe]} {'columns' if describe else 'rows'}. "]
    lines[0] += ARTEFACTS[place.stem].meaning if place.stem in ARTEFACTS else ""
    table = described(content.schema, table) if describe else table
    out.show({"rows": table}, table, [lines[0].rstrip()], most=len(table) if describe else 24)


def find(path: Path) -> Path:
    """The file or folder meant. Raises InputError with what is there instead."""
    for place in (path, path.with_name(f"{path.name}.parquet") if path.name else path):
        if place.is_file():
            return place
    if path.is_dir():
        return path
    there = sorted(item.stem for item in path.parent.glob("[!.]*"))
    close = nearest(path.stem, tuple(there))
    fix = f"did you mean {path.with_name(close)}?" if close else ""
    raise InputError(Problem(str(path), "no such table or folder", first_few(there, 30), fix))


def listing(folder: Path) -> pd.DataFrame:
    """Tables of a folder with rows and meaning, or its folders with tables. InputError if none."""
    rows = []
    for path in sorted(folder.glob("*.parquet")):
        meaning = ARTEFACTS[path.stem].meaning if path.stem in ARTEFACTS else ""
        try:
            rows.append(
                (
                    path.stem,
                    str(store.row_count(path)),
                    re.split(r"(?<!Fig)(?<!Figs)[.] ", meaning)[0],
                )
            )
        except InputError as error:
            rows.append((path.stem, "", error.problems[0].what))
    if rows:
        return pd.DataFrame(rows, columns=["table", "rows", "meaning"])
    tables = pd.Series([path.parent.name for path in folder.glob("*/*.parquet")], dtype=object)
    if tables.empty:
        raise InputError(Problem(str(folder), "holds no table", "the folder of a data set"))
    return tables.value_counts().sort_index().rename_axis("folder").reset_index(name="tables")


def described(schema: pa.Schema, table: pd.DataFrame) -> pd.DataFrame:
    """Unit, meaning and range of every column."""
    rows = []
    for field in schema:
        known = {key.decode(): text.decode() for key, text in (field.metadata or {}).items()}
        values = table[field.name].dropna()
        if pd.api.types.is_numeric_dtype(values) and len(values):
            holds = f"{float(values.min()):.6g} to {float(values.max()):.6g}"
        else:
            holds = f"{values.astype(str).nunique()} different texts"
        rows.append((field.name, known.get("unit"), known.get("meaning"), holds))
    return pd.DataFrame(rows, columns=["column", "unit", "meaning", "holds"])
