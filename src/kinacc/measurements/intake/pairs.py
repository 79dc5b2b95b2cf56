"""One file, or two as one: the file of the joints, and how its rows belong to the points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from kinacc.config.measured import JointsFile, Written
from kinacc.errors import first_few, gathered, input_error
from kinacc.measurements.column_names import WORDS, Name, name_of
from kinacc.measurements.files import EXCEL, refuse_other_files
from kinacc.measurements.intake import columns, text
from kinacc.measurements.intake.choices import Answers, Choice, Undecided
from kinacc.measurements.intake.text import Looked
from kinacc.measurements.joining import (
    NAME,
    ORDER,
    TIME,
    beside_name,
    joined,
    joint_values,
    labels,
    rows_by_name,
)
from kinacc.measurements.layout import ANGLE, LENGTH
from kinacc.measurements.table import numbers_of
from kinacc.measurements.times import offsets, seconds, standstills

_SHARE = 0.5  # of the points: fewer in common are no key


def look(
    path: str | Path | Sequence[str | Path], answers: Answers, need: str = columns.MEASUREMENTS
) -> Looked:
    """One view of a file, of two files, or of two sheets of a workbook, with their columns.

    ``need``: what of one table is read. Raises InputError where the files cannot be joined,
    Undecided where a choice is open.
    """
    paths = [path] if isinstance(path, (str, Path)) else [*path]
    for name in paths:
        refuse_other_files(Path(name))
    sheets, notes = _sheets(Path(paths[0]), answers) if len(paths) == 1 else ([], ())
    sources = [(paths[0], {**answers, "sheet": sheet}) for sheet in sheets]
    sources = sources or [(name, {**answers}) for name in paths]
    need = need if len(sources) == 1 else columns.MEASUREMENTS
    files = []
    for name, stated in sources:
        looked = text.look(name, stated)
        meaning = columns.of_table(looked.table, answers, need)
        files.append(replace(looked, columns=meaning, notes=(*notes, *looked.notes)))
    return files[0] if len(files) == 1 else _together(files, answers)


def _sheets(path: Path, answers: Answers) -> tuple[list[str], tuple[str, ...]]:
    """The sheets of a workbook to read, one of joints and one of points or one of both.

    Also a note on the others. No sheet where there is no other.
    """
    tables = text.sheets_of(path) if path.suffix.lower() in EXCEL and "sheet" not in answers else {}
    if len(tables) < 2:
        return [], ()
    held = {sheet: columns.of_table(table) for sheet, table in tables.items()}
    joints = [sheet for sheet in tables if held[sheet].joints]
    points = [sheet for sheet in tables if held[sheet].targets]
    likely = [sheet for sheet in points if sheet in joints] or points or joints
    likely = likely or [sheet for sheet, table in tables.items() if len(table.columns.columns)]
    if len(joints) == len(points) == 1:
        likely = [*dict.fromkeys((*joints, *points))]
    elif len(likely) > 1:
        meant = {sheet: first_few([*tables[sheet].columns], 12) for sheet in likely}
        raise Undecided(str(path), Choice("--sheet", "several sheets hold tables", meant))
    others = [sheet for sheet in tables if sheet not in likely]
    return likely, (f"sheets not read: {first_few(others)}",) if others else ()


def _together(files: Sequence[Looked], answers: Answers) -> Looked:
    holding = [file for file in files if file.columns.joints]
    others = [file for file in files if file not in holding]
    if len(holding) != 1 or not others[0].columns.targets:
        paths = " and ".join(file.table.path for file in files)
        message = "joints are not in one of them, and measured points in the other"
        fix = "name the columns q1_deg .. and x_mm, y_mm, z_mm"
        raise input_error(paths, message, fix=fix)
    joints, points = holding[0], others[0]
    how = _join(joints, points, answers)

    def beside(name: Name) -> Name:
        return replace(name, column=beside_name(name.column, points.table))

    pose = {"pose": beside(name_of(how.key))} if how.by == NAME and how.key else {}
    meaning = replace(
        points.columns,
        joints=tuple(map(beside, joints.columns.joints)),
        commanded=tuple(map(beside, joints.columns.commanded)),
        single=points.columns.single | pose,
        on_joints=joints.columns.on_joints,
    )
    written = joints.written.model_dump(include={*Written.model_fields})
    section = {**how.model_dump(), **written, "path": joints.path}
    note = {
        NAME: f"joined where {how.key} of the joints is {how.key_of_points} of the points",
        TIME: f"joined by time: {how.clock_offset_s:g} s are added to times of points",
        ORDER: "joined by order",
    }[how.by]
    table = joined(points.table, joints.table, how)
    notes = (*points.notes, *joints.notes, note)
    return replace(points, table=table, columns=meaning, joints=section, notes=notes)


def _join(joints: Looked, points: Looked, answers: Answers) -> JointsFile:
    """How the rows belong together, as answered or as the files leave no doubt."""
    answer = answers.get("join", "")
    if answer == ORDER:
        return JointsFile(by="order")
    keys = None if answer else _by_names(joints, points)
    key, _, key_of_points = answer.partition("=")
    if keys or answer not in ("", TIME):
        key, key_of_points = keys or (key, key_of_points or key)
        return JointsFile.model_construct(by="name", key=key, key_of_points=key_of_points)
    times = _times(joints), _times(points)
    if all(times):
        return _by_clock(joints, points, *times, answers)
    raise _undecided(joints, points, [])


def _by_names(joints: Looked, points: Looked) -> tuple[str, str] | None:
    """The columns whose names of poses are those of the other file. Asks where several differ."""
    certain: dict[tuple[str, str], bytes] = {}
    counted: list[tuple[str, str]] = []
    as_many = len(joints.table) == len(points.table)
    for keys in product(_keys(joints), _keys(points)):
        is_named = any(WORDS["pose_names"] & {*name_of(key).terms} for key in keys)
        with gathered([]):
            row = rows_by_name(points.table, joints.table, *keys)
            count = int(np.sum(row >= 0))
            if count >= max(_SHARE * min(len(row), len(joints.table)), 2):
                # A count of rows is no name: a point that was left out shifts all behind it.
                counts_rows = all(map(_counts_rows, (joints, points), keys))
                if counts_rows and not (as_many and is_named):
                    counted.append(keys)
                else:
                    certain[keys] = row.tobytes()
    if len({*certain.values()}) > 1 or (counted and not certain):
        raise _undecided(joints, points, [*certain] or counted)
    return next(iter(certain), None)


def _keys(file: Looked) -> list[str]:
    """Columns that may name poses: texts or whole numbers, and no times."""
    used = replace(file.columns, single={}).read()
    keys = []
    for name in columns.names_in(file.table):
        names = labels(file.table.columns[name.column])
        timed = bool(WORDS["time"] & {*name.terms}) or any(":" in label for label in names)
        numbers = np.isfinite(file.table.values(name.column))
        whole = np.array([label.isdigit() for label in names])
        is_name = not name.unit and not timed and not (numbers & ~whole).any()
        if is_name and name.column not in used and len({*names}) > 1:
            keys.append(name.column)
    return keys


def _counts_rows(file: Looked, key: str) -> bool:
    """Whether a key only counts rows."""
    names = labels(file.table.columns[key])
    counts = [int(name) for name in names if name.isdecimal() and len(name) <= 100]
    return len(counts) == len(names) and {*np.diff(counts)} == {1}


def _times(file: Looked) -> str:
    """The column that holds times, empty where there is none."""
    names = (n for n in columns.names_in(file.table) if n.unit not in {**ANGLE, **LENGTH})
    return next((n.column for n in names if WORDS["time"] & {*n.terms}), "")


def _by_clock(
    joints: Looked, points: Looked, key: str, key_of_points: str, answers: Answers
) -> JointsFile:
    there, here = seconds(joints.table, key), seconds(points.table, key_of_points)
    good = np.isfinite(there)
    stands, within = standstills(there[good], joint_values(joints.table)[good])
    if (answer := answers.get("clock_offset")) is not None:
        ways = numbers_of(answer).tolist()
        if len(ways) != 1:
            raise input_error("--clock-offset", repr(answer), "seconds")
    elif len(ways := offsets(here, stands, within)) != 1:
        about = f"{'several' if ways else 'no'} offsets of the clocks put the points, by "
        about += f"{key_of_points}, at the standstills of the arm, by {key}"
        meant = {f"{way:.3f}": f"{way:.3f} s are added to times of points" for way in ways[:4]}
        meant = meant or {"0": "both clocks showed the same"}
        raise Undecided(points.table.path, Choice("--clock-offset", about, meant))
    return JointsFile.model_construct(
        by="time", key=key, key_of_points=key_of_points, clock_offset_s=ways[0], within_s=within
    )


def _undecided(joints: Looked, points: Looked, ways: Sequence[tuple[str, str]]) -> Undecided:
    """The question which rows belong together; the order is an answer where there are as many."""
    count, others = len(points.table), len(joints.table)
    answers = {f"{key}={other}": f"{key} of the joints is {other}" for key, other in ways}
    answers |= {ORDER: "the first row belongs to the first, and so on"} if count == others else {}
    answers = answers or {"A=B": "columns A of the joints and B of the points name the poses"}
    about = f"nothing decides which of {others} rows of joints belong to {count} points"
    return Undecided(points.table.path, Choice("--join", about, answers))
