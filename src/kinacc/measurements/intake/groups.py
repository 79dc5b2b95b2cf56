"""Columns of a foreign file that belong together: joints, points, orientations, uncertainties.

They differ in one term only: a number for joints, x, y and z for points. The other terms decide
what a group is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from kinacc.measurements.column_names import (
    CALCULATED,
    COMMANDS,
    MEASURED,
    NOMINAL,
    OPEN,
    PLAIN,
    REPORTED,
    SPREAD,
    WORDS,
    Name,
    decides,
    is_controller_pose,
    role,
)
from kinacc.measurements.layout import ANGLE, LENGTH, TOOL
from kinacc.measurements.table import RawTable

JOINTS, POINT, TURN, POSE = "joints", "a position", "an orientation", "a pose"
UNCERTAINTY = "an uncertainty"
PULSES = ("pulse", "pulses", "count", "counts", "tick", "ticks")

_READ = (PLAIN, OPEN, REPORTED, MEASURED)
_UNITS = {JOINTS: {**ANGLE, **LENGTH}, POINT: LENGTH, TURN: ANGLE}
_UNIT_LENGTH = 2e-3  # how far from 1 the length of a quaternion may be, as written
_TURNED = WORDS["turn"] | WORDS["quaternion"] | WORDS["vector"]


@dataclass(frozen=True)
class Group:
    """Columns that belong together.

    ``kind`` is one of those above; ``role`` one of those of names; ``columns`` by our names (q1, x,
    rx, qw, quat1, std_x); ``turn`` kind and convention of orientations; ``weak`` where no name
    states that they are joints, or that an uncertainty is one standard deviation.
    """

    kind: str
    role: str
    target: str
    columns: dict[str, Name]
    turn: tuple[str, str] = ("none", "XYZ")
    weak: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names in the file."""
        return tuple(name.column for name in self.columns.values())

    @property
    def units(self) -> set[str]:
        """The units that its columns state; "" where one of them states none."""
        return {name.unit for name in self.columns.values()}

    @property
    def terms(self) -> tuple[str, ...]:
        """The terms of its first column."""
        return next(iter(self.columns.values())).terms

    @property
    def text(self) -> str:
        """The columns, the inner ones of many left out."""
        return listed(self.names)

    @property
    def wrong_units(self) -> set[str]:
        """Units that a group of its kind cannot have; pulses are units of joints."""
        units = self.units - {""}
        if self.kind == JOINTS and units and not units & {*ANGLE}:  # not all joints slide
            return {unit for unit in units if unit.lower() not in PULSES}
        return units - {*_UNITS.get(self.kind, units)}

    @property
    def why_unread(self) -> str:
        """Why it is not read."""
        if self.kind == POSE or (self.kind == POINT and is_controller_pose(self.terms)):
            return "the controller's own forward kinematics, never a measurement"
        if self.role not in _READ:
            return self.role
        wrong = " and ".join(sorted(self.wrong_units))
        return f"{self.kind} in {wrong}" if wrong else "other columns are read"


def listed(names: Sequence[str]) -> str:
    """Names of columns, the inner ones of many left out."""
    return f"{names[0]} .. {names[-1]}" if len(names) > 4 else ", ".join(names)


def all_groups(table: RawTable, names: Sequence[Name]) -> list[Group]:
    """Every group of the columns of a table, by their names."""
    groups = [*_numbered(table, names), *_named_joints(names), *_by_axis(names)]
    points = {tuple(t for t in g.terms if t != "x") for g in groups if g.kind == POINT}
    for *letters, convention in WORDS["angles"]:
        for terms, _, columns in _alike(names, "|".join(letters)):
            # Single letters are angles beside x, y, z alone.
            if len(columns) == 3 and (len(letters[0]) > 1 or terms in points):
                turned = {f"r{axis}": columns[letter]
                          for axis, letter in zip("xyz", letters, strict=True)}  # fmt: skip
                target, turn = _target(columns[letters[0]], terms), ("euler", convention)
                groups.append(Group(TURN, role(terms), target, turned, turn))
    return groups


