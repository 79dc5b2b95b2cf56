"""Check one table against its schema: types, units, metadata, limits, row keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from kinacc.errors import InputError, Problem, first_few
from kinacc.tables import store
from kinacc.tables.columns import Artefact, Column


def check_file(path: Path, artefact: Artefact) -> list[Problem]:
    """Hold the table in a file to its schema: types, units, metadata, limits and row keys.

    Parameters
    ----------
    path
        A Parquet file.
    artefact
        Its schema.

    Returns
    -------
    list of Problem
        Empty for a table that conforms.
    """
    try:
        table = store.read_arrow(path)
        frame = table.to_pandas()
        provenance = {key.decode(): value for key, value in (table.schema.metadata or {}).items()}
        schema = store.to_table(artefact.name, frame, provenance).schema
    except (InputError, UnicodeDecodeError, pa.ArrowException) as error:
        return [*getattr(error, "problems", [Problem(str(path), f"not readable: {error}")])]
    stored = {item.name: (item.type, item.metadata) for item in table.schema}
    if wrong := [e.name for e in schema if stored[e.name] != (e.type, e.metadata)]:
        message = f"columns of another type, unit or meaning: {first_few(wrong)}"
        return [Problem(str(path), message)]
    problems: list[Problem] = []
    if not all(provenance.values()):
        problems.append(Problem(str(path), f"schema metadata {provenance}", "a value for each"))
    for column in artefact.in_file(frame.columns):
        problems += _values(f"{path}, column {column.name}", column, frame[column.name])
    repeated = frame.duplicated([*artefact.key], keep=False)
    if not len(frame) and not artefact.may_be_empty:
        problems.append(Problem(str(path), "has no rows", "at least one row"))
    if repeated.any():
        allowed = f"one row per {', '.join(artefact.key)}"
        problems.append(Problem(str(path), f"same key in {store.rows(repeated)}", allowed))
    return problems


def _values(where: str, column: Column, values: pd.Series) -> Iterator[Problem]:
    supplied = values.dropna()
    if column.kind == "text":
        good = supplied.str.strip() != ""
        if column.pattern:
            good &= supplied.str.fullmatch(column.pattern)
    else:
        supplied = supplied.astype(float)
        slack = 1e-9 * max(abs(column.low or 0.0), abs(column.high or 0.0))
        low = -np.inf if column.low is None else column.low
        high = np.inf if column.high is None else column.high
        good = supplied.between(low - slack, high + slack)
    if column.choices:
        good &= supplied.isin(column.choices)
    if not good.all():
        wrong = (~good).reindex(values.index, fill_value=False)
        message = f"{values[wrong].iloc[0]} in {store.rows(wrong)}"
        yield Problem(where, message, f"{column.limits} {column.unit}".strip())
