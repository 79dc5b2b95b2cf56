"""Two tables of one artefact held to each other: rows by their key, numbers within what is same."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from kinacc.artifacts.columns import (
    BY_POSES,
    BY_ROW,
    BY_STD,
    SAME_AMONG,
    SAME_WITHIN,
    Artefact,
    Column,
    Columns,
    joint_count,
)
from kinacc.artifacts.store import columns_in

# Of a row whose unit has no entry, as of one that a later version states.
_OF_ANY_UNIT = 1e-9
# What rounding alone decides: how far the last step of a fit was, and how far the smallest singular
# value that counts is above one that is zero but for rounding.
_ROUNDING = ("last_step", "gap")
_DIRECTION = "undetermined_direction"
_MEAN, _STD_ERROR, _REPETITIONS = "mean_mm", "std_error_mm", "repetitions"
_ALARM = 1e-3


@dataclass(frozen=True)
class Found:
    """One column that differs, or (``column`` empty) rows that one of both tables has alone.

    ``first`` is the first row by its key; ``held_to_poses`` where the column is to be compared
    through the poses that the model predicts.
    """

    column: str
    what: str
    rows: int
    of: int
    first: str = ""
    largest: float | None = None
    unit: str = ""
    allowed: float | None = None
    held_to_poses: bool = False


def differences(artefact: Artefact, before: pa.Table, now: pa.Table) -> list[Found]:
    """What differs between the accepted table of an artefact and the one there now."""
    old, new = _whole(artefact, before), _whole(artefact, now)
    found = _columns(old, new, now.num_rows)
    joints = max(joint_count(artefact, names) for names in (old, new))
    known = {each.name: each for each in artefact.for_joints(joints)}
    key = [name for name in artefact.key if name in old and name in new]
    rows = aligned([old[name] for name in key], [new[name] for name in key])
    found += _rows(key, old, rows.only_before, "fewer") + _rows(key, new, rows.only_now, "more")
    old = {name: values[rows.before] for name, values in old.items()}
    new = {name: values[rows.now] for name, values in new.items()}
    for name in old.keys() & new.keys():
        column = known.get(name)
        if column is None or name in key:
            continue
        difference = _of_column(column, old, new, key)
        found += [difference] if difference else []
    places = {name: place for place, name in enumerate(known)}
    return sorted(found, key=lambda each: (places.get(each.column, -1), each.what))


def within_chance(artefact: Artefact, before: pa.Table, now: pa.Table) -> list[Found]:
    """What differs of a table of simulations drawn anew beyond chance: means with standard errors.

    Two means differ beyond chance where they are further apart than t standard errors of their
    difference, t of Student's distribution with as many degrees of freedom as the mean of fewer
    simulations has, such that one of a thousand tables in which nothing changed is said to differ,
    whatever the number of its means (Bonferroni). Of one simulation there is no standard error,
    and nothing is told. Other columns, single simulations, smallest and largest values, are not
    compared; nor are tables that have no means.
    """
    import scipy

    old, new = columns_in(before), columns_in(now)
    if not {_MEAN, "rmse_mm"} <= old.keys() & new.keys():
        return []
    key = [*artefact.key]
    rows = aligned([old[name] for name in key], [new[name] for name in key])
    found = _rows(key, old, rows.only_before, "fewer") + _rows(key, new, rows.only_now, "more")
    old = {name: values[rows.before] for name, values in old.items()}
    new = {name: values[rows.now] for name, values in new.items()}
    freedom = np.minimum(old[_REPETITIONS], new[_REPETITIONS]) - 1.0
    t = scipy.special.stdtrit(freedom, 1.0 - _ALARM / (2.0 * max(len(freedom), 1)))
    allowed = t * np.hypot(_std_errors(old), _std_errors(new))
    column = next(each for each in artefact.columns if each.name == _MEAN)
    difference = _of_numbers(column, old, new, key, allowed)
    if difference:
        words = f"; {t.max():.2f} standard errors (study_summary.{_STD_ERROR}) are allowed"
        found.append(replace(difference, what=difference.what + words))
    return found


def _std_errors(summary: Columns) -> np.ndarray:
    """Standard errors of the means; by other columns where a summary does not state them."""
    if _STD_ERROR in summary:
        return summary[_STD_ERROR]
    variance = np.maximum(summary["rmse_mm"] ** 2 - summary["bias_mm"] ** 2, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(variance / (summary[_REPETITIONS] - 1.0))


def _whole(artefact: Artefact, table: pa.Table) -> Columns:
    """A table's columns; rows of a fit that rounding alone decides are left out."""
    columns = columns_in(table)
    if {"quantity", "number", "parameter", "value"} <= columns.keys():
        kept = ~np.isin(columns["quantity"].astype(str), (*_ROUNDING, _DIRECTION))
        columns = {name: values[kept] for name, values in columns.items()}
    return columns


def _columns(old: Columns, new: Columns, count: int) -> list[Found]:
    fewer = [Found(name, "is not there any more", count, count) for name in old if name not in new]
    return fewer + [Found(name, "is new", count, count) for name in new if name not in old]


@dataclass(frozen=True)
class Aligned:
    """Rows of two tables by their key: those of both, in the same order, and those of one alone."""

    before: np.ndarray
    now: np.ndarray
    only_before: np.ndarray
    only_now: np.ndarray


