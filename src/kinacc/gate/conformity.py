"""Check one table against its schema: types, units, metadata, limits, row keys."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.tables import store
from kinacc.tables.columns import JOINTS_MAX, JOINTS_MIN, Artefact, Column, Columns, joint_count
from kinacc.tables.contract import PROVENANCE_KEYS


def check_file(path: Path, artefact: Artefact) -> tuple[Columns | None, list[Problem]]:
    """Columns of a file and what is wrong with it; None for columns no rule could be held to."""
    try:
        table = store.read_arrow(path)
        columns, schema = store.columns_in(table), table.schema
    except InputError as error:
        return None, [replace(problem, fix="") for problem in error.problems]
    structure = _structure(path, artefact, schema)
    problems = [*structure, *_provenance(path, schema.metadata or {})]
    known = {column.name: column for column in artefact.for_joints(joint_count(artefact, columns))}
    for name, column in known.items():
        if name in columns and _kind_fits(column, columns[name]):
            problems += _values(path, column, columns[name])
    if not structure:
        problems += _unique(path, artefact, columns)
    return (None if structure else columns), problems


def _structure(path: Path, artefact: Artefact, schema) -> list[Problem]:
    joints = joint_count(artefact, schema.names)
    if artefact.has_joints and not JOINTS_MIN <= joints <= JOINTS_MAX:
        return [Problem(str(path), f"{joints} joints", f"{JOINTS_MIN} to {JOINTS_MAX} joints")]
    expected = store.arrow_schema(artefact.name, joints, given=schema.names)
    problems = [
        Problem(f"{path}, column {name}", "not in the contract", ", ".join(expected.names))
        for name in schema.names
        if name not in expected.names
    ]
    for field in expected:
        where = f"{path}, column {field.name}"
        if field.name not in schema.names:
            problems.append(Problem(where, "missing"))
            continue
        found = schema.field(field.name)
        if found.type != field.type:
            problems.append(Problem(where, f"is of type {found.type}", str(field.type)))
        for key in (b"unit", b"meaning"):
            said, wanted = (found.metadata or {}).get(key), field.metadata[key]
            if said != wanted:
                text = "nothing" if said is None else repr(said.decode(errors="replace"))
                what = f"{key.decode()} is {text}"
                problems.append(Problem(where, what, repr(wanted.decode())))
    return problems


def _provenance(path: Path, metadata: Mapping[bytes, bytes]) -> list[Problem]:
    keys = {key.decode(errors="replace"): value for key, value in metadata.items()}
    allowed = "exactly " + ", ".join(PROVENANCE_KEYS)
    missing = [key for key in PROVENANCE_KEYS if not keys.get(key)]
    extra = sorted(set(keys) - set(PROVENANCE_KEYS))
    return [Problem(str(path), f"schema metadata lacks {key}", allowed) for key in missing] + [
        Problem(str(path), f"schema metadata has {key!r}", allowed) for key in extra
    ]


def _kind_fits(column: Column, values: np.ndarray) -> bool:
    return (column.kind == "text") == (values.dtype == object)


def _values(path: Path, column: Column, values: np.ndarray) -> list[Problem]:
    where = f"{path}, column {column.name}"
    unit = f" {column.unit}" if column.unit not in ("", "1") else ""
    allowed = f"{column.limits}{unit}"
    problems = []
    null = np.array([value is None for value in values], dtype=bool)
    if column.kind != "text":
        null = np.isnan(values)
    if null.any() and not column.nullable:
        problems.append(Problem(where, f"null in {store.rows(null)}", "a value in every row"))
    wrong = ~null & ~_allowed(column, values, null)
    if wrong.any():
        first = values[int(np.argmax(wrong))]
        text = repr(first) if isinstance(first, str) else f"{first:g}"
        problems.append(Problem(where, f"{text}{unit} in {store.rows(wrong)}", allowed))
    return problems


def _allowed(column: Column, values: np.ndarray, null: np.ndarray) -> np.ndarray:
    if column.kind == "text":
        # Tables repeat few words many times: judge each word once.
        words = {word: _word_fits(column, word) for word in set(values[~null])}
        return np.array([words.get(value, True) for value in values], dtype=bool)
    good = ~np.isinf(values)
    if column.choices:
        good &= np.isin(values, np.array(column.choices, dtype=float))
    slack = 1e-9 * max(abs(column.low or 0.0), abs(column.high or 0.0))
    with np.errstate(invalid="ignore"):
        if column.low is not None:
            good &= values >= column.low - slack
        if column.high is not None:
            good &= values <= column.high + slack
    return good


def _word_fits(column: Column, word: str) -> bool:
    if column.choices and word not in column.choices:
        return False
    if column.pattern and not re.fullmatch(column.pattern, word):
        return False
    return bool(word.strip())


def _unique(path: Path, artefact: Artefact, columns: Columns) -> list[Problem]:
    """Rows that share a key; null counts as a value of its own."""
    rows = len(columns[artefact.key[0]])
    if not rows:
        if artefact.may_be_empty:
            return []
        return [Problem(str(path), "has no rows", "at least one row")]
    number = np.zeros(rows, dtype=np.int64)
    for name in artefact.key:
        own = _numbered(columns[name])
        number = np.unique(number * (own.max() + 1) + own, return_inverse=True)[1]
    repeated = np.bincount(number)[number] > 1
    if not repeated.any():
        return []
    row = int(np.argmax(repeated))
    words = ", ".join(f"{name} {columns[name][row]}" for name in artefact.key)
    allowed = f"one row per {', '.join(artefact.key)}"
    return [Problem(str(path), f"{words} in {store.rows(repeated)}", allowed)]


def _numbered(values: np.ndarray) -> np.ndarray:
    """A number (n,) from 0 on for each of the values, the same for the same; null is one."""
    if values.dtype != object:
        return np.unique(values, return_inverse=True)[1]
    known: dict[object, int] = {}  # sorting texts takes a hundred times as long
    return np.fromiter((known.setdefault(each, len(known)) for each in values), np.int64)