def _alike(
    names: Sequence[Name], label: str, stem: str = ""
) -> Iterator[tuple[tuple[str, ...], str, dict[str, Name]]]:
    """Terms, stem and columns by label of names that differ in the label alone.

    ``label`` and the ``stem`` in front of it are regular expressions of terms, joined by _. Where a
    label is there twice (X and x_mm), columns of one unit and spelling belong together.
    """
    pattern = re.compile(rf"(?<![^_])({stem})({label})(?![^_])")
    groups: dict[tuple[str, int, str], list[tuple[str, Name]]] = {}
    for name in names:
        joined = "_".join(name.terms)
        for match in pattern.finditer(joined):
            key = (f"{joined[: match.start()]}_{joined[match.end() :]}", match.start(), match[1])
            groups.setdefault(key, []).append((match[2], name))
    for (around, _, stem_), columns in groups.items():
        terms = tuple(filter(None, around.split("_")))
        twice = len({text for text, _ in columns}) < len(columns)
        rows: dict[tuple[object, ...], dict[str, Name]] = {}
        for text, name in columns:
            spelled = [s for t, s in zip(name.terms, name.spelled, strict=True) if t in terms]
            small = any(s.islower() for s in name.spelled)
            rows.setdefault((name.unit, *spelled, small) if twice else (), {})[text] = name
        for row in rows.values():
            yield terms, stem_, row


def _numbered(table: RawTable, names: Sequence[Name]) -> Iterator[Group]:
    """Columns that differ in a number counting from 0 or 1: joints, quaternions, poses."""
    for terms, _, columns in _alike(names, r"\d{1,2}"):
        by_number = {int(number): name for number, name in columns.items()}
        first, about = min(by_number), {*terms}
        if first > 1 or {*by_number} != {*range(first, first + len(by_number))}:
            continue
        row = [by_number[number] for number in sorted(by_number)]
        is_joint = bool(about & WORDS["joint"]) and not about & WORDS["external"]
        if len(row) == 4 and _is_quaternion(table, row, about):
            turned = {f"quat{number}": name for number, name in enumerate(row, 1)}
            known, target = role(about - WORDS["quaternion"]), _target(row[0], None, True)
            yield Group(TURN, known, target, turned, ("quaternion", "XYZ"))
        elif (
            len(row) == 6
            and about & WORDS["pose_of_controller"]
            and not about & {"joint", "joints"}
        ):
            yield Group(POSE, role(terms), "", dict(zip("123456", row, strict=True)))
        elif len(row) == 3 and about & (WORDS["turn"] - WORDS["joint"]):
            turned = dict(zip(("rx", "ry", "rz"), row, strict=True))
            target = _target(row[0], None, True)
            yield Group(TURN, role(terms), target, turned, ("euler", "XYZ"))
        elif 6 - 2 * is_joint <= len(row) <= 7:
            yield _joints(row, terms, weak=not is_joint)


def _is_quaternion(table: RawTable, row: Sequence[Name], about: set[str]) -> bool:
    """Whether four numbered columns are a quaternion, by their terms and their length."""
    length = np.linalg.norm(table.stacked([name.column for name in row]), axis=1)
    length = length[np.isfinite(length)]
    is_named = about & (WORDS["quaternion_or_joint"] | WORDS["quaternion"])
    is_unit = np.abs(length - 1.0) < _UNIT_LENGTH
    return bool(is_named) and bool(is_unit.sum() > 0.9 * length.size)


def _joints(row: Sequence[Name], terms: Sequence[str], weak: bool = False) -> Group:
    rest = [t for t in terms if t not in WORDS["joint"] | WORDS["filling"] and not t.isdigit()]
    rest = [t for t in rest if role([t]) != CALCULATED]
    known = REPORTED if role(rest) == MEASURED else role(rest)
    known = NOMINAL if known == OPEN and COMMANDS & {*rest} else known
    columns = {f"q{number}": name for number, name in enumerate(row, 1)}
    return Group(JOINTS, known, "", columns, weak=weak)


def _named_joints(names: Sequence[Name]) -> Iterator[Group]:
    """Joints by the names that those of some arms have."""
    for series in WORDS["named_joints"]:
        for terms, _, columns in _alike(names, "|".join(series)):
            known = all(t in WORDS["joint"] or role([t]) != PLAIN for t in terms)
            if {*columns} == {*series} and (known or len(series[0]) > 1):
                yield _joints([columns[joint] for joint in series], terms)


