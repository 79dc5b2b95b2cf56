"""Two files as one: which of them holds the joints, and what says which rows belong together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements import joining
from kinacc.measurements.column_names import OTHER, Name, name_of
from kinacc.measurements.files import EXCEL
from kinacc.measurements.intake import clocks, columns, text
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import NamedColumns
from kinacc.measurements.intake.groups import Group
from kinacc.measurements.intake.text import Looked
from kinacc.measurements.joining import NAME, ORDER, TIME, labels
from kinacc.measurements.layout import ANGLE, LENGTH, Join
from kinacc.measurements.table import RawTable
from kinacc.measurements.times import seconds
from kinacc.measurements.words import WORDS

_FEWEST_NAMES = 0.05  # of the rows: targets of a pose stand in rows of their own
_SHARE = 0.5  # of the points: fewer in common are no key
_WRITTEN = ("delimiter", "decimal", "thousands", "skip_lines", "skip_under_names", "encoding",
            "sheet", "names")  # fmt: skip


@dataclass(frozen=True)
class Pair:
    """Two files as one ``table``, what its columns are, and the section of its joints' file.

    ``points``: how the file of the points at ``path`` is written.
    """

    path: str
    points: Looked
    table: RawTable
    found: NamedColumns
    joints: dict[str, Any]
    told: tuple[str, ...]


@dataclass(frozen=True)
class _File:
    path: str
    looked: Looked
    table: RawTable
    names: list[Name]
    found: NamedColumns


def sheets_apart(path: Path, answers: Mapping[str, str]) -> tuple[str, ...]:
    """The sheets of joints and of points of a workbook that holds both once and apart; or none."""
    if path.suffix.lower() not in EXCEL or "sheet" in answers or not path.is_file():
        return ()
    found = {
        sheet: columns.recognise(list(map(name_of, named)))
        for sheet, named in text.names_of_sheets(path).items()
    }
    joints = [sheet for sheet, each in found.items() if each.joints]
    points = [sheet for sheet, each in found.items() if each.targets]
    return (*joints, *points) if len(joints) == len(points) == 1 and joints != points else ()


def look(
    paths: Sequence[str | Path],
    take: Sequence[str],
    turned: bool,
    answers: Mapping[str, str],
    sheets: Sequence[str] = (),
) -> Pair:
    """One view of two files, or of two ``sheets`` of one that is named twice.

    Raises InputError where they cannot be joined, Undecided if asked.
    """
    said = [{**answers, "sheet": sheet} for sheet in sheets] or [answers] * len(paths)
    files = []
    for path, own in zip(paths, said, strict=True):
        looked = text.look(path, own)
        named = [column for column in take if column in looked.table.columns]
        found = columns.of_table(looked.table, named, turned, own.get("sigma", ""))
        files.append(_File(str(path), looked, looked.table, columns.names_in(looked.table), found))
    joints, points = _sorted(files)
    how, told = _join(joints, points, answers)
    table = joining.joined(points.table, joints.table, how)
    own = {n.column: replace(n, column=joining.beside_name(n.column, points.table))
           for n in joints.names}  # fmt: skip
    both = {part: tuple(own[n.column] for n in getattr(joints.found, part))
            for part in ("joints", "commanded")}  # fmt: skip
    key = {"pose": own[how.key]} if how.by == NAME else {}
    used = {n.column for n in (*joints.found.joints, *joints.found.commanded)} | {how.key}
    spare = [Group("", OTHER, "", {n.column: own[n.column]}) for n in joints.names
             if n.column not in used]  # fmt: skip
    found = replace(
        points.found,
        **both,
        single=points.found.single | key,
        aside=(*points.found.aside, *((group, "of the file of joints") for group in spare)),
        questions=(
            *(q for q in joints.found.questions if q.about == "the joints"),
            *(q for q in points.found.questions if q.about != "the joints"),
        ),
    )
    written = joints.looked.written.written()
    section = {"path": joints.path, **vars(how), **{name: written[name] for name in _WRITTEN}}
    return Pair(points.path, points.looked, table, found, section, (*joints.looked.told, *told))


def _sorted(files: Sequence[_File]) -> tuple[_File, _File]:
    """The file of the joints and that of the points."""
    holding = [each for each in files if each.found.joints]
    if len(holding) == 2:  # a controller's log may hold points too, a tracker's file no joints
        holding = [each for each in files if not each.found.targets]
    if len(holding) != 1:
        what = "both hold joints" if files[0].found.joints else "hold no joints"
        paths = " and ".join(each.table.path for each in files)
        raise InputError(Problem(paths, what, "joints in one file, measured points in the other"))
    points = files[1 - files.index(holding[0])]
    if not points.found.targets:
        what = "no columns of a measured point were found"
        raise InputError(Problem(points.table.path, what, "x, y, z"))
    return holding[0], points


def _join(joints: _File, points: _File, answers: Mapping[str, str]) -> tuple[Join, tuple[str, ...]]:
    """How the rows belong together, as answered or as the files leave no doubt."""
    given = answers.get("join")
    if given == ORDER:
        return Join(ORDER), ("joints and points are joined by their order, as answered",)
    if given and given != TIME:
        key, _, other = given.partition("=")
        return Join(NAME, key, other or key), ()
    if given != TIME and (found := _by_names(joints, points)):
        return found
    times = _times(joints), _times(points)
    if all(times):
        return _by_clock(joints, points, times[0], times[1], answers)
    count, others = len(points.table), len(joints.table)
    if count == others:
        raise _undecided(joints, points, {})
    what = f"nothing says which of its {count} points belong to which of the {others} joints of "
    fix = "add a column with the names of poses, or with times, to both; --join A=B names them"
    raise InputError(Problem(points.table.path, f"{what}{joints.table.path}", fix=fix))


def _by_names(joints: _File, points: _File) -> tuple[Join, tuple[str, ...]] | None:
    """The columns whose names of poses are those of the other file. Asks where several differ."""
    named: list[tuple[Join, np.ndarray]] = []
    counted: list[tuple[Join, np.ndarray]] = []
    for key in _keys(joints):
        for other in _keys(points):
            how = Join(NAME, key, other)
            try:
                row = joining.by_name(points.table, joints.table, how)
            except InputError:
                continue
            if np.sum(row >= 0) >= max(_SHARE * min(len(row), len(joints.table)), 2):
                (counted if _counts_rows(how, joints, points) else named).append((how, row))
    if not named and not counted:
        return None
    chosen = named or counted
    first, row = max(chosen, key=lambda way: int(np.sum(way[1] >= 0)))
    rivals = [how for how, other in chosen if not np.array_equal(other, row)]
    # A count of rows is no name: a point that was left out shifts all behind it.
    if rivals or not named:
        raise _undecided(joints, points, {
            f"{how.key}={how.key_of_points}": f"{how.key} of the joints is {how.key_of_points}"
            for how in (first, *rivals)})  # fmt: skip
    told = f"joined where {first.key} of {joints.table.path} is {first.key_of_points} of "
    told += f"{points.table.path}: {np.sum(row >= 0)} of {len(row)} points have joints"
    return first, (told,)


def _keys(file: _File) -> list[str]:
    """Columns that may name poses: texts or whole numbers that hardly repeat, and no times."""
    used = {name.column for name in (*file.found.joints, *file.found.commanded)}
    used |= {n.column for target in file.found.targets.values() for n in target.values()}
    found = []
    for name in file.names:
        told = labels(file.table.columns[name.column])
        timed = bool(WORDS["time"] & {*name.words}) or any(":" in each for each in told)
        numbers = file.table.values(name.column)
        parts = np.isfinite(numbers) & ~np.array([each.isdigit() for each in told])
        if name.column in used or name.unit or timed or parts.any():
            continue
        if len({*told}) > max(_FEWEST_NAMES * len(told), 1):
            found.append(name.column)
    return found


def _counts_rows(how: Join, joints: _File, points: _File) -> bool:
    """Whether both keys only count rows: as many of both are poses where a word says so."""
    same = len(joints.table) == len(points.table)
    for file, key in ((joints, how.key), (points, how.key_of_points)):
        told = labels(file.table.columns[key])
        counts = [int(each) for each in told if each.isdecimal() and len(each) <= 100]
        steps = {b - a for a, b in pairwise(counts)}
        named = same and WORDS["pose_names"] & {*name_of(key).words}
        if len(counts) < len(told) or steps != {1} or named:
            return False
    return True


def _times(file: _File) -> str:
    """The column that holds times, empty where there is none."""
    timed = (
        n for n in file.names if WORDS["time"] & {*n.words} and n.unit not in {**ANGLE, **LENGTH}
    )
    return next((name.column for name in timed), "")


def _by_clock(
    joints: _File, points: _File, key: str, other: str, answers: Mapping[str, str]
) -> tuple[Join, tuple[str, ...]]:
    problems = []
    there, here = seconds(joints.table, key, problems), seconds(points.table, other, problems)
    refuse(problems, "the times are no key")
    good = np.isfinite(there)
    times, q = there[good], joining.joint_values(joints.table)[good]
    found, given = clocks.offset(here, times, q), answers.get("clock_offset")
    if given is not None:
        try:
            shift = float(given)
        except ValueError:
            raise InputError(Problem("--clock-offset", repr(given), "seconds")) from None
        within = found.within_s if found else clocks.standstills(times, q)[1]
        return Join(TIME, key, other, shift, within), (f"clock offset {shift:g} s, as answered",)
    if found is None or found.rivals:
        rivals = (found.offset_s, *found.rivals)[:4] if found else ()
        ways = {f"{each:.3f}": f"points are {each:.3f} s earlier" for each in rivals}
        fit = (
            "fit several offsets between the two clocks" if found else "fit no offset of the clocks"
        )
        about = f"{other} of {points.table.path} and the standstills by {key} of "
        about += f"{joints.table.path} {fit}"
        ways = ways or {"0": "both clocks showed the same"}
        raise Undecided(points.table.path, [Choice("--clock-offset", about, ways)])
    told = (
        f"joined by time: {found.offset_s:g} s are added to {other} of {points.table.path}, known "
        f"to {found.residual_s:.2g} s from {found.matched} of {len(here)} points at standstill"
    )
    return Join(TIME, key, other, found.offset_s, found.within_s), (told,)


def _undecided(joints: _File, points: _File, ways: dict[str, str]) -> Undecided:
    """The question which rows belong together; the order is an answer where there are as many."""
    count, others = len(points.table), len(joints.table)
    ways |= {ORDER: "the first row belongs to the first, and so on"} if count == others else {}
    about = f"nothing says for certain which joints of {joints.table.path} ({others} rows) belong "
    about += f"to which points ({count} rows)"
    return Undecided(points.table.path, [Choice("--join", about, ways)])
