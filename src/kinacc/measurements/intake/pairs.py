"""Two files as one: which of them holds the joints, and what says which rows belong together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements import joining
from kinacc.measurements.column_names import OTHER, Name, name_of
from kinacc.measurements.files import EXCEL
from kinacc.measurements.intake import clocks, columns, text
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import NamedColumns
from kinacc.measurements.intake.groups import Group
from kinacc.measurements.intake.text import Looked
from kinacc.measurements.joining import NAME, ORDER, TIME, Join
from kinacc.measurements.table import RawTable, numbers
from kinacc.measurements.times import seconds

_TIME_TEXT = """
time times timestamp timestamps stamp date datetime zeit zeitstempel uhrzeit datum heure temps hora
tiempo ora tempo t
"""
_TIMES = frozenset(_TIME_TEXT.split())
_OF_POSES = frozenset(("pose", "point", "pt", "config", "configuration", "name", "label", "target"))
_FEWEST_NAMES = 0.05  # of the rows: targets of a pose stand in rows of their own
_SHARE = 0.5  # of the points: fewer in common are no key


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
    names: tuple[Name, ...]
    found: NamedColumns

    @property
    def holds_joints(self) -> bool:
        return bool(self.found.joints)


def sheets_apart(path: Path, answers: Mapping[str, str]) -> tuple[str, ...]:
    """The sheets of joints and of points of a workbook that holds both once and apart; or none."""
    if path.suffix.lower() not in EXCEL or "sheet" in answers or not path.is_file():
        return ()
    joints, points = [], []
    for sheet, named in text.names_of_sheets(path).items():
        found = columns.recognise([name_of(each) for each in named])
        if found.joints and found.targets:
            return ()
        joints += [sheet] if found.joints else []
        points += [sheet] if found.targets else []
    return (*joints, *points) if len(joints) == len(points) == 1 else ()


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
    files = [_opened(path, take, turned, each) for path, each in zip(paths, said, strict=True)]
    joints, points = _sorted(files)
    how, told = _join(joints, points, answers)
    table = joining.joined(points.table, joints.table, how)
    own = {n.column: replace(n, column=joining.beside_name(n.column, points.table))
           for n in joints.names}  # fmt: skip
    single = dict(points.found.single)
    if how.by == NAME:
        single["pose"] = own[how.key or ""]
    used = {n.column for n in (*joints.found.joints, *joints.found.commanded)} | {how.key}
    spare = {n.column: own[n.column] for n in joints.names if n.column not in used}
    aside = [Group("", OTHER, "", {name: each}) for name, each in spare.items()]
    found = replace(
        points.found,
        joints=tuple(own[n.column] for n in joints.found.joints),
        commanded=tuple(own[n.column] for n in joints.found.commanded),
        single=single,
        aside=(*points.found.aside, *((g, "of the file of joints") for g in aside)),
        questions=(
            *(q for q in joints.found.questions if q.about == "the joints"),
            *(q for q in points.found.questions if q.about != "the joints"),
        ),
    )
    written = joints.looked.written.section()
    section: dict[str, Any] = {"path": joints.path, **_keys(how)}
    section |= {key: written[key] for key in _WRITTEN}
    every = (*joints.looked.told, *told, *table.notes)
    return Pair(points.path, points.looked, table, found, section, every)


_WRITTEN = (
    *("delimiter", "decimal", "thousands", "skip_lines", "skip_under_names"),
    *("encoding", "sheet", "names"),
)


def _keys(how: Join) -> dict[str, Any]:
    return {
        "by": how.by,
        "key": how.key,
        "key_of_points": how.key_of_points,
        "clock_offset_s": how.clock_offset_s,
        "within_s": how.within_s,
    }


def _opened(
    path: str | Path, take: Sequence[str], turned: bool, answers: Mapping[str, str]
) -> _File:
    looked = text.look(path, answers)
    table = looked.table
    units = table.under or ("",) * len(table.columns)
    names = tuple(name_of(c, u) for c, u in zip(table.columns, units, strict=False))
    own = [column for column in take if column in table.columns]

    def values(name: Name) -> np.ndarray:
        return numbers(table, name.column, [], gaps=True)

    return _File(
        str(path),
        looked,
        table,
        names,
        columns.recognise(names, values, own, turned, answers.get("sigma", "")),
    )


def _sorted(files: Sequence[_File]) -> tuple[_File, _File]:
    """The file of the joints and that of the points."""
    paths = " and ".join(each.table.path for each in files)
    holding = [each for each in files if each.holds_joints]
    if len(holding) == 2:  # a controller's log may hold points too, a tracker's file no joints
        holding = [each for each in files if not each.found.targets]
    if len(holding) != 1:
        what = (
            "both hold joints" if len(holding) != 1 and files[0].holds_joints else "hold no joints"
        )
        allowed = "joints in one file, measured points in the other"
        raise InputError(Problem(paths, what, allowed, "give one file, or take columns out of one"))
    joints = holding[0]
    points = next(each for each in files if each is not joints)
    if not points.found.targets:
        what = "no columns of a measured point were found"
        raise InputError(Problem(points.table.path, what, "x, y, z"))
    return joints, points


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
    raise _no_key(joints, points)


def _by_names(joints: _File, points: _File) -> tuple[Join, tuple[str, ...]] | None:
    """The columns whose names of poses are those of the other file. Asks where several differ."""
    ways: list[tuple[Join, np.ndarray]] = []
    for key in _named(joints):
        for other in _named(points):
            how = Join(NAME, key, other)
            try:
                row = joining.by_name(points.table, joints.table, how)
            except InputError:
                continue
            if np.sum(row >= 0) >= max(_SHARE * min(len(row), len(joints.table)), 2):
                ways.append((how, row))
    counted = [way for way in ways if _counts_rows(way[0], joints, points)]
    named = [way for way in ways if way not in counted]
    if not named and not counted:
        return None
    chosen = named or counted
    first, row = max(chosen, key=lambda way: int(np.sum(way[1] >= 0)))
    rivals = [how for how, other in chosen if not np.array_equal(other, row)]
    # A count of rows is no name: a point that was left out shifts all behind it.
    if rivals or not named:
        every = [first, *rivals]
        raise Undecided(
            points.table.path,
            [_choice(joints, points, {f"{e.key}={e.key_of_points}": _equal(e) for e in every})],
        )
    count = f"{np.sum(row >= 0)} of {len(row)} points have joints"
    told = f"joined where {first.key} of {joints.table.path} is {first.key_of_points} of "
    return first, (f"{told}{points.table.path}: {count}",)


def _equal(how: Join) -> str:
    return f"{how.key} of the joints is {how.key_of_points} of the points"


def _named(file: _File) -> list[str]:
    """Columns that may name poses: texts or whole numbers that hardly repeat, and no times."""
    used = {name.column for name in (*file.found.joints, *file.found.commanded)}
    used |= {n.column for target in file.found.targets.values() for n in target.values()}
    found = []
    for name in file.names:
        cells = file.table.columns[name.column]
        told = joining.labels(cells)
        whole = all(not each or each.isdigit() or not _is_number(each) for each in told)
        timed = bool(_TIMES & set(name.words)) or any(":" in each for each in told)
        if name.column in used or name.unit or timed or not whole:
            continue
        if len(set(told)) > max(_FEWEST_NAMES * len(told), 1):
            found.append(name.column)
    return found


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _counts_rows(how: Join, joints: _File, points: _File) -> bool:
    """Whether both keys only count rows: as many of both are poses where a word says so."""
    same = len(joints.table) == len(points.table)
    for file, key in ((joints, how.key), (points, how.key_of_points)):
        told = joining.labels(file.table.columns[key])
        words = set(name_of(key or "").words)
        counts = [each for each in told if each.isdecimal() and len(each) <= 100]
        steps = {int(b) - int(a) for a, b in pairwise(counts)}
        if len(counts) < len(told) or steps != {1} or (same and words & _OF_POSES):
            return False
    return True


def _times(file: _File) -> str:
    """The column that holds times, empty where there is none."""
    for name in file.names:
        if _TIMES & set(name.words) and name.unit not in ("deg", "rad", "mm", "m"):
            return name.column
    return ""


def _by_clock(
    joints: _File, points: _File, key: str, other: str, answers: Mapping[str, str]
) -> tuple[Join, tuple[str, ...]]:
    problems: list[Problem] = []
    there = seconds(joints.table, key, problems)
    here = seconds(points.table, other, problems)
    if problems:
        raise InputError(problems, "the times are no key")
    q = joining.joint_values(joints.table)
    good = np.isfinite(there)
    found = clocks.offset(here, there[good], q[good])
    given = answers.get("clock_offset")
    if given is not None:
        try:
            shift = float(given)
        except ValueError:
            raise InputError(Problem("--clock-offset", repr(given), "seconds")) from None
        within = found.within_s if found else clocks.nearness(there[good], q[good])
        return Join(TIME, key, other, shift, within), (f"clock offset {shift:g} s, as answered",)
    if found is None or found.rivals:
        rivals = (found.offset_s, *found.rivals) if found else ()
        listed = {f"{each:.3f}": f"points are {each:.3f} s earlier" for each in rivals[:4]}
        listed = listed or {"0": "both clocks showed the same"}
        about = (
            f"{other} of {points.table.path} and {key} of {joints.table.path} leave the offset "
            "between the two clocks open: the arm's standstills fit several offsets"
            if rivals
            else f"no offset between the clocks brings {other} of {points.table.path} to where the "
            f"arm stood still by {key} of {joints.table.path}"
        )
        raise Undecided(points.table.path, [Choice("--clock-offset", about, listed)])
    told = (
        f"joined by time: {found.offset_s:g} s are added to {other} of {points.table.path}, known "
        f"to {found.residual_s:.2g} s from {found.matched} of {len(here)} points at standstill"
    )
    return Join(TIME, key, other, found.offset_s, found.within_s), (told,)


def _no_key(joints: _File, points: _File) -> InputError:
    """What says that nothing names the poses in both files; asked where there are as many."""
    if len(joints.table) == len(points.table):
        return Undecided(points.table.path, [_choice(joints, points, {})])
    what = (
        f"nothing says which of its {len(points.table)} points belong to which of the "
        f"{len(joints.table)} joints of {joints.table.path}"
    )
    fix = "add a column with the names of poses, or with times, to both; --join A=B names them"
    return InputError(Problem(points.table.path, what, "a column with equal names", fix))


def _choice(joints: _File, points: _File, ways: dict[str, str]) -> Choice:
    same = len(joints.table) == len(points.table)
    ways = ways | ({ORDER: "the first row belongs to the first, and so on"} if same else {})
    about = (
        f"nothing says for certain which joints of {joints.table.path} ({len(joints.table)} rows) "
        f"belong to which points ({len(points.table)} rows)"
    )
    return Choice("--join", about, ways)