def _by_axis(names: Sequence[Name]) -> Iterator[Group]:
    """Points, orientations and their uncertainties: columns that differ in x, y, z (and w)."""
    for terms, stem, axes in _alike(names, "[xyzw]", "rv|r|q|"):
        if not {*"xyz"} <= {*axes}:
            continue
        about, first = {*terms}, axes["x"]
        units = {axes[axis].unit for axis in "xyz"} - {""}
        is_turn = stem in ("r", "rv") or bool(about & WORDS["turn"])
        vector = stem == "rv" or (bool(about & WORDS["vector"]) and is_turn)
        known = role([t for t in terms if not (vector and t == "vector")])
        behind = first.terms[first.terms.index(f"{stem}x") + 1 :]
        if known == PLAIN and any(len(term) == 1 and term.isalpha() for term in behind):
            known = OPEN  # x_n, x_c: the meaning of the letter is open
        if stem == "q" or about & WORDS["quaternion"] or (is_turn and "w" in axes and not stem):
            if "w" in axes:
                columns = {f"q{axis}": axes[axis] for axis in "wxyz"}
                target = _target(first, None, True)
                yield Group(TURN, known, target, columns, ("quaternion", "XYZ"))
            continue
        is_turn = is_turn or (bool(units) and units <= {*ANGLE})
        kind = TURN if is_turn else UNCERTAINTY if known == SPREAD else POINT
        before = {TURN: "r", UNCERTAINTY: "std_", POINT: ""}[kind]
        columns = {f"{before}{axis}": axes[axis] for axis in "xyz"}
        turn = "rotation_vector" if vector else "euler" if kind == TURN else "none"
        # One standard deviation is no interval, and no multiple of it.
        sigma = about & WORDS["one_sigma"] or {"standard", "deviation"} <= about
        weak = not sigma or any(term.isdigit() for term in terms)
        yield Group(kind, known, _target(first, None, is_turn), columns, (turn, "XYZ"), weak)


def _target(name: Name, terms: Sequence[str] | None = None, is_turn: bool = False) -> str:
    """Name of a target by ``terms`` of a column; None for those that all its columns have."""
    if terms is None:
        gone = {*_TURNED, name.terms[-1] if name.terms[-1].isdigit() else ""} if is_turn else {""}
        terms = [t for t in name.terms if (t[-1] not in "xyzw" or len(t) > 2) and t not in gone]
    spelling = dict(zip(name.terms, name.spelled, strict=True))
    target = ""
    for spelled in (spelling[t] for t in terms if not decides(t) and t not in WORDS["filling"]):
        # As in the file: smr1, and not smr_1.
        target += spelled if not target or f"{target}{spelled}" in name.column else f"_{spelled}"
    return target or TOOL


def same(a: Group, b: Group, table: RawTable) -> bool:
    """Whether two groups hold the same numbers, their units aside."""
    if {*a.columns} != {*b.columns}:
        return False
    here = table.stacked(a.names)
    there = table.stacked([b.columns[key].column for key in a.columns])
    off = 2e-6 * max(np.nanmax(np.abs(there), initial=0.0), 1e-9)
    factors = (1.0, np.pi / 180.0, 180.0 / np.pi, 1e-3, 1e3)
    return any(np.allclose(here * factor, there, 0.0, off, equal_nan=True) for factor in factors)


def keep_distances(points: Sequence[np.ndarray]) -> bool:
    """Whether points (n, 3), NaN where unread, keep their distances and turn about each other.

    A nominal point beside its measured one is a millimetre off, or in a frame of its own. Fewer
    than three readings of two are too few.
    """
    for a, b in combinations(points, 2):
        apart = (a - b)[np.isfinite(a - b).all(axis=1)]
        if len(apart) < 3:
            return False
        length = np.linalg.norm(apart, axis=1)
        usual = np.median(length)
        off = np.median(np.abs(length - usual))
        turned = np.median(np.linalg.norm(apart - np.median(apart, axis=0), axis=1))
        if off > 0.01 * usual or turned < max(5.0 * off, 1e-3 * usual):
            return False
    return True
