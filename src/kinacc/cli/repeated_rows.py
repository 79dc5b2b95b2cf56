"""A file of repeated readings: which rows are of one pose, one side and one visit, and when."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import datetime, time, timedelta

import numpy as np

from kinacc.checks.digits import smallest_step, step_between
from kinacc.checks.repeatability import Repeated
from kinacc.cli.rows import LENGTH, Quantities, open_table
from kinacc.errors import Problem, first_few, refuse
from kinacc.measurements.layout import columns_of_quantity, listed
from kinacc.measurements.table import RawTable, numbers

VISITS, STAYS = "visits", "stays"
_VISIT, _SIDE = ("visit", "approach"), ("side", "direction")
_HOURS = {"time_s": 1.0 / 3600.0, "time_min": 1.0 / 60.0, "time_h": 1.0}
_ONE_OF_EACH = ("target", "session", "instrument")
_NO_NAME = ("", "nan", "None")  # + and - are names of sides
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:\.\d+)?))?")


@dataclass(frozen=True)
class Rows:
    """Readings of a file, with the names of their poses and sides.

    ``sides``: None where no column tells them. ``hours`` (n,) is when each was read, from the
    first; None where the file does not say. ``resolution_mm`` (3,): step of the numbers.
    ``in_a_row``: all visits of a pose follow each other in the file. ``unused`` columns.
    """

    path: str
    read: Repeated
    poses: tuple[str, ...]
    sides: tuple[str, ...] | None
    row_names: tuple[str, ...]
    hours: np.ndarray | None
    resolution_mm: np.ndarray
    in_a_row: bool
    unused: tuple[str, ...]


def of_file(path: str, rows_are: str | None) -> Rows:
    """The repeated readings of a file. InputError listing everything that is wrong with it.

    ``rows_are``: what two rows of one pose are where no column tells visits: ``visits``, or
    ``stays``, readings between which the arm stayed.
    """
    table = open_table(path)
    reader = Quantities(table)
    problems = reader.problems
    position = reader.group(["x", "y", "z"], [LENGTH] * 3, True)
    pose = _names(table, ("pose",), problems)
    if "pose" not in table.columns:
        what = "is missing: which rows are readings of one pose"
        problems.append(Problem(f"{table.path}: column pose", what, fix=listed(table)))
    side, visit = _names(table, _SIDE, problems), _names(table, _VISIT, problems)
    for name in _ONE_OF_EACH:
        if name in table.columns and len(kinds := {*map(_text, table.columns[name])}) > 1:
            what = f"holds several: {first_few(sorted(kinds))}"
            fix = "give the rows of each in a file of their own"
            problems.append(Problem(f"{table.path}: column {name}", what, "one", fix))
    hours = _hours(table, reader, problems)
    told = _as_told(table, pose, visit, rows_are, problems)
    _require_one_side(table, pose, side, visit, problems)
    if position is not None:
        far = np.flatnonzero(np.abs(position).max(axis=1) > 1e6)
        if far.size:
            where = f"{table.path}: {table.rows_in_words(far)}"
            problems.append(Problem(where, "a position beyond a kilometre", "x, y, z in mm or m"))
    if pose is not None and len(set(pose)) == len(pose) and not problems:
        fix = "read some poses at least three times, leaving them between"
        problems.append(Problem(table.path, "no pose has more than one reading", fix=fix))
    refuse(problems, f"{table.path} cannot be used")
    own = [f"{each}" for each in range(len(table))] if told == VISITS else [""] * len(table)
    visit = own if visit is None else visit
    poses = list(dict.fromkeys(pose))
    of_side = list(zip(pose, side or [""] * len(pose), strict=True))
    of_visit = list(zip(of_side, visit, strict=True))
    read = Repeated(position, _numbered(pose), _numbered(of_side), _numbered(of_visit))
    used = {*reader.used, "pose", *_ONE_OF_EACH, *_SIDE, *_VISIT, *_HOURS, "time"}
    return Rows(
        table.path,
        read,
        tuple(poses),
        None if side is None else tuple(name for _, name in dict.fromkeys(of_side)),
        tuple(table.row_names.one(line) for line in table.line),
        hours,
        _steps_mm(table),
        _is_in_a_row(read),
        tuple(name for name in table.columns if name not in used),
    )


def _names(table: RawTable, columns: tuple[str, ...], problems: list[Problem]) -> list[str] | None:
    """Cells of the one of several columns that is there, as texts; None where none is."""
    there = [each for each in columns if each in table.columns]
    if not there:
        return None
    if len(there) > 1:
        where = f"{table.path}: columns {' and '.join(there)}"
        problems.append(Problem(where, "mean the same", f"one of {', '.join(columns)}"))
    names = [_text(each) for each in table.columns[there[0]]]
    gaps = np.array([row for row, name in enumerate(names) if name in _NO_NAME], dtype=int)
    if gaps.size:
        where = f"{table.path}: column {table.column_in_words(there[0])}"
        what = "an empty cell"
        problems.append(Problem(f"{where}, {table.rows_in_words(gaps)}", what, fix="fill it in"))
    return names


def _text(cell: object) -> str:
    """A cell as a name: 3 and 3.0 are the same."""
    if isinstance(cell, float) and cell.is_integer():
        cell = int(cell)
    return str(cell).strip()


def _as_told(table, pose, visit, rows_are: str | None, problems: list[Problem]) -> str:
    """What two rows of one pose are; asked about where neither columns nor their order tell."""
    if visit is not None:
        if rows_are is not None:
            what = f"is given, and {table.path} says it by a column {' or '.join(_VISIT)}"
            problems.append(Problem("--rows", what, fix="leave it out"))
        return ""
    if rows_are is not None or pose is None:
        return rows_are or VISITS
    following = [row for row in range(1, len(pose)) if pose[row] == pose[row - 1]]
    if following:
        where = f"{table.path}: {table.rows_in_words(np.array(following))}"
        what = "of the same pose as the row before, and it is not said whether the arm left it"
        fix = (
            "give --rows visits where the arm left the pose and came back before every row, --rows "
            "stays where it stayed, or number the visits of a pose in a column visit"
        )
        problems.append(Problem(where, what, fix=fix))
    return VISITS


def _require_one_side(table, pose, side, visit, problems: list[Problem]) -> None:
    """A problem for each visit that came from two sides."""
    if pose is None or side is None or visit is None:
        return
    first: dict[tuple[str, str], int] = {}
    for row, key in enumerate(zip(pose, visit, strict=True)):
        before = first.setdefault(key, row)
        if side[row] != side[before]:
            where = f"{table.path}: {table.rows_in_words(np.array([before, row]))}"
            what = f"visit {key[1]} of pose {key[0]} came from {side[before]} and from {side[row]}"
            fix = "number visits from different sides differently"
            problems.append(Problem(where, what, "one side for each visit", fix))


def _hours(table: RawTable, reader: Quantities, problems: list[Problem]) -> np.ndarray | None:
    """Hours (n,) of the readings from the first; None where no column says it."""
    there = [each for each in (*_HOURS, "time") if each in table.columns]
    if not there:
        return None
    if len(there) > 1:
        what = f"{', '.join(there)}: the time is given more than once"
        problems.append(Problem(f"{table.path}: columns", what, "one of them"))
    name = there[0]
    if name in _HOURS:
        values = numbers(table, name, problems) * _HOURS[name]
    else:
        values = np.array([_hour(cell) for cell in table.columns[name]])
        bad = np.flatnonzero(np.isnan(values))
        if bad.size:
            where = f"{table.path}: column time, {table.rows_in_words(bad)}"
            allowed = f"2026-05-04T13:20:05 or 13:20:05; or numbers in {', '.join(_HOURS)}"
            what = f"no time: {_text(table.columns[name][bad[0]])!r}"
            problems.append(Problem(where, what, allowed))
    return values - np.nanmin(values) if np.isfinite(values).any() else None


def _hour(cell: object) -> float:
    """Hours of a cell on a scale of its own; NaN where it is no time."""
    if isinstance(cell, time):
        cell = cell.isoformat()
    if isinstance(cell, str):
        text = cell.strip()
        if clock := _CLOCK.fullmatch(text):
            hours, minutes, seconds = (float(each or 0.0) for each in clock.groups())
            return hours + minutes / 60.0 + seconds / 3600.0
        try:
            cell = datetime.fromisoformat(text)
        except ValueError:
            return float("nan")
    if not isinstance(cell, datetime):
        return float("nan")
    zone = cell.utcoffset() or timedelta()
    return (cell.replace(tzinfo=None) - zone - datetime(2000, 1, 1)).total_seconds() / 3600.0


def _steps_mm(table: RawTable) -> np.ndarray:
    """Steps (3,) of the numbers of the axes, the coarsest of the columns of each.

    An axis whose numbers are all equal has that of the others; where all are, of the last digit.
    """
    found, digits = [], []
    for axis in "xyz":
        places = columns_of_quantity(table, axis, LENGTH)
        cells = [(table.columns[each.column], each.factor) for each in places]
        found.append(max(step_between(own, unit, table.decimal) for own, unit in cells))
        digits += [smallest_step([own], unit, table.decimal) for own, unit in cells]
    steps = np.array(found)
    return np.where(steps > 0.0, steps, steps.max() or max(digits))


def _numbered(keys: list) -> np.ndarray:
    """Numbers (n,) of keys in the order in which they come first."""
    number = {key: place for place, key in enumerate(dict.fromkeys(keys))}
    return np.array([number[key] for key in keys], dtype=int)


def _is_in_a_row(read: Repeated) -> bool:
    """Whether each pose is left once and for all: none is come back to after another."""
    changes = int(np.sum(np.diff(read.pose) != 0)) + 1
    return changes == read.pose.max() + 1