def aligned(old: list[np.ndarray], new: list[np.ndarray]) -> Aligned:
    """Which rows of two tables have the same key; numbers of keys may differ as rounding goes."""
    none = np.empty(0, dtype=np.int64)
    count = len(old[0]) if old else 0
    if count == (len(new[0]) if new else 0) and all(map(_keys_equal, old, new)):
        every = np.arange(count)
        return Aligned(every, every, none, none)
    places = {name: place for place, name in enumerate(_keys(old))}
    names = _keys(new)
    at = np.array([places.get(name, -1) for name in names], dtype=np.int64)
    there = np.flatnonzero(at >= 0)
    only = np.setdiff1d(np.arange(count), at[there])
    order = np.argsort(at[there], kind="stable")
    return Aligned(at[there][order], there[order], only, np.flatnonzero(at < 0))


def _keys_equal(old: np.ndarray, new: np.ndarray) -> bool:
    if old.dtype == object or new.dtype == object:
        return bool(np.all(old == new))
    return bool(np.all(np.isclose(old, new, rtol=1e-9, atol=1e-9, equal_nan=True)))


def _keys(columns: list[np.ndarray]) -> list[tuple]:
    """Keys of rows, of those that are there several times with a running number."""
    counted: dict[tuple, int] = {}
    found = []
    for row in zip(*(map(_of_key, values.tolist()) for values in columns), strict=True):
        counted[row] = counted.get(row, -1) + 1
        found.append((*row, counted[row]))
    return found


def _of_key(value: object) -> object:
    if not isinstance(value, float):
        return value
    return None if np.isnan(value) else float(f"{value:.9g}") + 0.0


def _rows(key: list[str], columns: Columns, places: np.ndarray, which: str) -> list[Found]:
    if not places.size:
        return []
    count, first = int(places.size), named(key, columns, int(places[0]))
    what = f"{count} row{'s' if count > 1 else ''} {which}"
    return [Found("", what, count, len(next(iter(columns.values()))), first)]


def named(key: Iterable[str], columns: Mapping[str, np.ndarray], row: int) -> str:
    """A row by its key: ``joint=2, error=delta_x``."""
    told = {name: columns[name][row] for name in key}
    return ", ".join(
        f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
        for name, value in told.items()
        if value is not None and not (isinstance(value, float) and np.isnan(value))
    )


def _of_column(column: Column, old: Columns, new: Columns, key: list[str]) -> Found | None:
    a, b = old[column.name], new[column.name]
    if column.kind == "text" or a.dtype == object or b.dtype == object:
        other = np.flatnonzero(a != b)
        if not other.size:
            return None
        row = int(other[0])
        what = f"{_quoted(a[row])} before, {_quoted(b[row])} now"
        return Found(column.name, what, int(other.size), len(b), named(key, new, row))
    return _of_numbers(column, old, new, key, _allowed(column, old, new))


def _of_numbers(
    column: Column, old: Columns, new: Columns, key: list[str], allowed: np.ndarray | float
) -> Found | None:
    a, b = (each[column.name].astype(np.float64) for each in (old, new))
    null = np.isnan(a) != np.isnan(b)
    apart = np.abs(b - a)  # NaN where there is null
    with np.errstate(invalid="ignore"):
        other = np.flatnonzero(null | (apart > allowed))
    if not other.size:
        return None
    row = int(other[0])
    numbers = other[~np.isnan(apart[other])]
    largest = int(numbers[np.argmax(apart[numbers])]) if numbers.size else None
    return Found(
        column.name,
        f"{_number(a[row])} before, {_number(b[row])} now",
        int(other.size),
        len(b),
        named(key, new, row),
        None if largest is None else float(apart[largest]),
        _unit(column, new, row if largest is None else largest),
        None if largest is None else float(np.broadcast_to(allowed, apart.shape)[largest]),
        column.same_within == BY_POSES,
    )


def _allowed(column: Column, old: Columns, new: Columns) -> np.ndarray | float:
    """What the numbers of a column may differ by, (rows,) or one for all."""
    within = column.same_within
    if not isinstance(within, str):
        return within
    if within == BY_STD:
        return _of_covariance(column.name, old, new)
    units = _units(column, new, len(old[column.name]))
    return np.array([SAME_AMONG.get(unit, _OF_ANY_UNIT) for unit in units])


def _units(column: Column, columns: Columns, count: int) -> list[str]:
    """The unit of every row."""
    if column.unit in SAME_WITHIN:
        return [column.unit] * count
    if "error" in columns:  # of a coefficient
        return ["mm" if str(each).startswith("delta") else "rad" for each in columns["error"]]
    return [str(each) for each in columns["unit"]] if "unit" in columns else [column.unit] * count


def _unit(column: Column, columns: Columns, row: int) -> str:
    if column.same_within in (BY_ROW, BY_POSES):
        return _units(column, columns, row + 1)[row]
    return "" if column.unit == "1" else column.unit


def _of_covariance(name: str, old: Columns, new: Columns) -> np.ndarray:
    """What entries of a covariance may differ by if both standard deviations may by their unit."""
    parameters = [*zip(new["parameter"], new["other"], strict=True)]
    variances = {
        each: max(abs(float(was)), abs(float(is_)))
        for (each, other), was, is_ in zip(
            parameters, old["covariance"], new["covariance"], strict=True
        )
        if each == other
    }
    std = {each: np.sqrt(variance) for each, variance in variances.items()}
    found = np.empty(len(parameters))
    for row, pair in enumerate(parameters):
        (within, size), (other_within, other_size) = (
            (
                SAME_WITHIN["rad" if each.endswith("rad") or ".eps" in each else "mm"],
                std.get(each, 0),
            )
            for each in pair
        )
        least = within * other_within
        if name == "correlation":
            sizes = size * other_size
            found[row] = 2.0 if sizes <= least else within / size + other_within / other_size
        else:
            found[row] = within * other_size + other_within * size + least
    return found


def _quoted(value: object) -> str:
    return "nothing" if value is None else repr(value)


def _number(value: float) -> str:
    return "null" if np.isnan(value) else f"{value:.9g}"
