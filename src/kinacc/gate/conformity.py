"""Check one table against its schema: types, units, metadata, limits, row keys."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from kinacc.errors import InputError, Problem
from kinacc.tables import store
from kinacc.tables.columns import JOINTS_MAX, JOINTS_MIN, Artefact, Column, joint_count
from kinacc.tables.contract import PROVENANCE_KEYS


def check_file(path: Path, artefact: Artefact) -> list[Problem]:
    """Problems of the table in a file, by its schema."""
    try:
        table = store.read_arrow(path)
        frame = table.to_pandas()
    except (InputError, UnicodeDecodeError, pa.ArrowException) as error:
        found = getattr(error, "problems", [Problem(str(path), f"not readable: {error}")])
        return [replace(problem, fix="") for problem in found]
    problems = list(_structure(path, artefact, table.schema))
    if problems:
        return problems
    for column in artefact.in_file(joint_count(artefact, frame.columns), frame.columns):
        problems += _values(f"{path}, column {column.name}", column, frame[column.name])
    repeated = frame.duplicated([*artefact.key], keep=False)
    if not len(frame) and not artefact.may_be_empty:
        problems.append(Problem(str(path), "has no rows", "at least one row"))
    if repeated.any():
        allowed = f"one row per {', '.join(artefact.key)}"
        problems.append(Problem(str(path), f"same key in {_rows(repeated)}", allowed))
    return problems


def _structure(path: Path, artefact: Artefact, schema: pa.Schema) -> Iterator[Problem]:
    joints = joint_count(artefact, schema.names)
    if artefact.has_joints and not JOINTS_MIN <= joints <= JOINTS_MAX:
        yield Problem(str(path), f"{joints} joints", f"{JOINTS_MIN} to {JOINTS_MAX} joints")
        return
    expected = store.arrow_schema(artefact.name, joints, given=schema.names)
    for name in dict.fromkeys([*expected.names, *schema.names]):
        found, wanted = (
            _words(each.field(name)) if each.names.count(name) == 1 else "not there once"
            for each in (schema, expected)
        )
        if found != wanted:
            yield Problem(f"{path}, column {name}", found, wanted)
    metadata = schema.metadata or {}
    given = sorted(key.decode(errors="replace") for key, value in metadata.items() if value)
    if given != sorted(PROVENANCE_KEYS) or len(metadata) != len(given):
        yield Problem(str(path), f"schema metadata {given}", ", ".join(PROVENANCE_KEYS))


def _words(field: pa.Field) -> str:
    metadata = field.metadata or {}
    unit, meaning = (
        metadata.get(key, b"").decode(errors="replace") for key in (b"unit", b"meaning")
    )
    return f"type {field.type}, unit {unit!r}, meaning {meaning!r}"


def _values(where: str, column: Column, values: pd.Series) -> Iterator[Problem]:
    given = values.dropna()
    if len(given) < len(values) and not column.nullable:
        yield Problem(where, f"null in {_rows(values.isna())}", "a value in every row")
    if column.kind == "text":
        good = given.str.strip() != ""
        if column.pattern:
            good &= given.str.fullmatch(column.pattern)
    else:
        given = given.astype(float)
        slack = 1e-9 * max(abs(column.low or 0.0), abs(column.high or 0.0))
        low, high = (
            default if limit is None else limit
            for limit, default in ((column.low, -np.inf), (column.high, np.inf))
        )
        good = np.isfinite(given) & given.between(low - slack, high + slack)
    if column.choices:
        good &= given.isin(column.choices)
    if not good.all():
        wrong = (~good).reindex(values.index, fill_value=False)
        what = f"{values[wrong].iloc[0]} in {_rows(wrong)}"
        yield Problem(where, what, f"{column.limits} {column.unit}".strip())


def _rows(mask: pd.Series) -> str:
    return store.rows(mask.to_numpy())
