"""Two results compared table by table, within the tolerances of their columns.

Counts, codes, verdicts and words are compared exactly, numbers within the tolerance of their unit
(:data:`kinacc.tables.columns.SAME_WITHIN`), rows by the key of their table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from kinacc.errors import input_error
from kinacc.tables import store
from kinacc.tables.columns import (
    BY_POSES,
    BY_ROW,
    BY_STD,
    SAME_AMONG,
    SAME_WITHIN,
    Column,
    joint_count,
)
from kinacc.tables.contract import ARTEFACTS

_RELATIVE = 1e-6  # of variances, which have the units of both parameters
_KEY_DIGITS = 9
# Rows of a fit that rounding alone decides.
_ROUNDING = ("last_step", "gap", "undetermined_direction")


@dataclass(frozen=True)
class Difference:
    """One column that differs, or (``column`` empty) rows or a file that only one side has.

    ``rows`` is their number and ``row`` the first by its key; ``largest`` is the largest
    difference of numbers in ``unit``.
    """

    table: str
    column: str
    what: str
    rows: int = 0
    row: str = ""
    largest: float | None = None
    unit: str = ""

    def __str__(self) -> str:
        place = f"{self.table}, column {self.column}" if self.column else self.table
        return f"{place}: {self.what}"


def compare_folders(before: Path, now: Path) -> Iterator[Difference]:
    """Compare all tables below two folders.

    Parameters
    ----------
    before, now
        Folders of results. Tables that only ``now`` has do not count.

    Yields
    ------
    Difference
        Of every column that differs by more than its tolerance, see :func:`compare_tables`.

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
            yield Difference(str(name), "", "missing")


def compare_tables(before: Path, now: Path) -> Iterator[Difference]:
    """Compare two tables of one artefact.

    Parameters
    ----------
    before, now
        Parquet files named by their artefact.

    Yields
    ------
    Difference
        Of columns and rows that one lacks, and of every column that differs.

    Raises
    ------
    InputError
        For a file that is no table.
    """
    name = before.stem if before.stem in ARTEFACTS else before.parent.name
    artefact = ARTEFACTS.get(name)
    old, new = map(store.read_table, (before, now))
    for column in old.columns.symmetric_difference(new.columns):
        yield Difference(name, str(column), "missing" if column in old else "new")
    columns = artefact.for_joints(joint_count(artefact, old.columns)) if artefact else ()
    known = {item.name: item for item in columns}
    key = [item for item in (artefact.key if artefact else ()) if item in old and item in new]
    old, new = (_by_key(table, key, name) for table in (old, new))
    for word, single, second in (("missing", old, new), ("new", new, old)):
        only = single.index.difference(second.index)
        if len(only):
            yield Difference(name, "", f"{len(only)} rows {word}, first {_row(key, only[0])}")
    common = old.index.intersection(new.index)
    old, new = old.loc[common], new.loc[common]
    for column in old.columns.intersection(new.columns).difference(key, sort=False):
        single, second, largest, text = old[column], new[column], None, ""
        differs = (single.isna() != second.isna()).to_numpy()
        both = (single.notna() & second.notna()).to_numpy()
        unit = known[column].unit if column in known else ""
        if single.dtype.kind in "fiu" and second.dtype.kind in "fiu":
            apart = np.abs(second.to_numpy(float) - single.to_numpy(float))
            beyond = both & ~(apart <= _tolerance(known.get(column), old))
            largest = float(np.max(apart[beyond], initial=0.0))
            text = f", at most {largest:.3g} {unit}"
        else:
            beyond = both & (single.to_numpy(object) != second.to_numpy(object))
        rows = np.flatnonzero(differs | beyond)
        if rows.size:
            row = _row(key, common[rows[0]])
            pair = f"{single.iloc[rows[0]]!r} -> {second.iloc[rows[0]]!r}"
            text = f"{rows.size} rows differ, first {row}: {pair}{text}"
            yield Difference(name, str(column), text, rows.size, row, largest, unit)


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
    if not isinstance(within := column.same_within, str):
        return within
    if within == BY_STD:
        return _RELATIVE * float(np.nanmax(np.abs(rows[column.name].to_numpy(float)), initial=0.0))
    if within not in (BY_ROW, BY_POSES) or column.unit in SAME_WITHIN:
        return SAME_WITHIN.get(column.unit, _RELATIVE)
    if "error" in rows:
        lengths = rows["error"].str.startswith("delta").to_numpy(bool)
        return np.where(lengths, SAME_WITHIN["mm"], SAME_WITHIN["rad"])
    units = rows["unit"] if "unit" in rows else pd.Series("", index=rows.index)
    return units.map(SAME_AMONG).fillna(_RELATIVE).to_numpy(float)
