"""One file, or two as one: the file of the joints, and how its rows belong to the points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.config.measured import JointsFile, Written
from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.column_names import OTHER, WORDS, name_of
from kinacc.measurements.files import EXCEL
from kinacc.measurements.intake import clocks, columns, text
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.groups import Group
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
from kinacc.measurements.times import seconds

_FEWEST_NAMES = 0.05  # of the rows: targets of a pose stand in rows of their own
_SHARE = 0.5  # of the points: fewer in common are no key


def look(
    path: str | Path | Sequence[str | Path], answers: Mapping[str, Any], wanted: bool = False
) -> Looked:
    """One view of a file, of two files, or of two sheets of a workbook, with their columns.

    ``wanted``: nominal poses are read. Raises InputError where the files cannot be joined,
    Undecided where a choice is open.
    """
    paths = [path] if isinstance(path, (str, Path)) else [*path]
    files = []
    for name, sheet in [(p, None) for p in paths] if len(paths) > 1 else _sheets(paths[0], answers):
        given = answers if sheet is None else {**answers, "sheet": sheet}
        looked = text.look(name, given)
        take = [column for column in answers.get("take", ()) if column in looked.table.columns]
        turned, sigma = answers.get("orientation") != "none", answers.get("sigma", "")
        meaning = columns.of_table(looked.table, take, turned, sigma, wanted)
        files.append(replace(looked, columns=meaning))
    return files[0] if len(files) == 1 else _together(files, answers)


def _sheets(path: str | Path, answers: Mapping) -> list[tuple[str | Path, str | None]]:
    """The file, twice with a sheet where a workbook holds joints and points on two sheets."""
    if Path(path).suffix.lower() in EXCEL and "sheet" not in answers and Path(path).is_file():
        sheets = {
            sheet: columns.recognise([*map(name_of, names)])
            for sheet, names in text.names_of_sheets(Path(path)).items()
        }
        joints = [sheet for sheet, meaning in sheets.items() if meaning.joints]
        points = [sheet for sheet, meaning in sheets.items() if meaning.targets]
        if len(joints) == len(points) == 1 and joints != points:
            return [(path, joints[0]), (path, points[0])]
    return [(path, None)]


def _together(files: Sequence[Looked], answers: Mapping[str, Any]) -> Looked:
    holding = [file for file in files if file.columns.joints]
    if len(holding) == 2:  # a controller's log may hold points too, a tracker's file no joints
        holding = [file for file in files if not file.columns.targets]
    if len(holding) != 1:
        message = "both hold joints" if files[0].columns.joints else "hold no joints"
        paths = " and ".join(file.table.path for file in files)
        allowed = "joints in one file, measured points in the other"
        raise InputError(Problem(paths, message, allowed))
    joints, points = holding[0], next(file for file in files if file is not holding[0])
    if not points.columns.targets:
        message = "no columns of a measured point were found"
        raise InputError(Problem(points.table.path, message, "x, y, z"))
    how, note = _join(joints, points, answers)
    names = {n.column: replace(n, column=beside_name(n.column, points.table))
             for n in columns.names_in(joints.table)}  # fmt: skip
    read = {part: tuple(names[n.column] for n in getattr(joints.columns, part))
            for part in ("joints", "commanded")}  # fmt: skip
    used = {n.column for n in (*joints.columns.joints, *joints.columns.commanded)} | {how.key}
    spare = [Group("", OTHER, "", {c: name}) for c, name in names.items() if c not in used]
    about = columns.ABOUT_JOINTS
    meaning = replace(
        points.columns,
        **read,
        single=points.columns.single | ({"pose": names[how.key]} if how.by == NAME else {}),
        aside=(*points.columns.aside, *spare),
        questions=(
            *(q for q in joints.columns.questions if q.about.startswith(about)),
            *(q for q in points.columns.questions if not q.about.startswith(about)),
        ),
    )
    written = joints.written.model_dump(include={*Written.model_fields})
    section = {**how.model_dump(), **written, "path": joints.path}
    notes = (*points.notes, *joints.notes, *note)
    table = joined(points.table, joints.table, how)
    return replace(points, table=table, columns=meaning, joints=section, notes=notes)


def _join(joints: Looked, points: Looked, answers: Mapping) -> tuple[JointsFile, tuple[str, ...]]:
    """How the rows belong together, as answered or as the files leave no doubt."""
    given = answers.get("join")
    if given == ORDER:
        return JointsFile(by="order"), ()
    if given and given != TIME:
        key, _, other = given.partition("=")
        return _by_name(key, other or key), ()
    if given != TIME and (how := _by_names(joints, points)):
        count = int(np.sum(rows_by_name(points.table, joints.table, how) >= 0))
        note = f"joined where {how.key} of {joints.table.path} is {how.key_of_points} of "
        note += f"{points.table.path}: {count} of {len(points.table)} points have joints"
        return how, (note,)
    times = _times(joints), _times(points)
    if all(times):
        return _by_clock(joints, points, *times, answers)
    if len(points.table) == len(joints.table):
        raise _undecided(joints, points, {})
    message = f"the joints of its {len(points.table)} points among the {len(joints.table)} of "
    message += f"{joints.table.path} are unknown"
    fix = "add a column with the names of poses, or with times, to both; --join A=B names them"
    raise InputError(Problem(points.table.path, message, fix=fix))


def _by_names(joints: Looked, points: Looked) -> JointsFile | None:
    """The columns whose names of poses are those of the other file. Asks where several differ."""
    certain: list[tuple[int, JointsFile, bytes]] = []
    counting: list[tuple[int, JointsFile, bytes]] = []
    for key in _keys(joints):
        for other in _keys(points):
            how = _by_name(key, other)
            try:
                row = rows_by_name(points.table, joints.table, how)
            except InputError:
                continue
            count = int(np.sum(row >= 0))
            if count >= max(_SHARE * min(len(row), len(joints.table)), 2):
                ways = counting if _counts_rows(how, joints, points) else certain
                ways.append((count, how, row.tobytes()))
    ways = sorted(certain or counting, key=lambda way: -way[0])
    # A count of rows is no name: a point that was left out shifts all behind it.
    if ways and (not certain or len({rows for *_, rows in ways}) > 1):
        meant = {f"{how.key}={how.key_of_points}": f"{how.key} of the joints is {how.key_of_points}"
                 for _, how, _ in ways}  # fmt: skip
        raise _undecided(joints, points, meant)
    return ways[0][1] if ways else None


def _keys(file: Looked) -> list[str]:
    """Columns that may name poses: texts or whole numbers that hardly repeat, and no times."""
    meaning = file.columns
    used = {name.column for name in (*meaning.joints, *meaning.commanded)}
    used |= {n.column for target in meaning.targets.values() for n in target.values()}
    keys = []
    for name in columns.names_in(file.table):
        names = labels(file.table.columns[name.column])
        timed = bool(WORDS["time"] & {*name.terms}) or any(":" in label for label in names)
        numbers = np.isfinite(file.table.values(name.column))
        whole = np.array([label.isdigit() for label in names])
        if name.column in used or name.unit or timed or (numbers & ~whole).any():
            continue
        if len({*names}) > max(_FEWEST_NAMES * len(names), 1):
            keys.append(name.column)
    return keys


def _counts_rows(how: JointsFile, joints: Looked, points: Looked) -> bool:
    """Whether both keys only count rows: as many of both are poses where a term states it."""
    as_many = len(joints.table) == len(points.table)
    for file, key in ((joints, how.key), (points, how.key_of_points)):
        names = labels(file.table.columns[key])
        counts = [int(name) for name in names if name.isdecimal() and len(name) <= 100]
        is_named = as_many and WORDS["pose_names"] & {*name_of(str(key)).terms}
        if len(counts) < len(names) or {b - a for a, b in pairwise(counts)} != {1} or is_named:
            return False
    return True


def _times(file: Looked) -> str:
    """The column that holds times, empty where there is none."""
    names = (n for n in columns.names_in(file.table) if n.unit not in {**ANGLE, **LENGTH})
    return next((n.column for n in names if WORDS["time"] & {*n.terms}), "")


def _by_clock(
    joints: Looked, points: Looked, key: str, other: str, answers: Mapping
) -> tuple[JointsFile, tuple[str, ...]]:
    problems: list[Problem] = []
    there, here = seconds(joints.table, key, problems), seconds(points.table, other, problems)
    refuse(problems, "the times are no key")
    good = np.isfinite(there)
    stands, within = clocks.standstills(there[good], joint_values(joints.table)[good])
    if (given := answers.get("clock_offset")) is not None:
        try:
            return _by_time(key, other, float(given), within), ()
        except ValueError:
            raise InputError(Problem("--clock-offset", repr(given), "seconds")) from None
    ways = clocks.offsets(here, stands, within)
    if len(ways) != 1:
        about = f"{'several' if ways else 'no'} offsets of the clocks put {other} of "
        about += f"{points.table.path} at the standstills by {key} of {joints.table.path}"
        meant = {f"{way:.3f}": f"{way:.3f} s are added to times of points" for way in ways[:4]}
        meant = meant or {"0": "both clocks showed the same"}
        raise Undecided(points.table.path, [Choice("--clock-offset", about, meant)])
    note = f"joined by time: {ways[0]:g} s are added to {other} of {points.table.path}"
    return _by_time(key, other, ways[0], within), (note,)


def _undecided(joints: Looked, points: Looked, ways: dict[str, str]) -> Undecided:
    """The question which rows belong together; the order is an answer where there are as many."""
    count, others = len(points.table), len(joints.table)
    ways |= {ORDER: "the first row belongs to the first, and so on"} if count == others else {}
    about = f"nothing decides which joints of {joints.table.path} ({others} rows) belong to which "
    about += f"points ({count} rows)"
    return Undecided(points.table.path, [Choice("--join", about, ways)])


def _by_name(key: str, key_of_points: str) -> JointsFile:
    return JointsFile.model_construct(by="name", key=key, key_of_points=key_of_points)


def _by_time(key: str, key_of_points: str, offset_s: float, within_s: float) -> JointsFile:
    times = {"clock_offset_s": offset_s, "within_s": within_s}
    return JointsFile.model_construct(by="time", key=key, key_of_points=key_of_points, **times)
