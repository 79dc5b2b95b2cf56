"""Two results compared table by table, within the tolerances of their columns.

Counts, codes, verdicts and words are compared exactly, numbers within the tolerance of their unit
(:data:`kinacc.tables.columns.SAME_WITHIN`), rows by the key of their table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from kinacc.errors import input_error
from kinacc.tables import store
from kinacc.tables.columns import SAME_AMONG, SAME_WITHIN, Column
from kinacc.tables.contract import ARTEFACTS

_RELATIVE = 1e-6  # of variances, which have the units of both parameters
_KEY_DIGITS = 9
# Rows of a fit that rounding alone decides.
_ROUNDING = ("last_step", "undetermined_direction")


def compare_folders(before: Path, now: Path) -> Iterator[str]:
    """Compare all tables below two folders.

    Parameters
    ----------
    before, now
        Folders of results. Tables that only ``now`` has do not count.

    Yields
    ------
    str
        A line on every column that differs by more than its tolerance, see :func:`compare_tables`.

    Raises
    ------
    InputError
        Where ``before`` has no table.
    """
    paths = sorted(before.rglob("*.parquet"))
    if not paths:
        raise input_error(str(before), "holds no table", "a folder of results")
    for path in paths:
        name = path.relative_to(before)
        if (now / name).is_file():
            yield from compare_tables(path, now / name)
        else:
            yield f"{name}: missing"


def compare_tables(before: Path, now: Path) -> Iterator[str]:
    """Compare two tables of one artefact.

    Parameters
    ----------
    before, now
        Parquet files named by their artefact.

    Yields
    ------
    str
        A line on columns and rows that one of them lacks, and on every column that differs: how
        many rows, the first by its key, and the largest difference of numbers.

    Raises
    ------
    InputError
        For a file that is no table.
    """
    name = before.stem if before.stem in ARTEFACTS else before.parent.name
    artefact = ARTEFACTS.get(name)
    old, new = map(store.read_table, (before, now))
    if old.equals(new):
        return
    for column in old.columns.symmetric_difference(new.columns):
        yield f"{name}, column {column}: {'missing' if column in old else 'new'}"
    known = {item.name: item for item in artefact.in_file(old.columns)} if artefact else {}
    key = [item for item in (artefact.key if artefact else ()) if item in old and item in new]
    old, new = (_by_key(table, key, name) for table in (old, new))
    for word, single, second in (("missing", old, new), ("new", new, old)):
        only = single.index.difference(second.index)
        if len(only):
            yield f"{name}: {len(only)} rows {word}, first {_row(key, only[0])}"
    common = old.index.intersection(new.index)
    old, new = (table.loc[common].reset_index(drop=True) for table in (old, new))
    for column in old.columns.intersection(new.columns).difference(key, sort=False):
        single, second, text = old[column], new[column], ""
        same = (single == second) | (single.isna() & second.isna())
        if single.dtype.kind in "fiu" and second.dtype.kind in "fiu":
            apart = (second.astype(float) - single.astype(float)).abs()
            same |= apart <= _tolerance(known.get(column), old)
            unit = known[column].unit if column in known else ""
            text = f", at most {apart[~same].fillna(0.0).max():.3g} {unit}"
        rows = np.flatnonzero(~same)
        if rows.size:
            pair = f"{single.iloc[rows[0]]!r} -> {second.iloc[rows[0]]!r}"
            first = f"first {_row(key, common[rows[0]])}: {pair}{text}"
            yield f"{name}, column {column}: {rows.size} rows differ, {first}"


def _by_key(table: pd.DataFrame, key: list[str], name: str) -> pd.DataFrame:
    """Rows by their key and, where several share one, a running number."""
    if name.endswith("_fit"):
        table = table[~table["quantity"].isin(_ROUNDING)]
    if not key:
        return table.reset_index(drop=True)
    keys = table[key].round(_KEY_DIGITS).astype(object)
    keys = keys.where(keys.notna(), "")
    keys["running"] = keys.groupby(key).cumcount()
    return table.set_index(pd.MultiIndex.from_frame(keys))


def _row(key: Sequence[str], values: Any) -> str:
    if not key:
        return str(values)
    return ", ".join(
        f"{name}={value}" for name, value in zip(key, values, strict=False) if value != ""
    )


def _tolerance(column: Column | None, rows: pd.DataFrame) -> np.ndarray | float:
    """What numbers of a column may differ by: one for all, or one for each row."""
    if column is None:
        return 0.0
    if (within := column.same_within) is not None:
        return within
    if column.unit == "product of the units of both":
        return _RELATIVE * float(np.nanmax(np.abs(rows[column.name].to_numpy(float)), initial=0.0))
    if "error" in rows:
        lengths = rows["error"].str.startswith("delta").to_numpy(bool)
        return np.where(lengths, SAME_WITHIN["mm"], SAME_WITHIN["rad"])
    return rows["unit"].map(SAME_AMONG).fillna(_RELATIVE).to_numpy(float)
