"""A file nobody has described as a ``measurements.file`` section, with all that was assumed."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.column_names import NOMINAL, Name
from kinacc.measurements.faults import BEYOND, is_no_coordinate, none_read
from kinacc.measurements.intake import pairs, targets_in_rows
from kinacc.measurements.intake.choices import TAKE, Choice, Undecided
from kinacc.measurements.intake.columns import ABOUT_JOINTS, NamedColumns
from kinacc.measurements.intake.groups import JOINTS, POINT, POSE, PULSES, listed
from kinacc.measurements.layout import ANGLE, LENGTH, TOOL, Layout, find
from kinacc.measurements.orientation import CONVENTIONS
from kinacc.measurements.table import RawTable

MEASUREMENTS, POINTS, POSES = "measurements", "points", "poses"
FULL_TURN_RAD = 2.0 * np.pi * 1.05
_LARGEST_M = 50.0  # no instrument stands further away
_MOST_DEG = 7200.0  # no joint turns further
_FAR = 1.5  # times the extent of the other points
# By setting: the units that are known, the usual and the small one, and the largest number that is
# taken for the small one.
_UNITS: dict[str, tuple[Mapping, str, str, float]] = {
    "joint_unit": (ANGLE, "deg", "rad", FULL_TURN_RAD),
    "length_unit": (LENGTH, "mm", "m", _LARGEST_M),
    "angle_unit": (ANGLE, "deg", "rad", FULL_TURN_RAD),
}
# Options that answer what was assumed, and the answers there are.
OPTIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    "joint_unit": ("--joint-unit", ("deg", "rad")),
    "length_unit": ("--length-unit", ("mm", "m")),
    "angle_unit": ("--angle-unit", ("deg", "rad")),
    "orientation": ("--orientation", ("none", "quaternion", "rotation_vector", *CONVENTIONS)),
    "order": ("--orientation", ("quaternion", "quaternion_xyzw")),
    "horizontal": ("--horizontal", ("clockwise", "counterclockwise")),
}


@dataclass(frozen=True)
class Guess:
    """A ``measurements.file`` section, and what of it the file does not state.

    ``assumed``: settings taken by default or by the size of numbers, with a text on each (see
    ``OPTIONS``). ``columns``: their meaning. ``notes``: facts on how the file was read.
    """

    section: dict[str, Any]
    table: RawTable
    columns: NamedColumns
    assumed: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.columns.joints)

    def but(self, settings: Mapping[str, Any]) -> Guess:
        """The guess with other settings; ``orientation`` is taken key by key."""
        turn = self.section["orientation"] | settings.get("orientation", {})
        return replace(self, section=self.section | {**settings, "orientation": turn})

    def unused(self) -> dict[str, str]:
        """Columns that the reader does not use by the section, and why ("" where unknown).

        Raises InputError where the reader cannot follow the section.
        """
        problems: list[Problem] = []
        slides = np.array([name.unit in LENGTH for name in self.columns.joints])
        read = find(self.table, Layout.of(self.section), slides, problems)
        refuse(problems, f"{self.table.path} cannot be described")
        why = {name: g.why_unread for g in self.columns.aside for name in g.names}
        return {name: why.get(name, "") for name in read.unused(self.table)}


def orientation_of(word: str) -> dict[str, str]:
    """The settings that ``--orientation`` stands for; InputError for no such word."""
    if word in ("none", "quaternion", "rotation_vector"):
        return {"kind": word}
    if word == "quaternion_xyzw":
        return {"kind": "quaternion", "order": "xyzw"}
    if word in CONVENTIONS:
        return {"kind": "euler", "convention": word}
    allowed = f"none, quaternion, quaternion_xyzw, rotation_vector, {', '.join(CONVENTIONS)}"
    raise InputError(Problem("--orientation", repr(word), allowed))


def look(
    path: str | Path | Sequence[str | Path],
    answers: Mapping[str, Any] | None = None,
    need: str = MEASUREMENTS,
) -> Guess:
    """The best guess at a file.

    Two paths are joints and points of the same poses, as are two sheets of a workbook. ``answers``
    to choices by key, ``take`` (columns that are read whatever their names mean) and units among
    them. ``need``: measurements (joints and points), or joints, points (measured) or poses (wanted)
    alone. Raises Undecided where a choice is open, InputError where the needed columns are missing,
    where units contradict each other, and where ``take`` names columns that cannot be read.
    """
    answers = answers or {}
    looked = pairs.look(path, answers, need == POSES)
    table, columns = looked.table, _needed(looked.columns, need)
    questions = list(columns.questions)
    if need in (POINTS, POSES) and len(columns.targets) > 1 and not questions:
        meant = {t["x"].column: name for name, t in columns.targets.items()}
        questions = [Choice(TAKE, f"several points: {', '.join(columns.targets)}", meant)]
    if questions:
        raise Undecided(table.path, questions)
    _refuse_missing(looked.path, table, columns, answers.get("take", ()), need)
    notes = [*looked.notes, *table.notes]
    per_deg = _pulses(columns, table, answers)
    void = _no_reading(table, columns, answers) if need == MEASUREMENTS else []

    def values(name: Name) -> np.ndarray:
        # Numbers in place of a reading are no lengths.
        numbers = table.values(name.column)
        return np.where(np.isin(numbers, void), np.nan, numbers)

    problems: list[Problem] = []
    assumed = dict(looked.assumed)

    def unit_of(names: Sequence[Name], setting: str) -> str:
        return _unit(names, setting, table, values, answers, looked.stated, assumed, problems)

    turning = [name for name in columns.joints if name.unit not in LENGTH and not per_deg]
    first = next(iter(columns.targets.values()), {})
    joint_unit = unit_of(turning, "joint_unit")
    points = [t[axis] for t in columns.targets.values() for axis in "xyz"]
    length_unit = unit_of(points, "length_unit")
    angle_unit = unit_of([n for q, n in first.items() if q in ("rx", "ry", "rz")], "angle_unit")
    if need != MEASUREMENTS and joint_unit == "rad" and "joint_unit" in assumed:
        meant = {"rad": "radians", "deg": "degrees, of an arm that hardly moves"}
        raise Undecided(table.path, [Choice("--joint-unit", assumed["joint_unit"], meant)])
    refuse(problems, f"{table.path} cannot be described")
    section: dict[str, Any] = {"path": looked.path, **looked.written.written()}
    if need == MEASUREMENTS:
        q_rad = np.stack([values(name) for name in columns.joints], axis=1)
        q_rad = q_rad * ANGLE[joint_unit] / np.array(per_deg or 1.0)
        point_mm = np.stack([values(first[axis]) for axis in "xyz"], axis=1) * LENGTH[length_unit]
        columns = targets_in_rows.with_targets(table, columns, q_rad, point_mm)
        if targets_in_rows.counts_readings(table, columns, q_rad):
            section["repeats_in_names"] = True
    kind, convention = columns.turn
    orientation = {"kind": kind, "convention": convention, "unit": angle_unit}
    if kind == "euler":
        assumed["orientation"] = f"the orientations are Euler angles of convention {convention}"
    if "quat1" in first:
        orientation["order"] = "wxyz"
        parts = ", ".join(first[f"quat{number}"].column for number in range(1, 5))
        assumed["order"] = f"{parts} are w, x, y, z of the quaternion"
    if word := answers.get("orientation"):
        orientation |= orientation_of(word)
        assumed = {k: v for k, v in assumed.items() if k not in ("orientation", "order")}
    section |= {
        "no_reading": void,
        "sigma": _sigma(looked.path, columns, answers.get("sigma", "")),
        "joint_unit": joint_unit,
        "length_unit": length_unit,
        "orientation": orientation,
        "targets": list(columns.targets),
        "columns": _mapping(looked.path, columns, joint_unit, length_unit, angle_unit, problems),
    }
    refuse(problems, f"{looked.path} cannot be described")
    section |= {"pulses_per_deg": per_deg} if per_deg else {}
    section |= {"joints": looked.joints} if looked.joints else {}
    return Guess(section, table, columns, assumed, tuple(dict.fromkeys(notes)))


def _needed(columns: NamedColumns, need: str) -> NamedColumns:
    """The columns that are needed, with the questions on them; others come along if certain."""
    if need == MEASUREMENTS:
        return columns
    open_joints = [q for q in columns.questions if q.about.startswith(ABOUT_JOINTS)]
    rest = [q for q in columns.questions if q not in open_joints]
    about = open_joints if need == JOINTS else rest
    asked = tuple(question for question in about if len(question.answers) > 1)
    columns = replace(columns, questions=asked)
    if need == JOINTS:
        return replace(columns, targets={}, turn=("none", "XYZ"), commanded=())
    return replace(columns, joints=(), commanded=()) if open_joints else columns


def _refuse_missing(
    path: str, table: RawTable, columns: NamedColumns, take: Sequence[str], need: str
) -> None:
    problems = []
    for column in take:
        if column not in table.columns:
            message = f"{path} has no such column"
            problems.append(Problem(f"--take {column}", message, ", ".join(table.columns)))
        elif column not in columns.read() and need == MEASUREMENTS:
            why = next((f": {g.why_unread}" for g in columns.aside if column in g.names), "")
            allowed = "one column of joints, of a point or of an orientation"
            problems.append(Problem(f"--take {column}", f"cannot be read{why}", allowed))
    joints = (columns.joints, "no columns of 4 to 7 joints", (JOINTS,), "q1_deg ..")
    points = (columns.targets, "no columns of a measured point", (POINT, POSE), "x_mm ..")
    wanted = {JOINTS: (joints,), POINTS: (points,), POSES: (points,)}.get(need, (joints, points))
    for there, message, kinds, names in wanted:
        if there:
            continue
        spare = [group for group in columns.aside if group.kind in kinds]
        why = "; ".join(f"{group.text}: {group.why_unread}" for group in spare)
        fix = f"name them {names} (also by --names), or give joints and points as two files"
        nominal = [g.names[0] for g in spare if g.kind == POINT and g.role == NOMINAL][:1]
        fix += "".join(f"; --take {shlex.quote(name)} reads them all the same" for name in nominal)
        why = f" ({why})" if why else f" in {', '.join(table.columns)}"
        problems.append(Problem(path, f"{message} were found{why}", fix=fix))
    refuse(problems, f"{path} cannot be described")


def _sigma(path: str, columns: NamedColumns, given: str) -> int:
    """How many standard deviations the uncertainties that are read are, by name or by answer."""
    spreads = [n for t in columns.targets.values() for q, n in t.items() if q.startswith("std_")]
    coverage = {name.coverage for name in spreads}
    answered = {int(given)} if given not in ("", "none") else set()
    if len(coverage) > 1 or len((coverage - {0}) | answered) > 1:
        message = (
            f"not all of {', '.join(n.column for n in spreads)} are so many standard deviations"
        )
        where = f"--sigma {given}" if given else path
        fix = "give --sigma none, which reads none of them"
        raise InputError(Problem(where, message, "one number for all of them", fix))
    return max((coverage - {0}) | answered, default=1)


def is_pulse(name: Name) -> bool:
    """Whether a column holds pulses of a motor, which need their number in a degree."""
    return name.unit.lower() in PULSES


def _pulses(columns: NamedColumns, table: RawTable, answers: Mapping) -> list[float]:
    """Pulses of every joint's motor in a degree, empty where joints are angles."""
    given, joints = answers.get("pulses_per_deg"), columns.joints
    if not joints:
        return []
    if given is None:
        most = max(np.nanmax(np.abs(table.values(n.column)), initial=0.0) for n in joints)
        if is_pulse(joints[0]) or (not joints[0].unit and most >= _MOST_DEG):
            about = f"{listed([name.column for name in joints])} are pulses of the motors"
            meant = {",".join("ABCDEFG"[: len(joints)]): "pulses of each joint in a degree"}
            raise Undecided(table.path, [Choice("--pulses-per-deg", about, meant)])
        return []
    try:
        per_deg = [float(number) for number in given.split(",")]
    except ValueError:
        per_deg = []
    if len(per_deg) != len(joints) or 0.0 in per_deg or not np.isfinite(per_deg).all():
        allowed = f"{len(joints)} numbers parted by commas, none 0"
        raise InputError(Problem("--pulses-per-deg", repr(given), allowed))
    return per_deg


def _no_reading(table: RawTable, columns: NamedColumns, answers: Mapping) -> list[float]:
    """Numbers in place of a reading, as answered or as certain; raises Undecided on others.

    Certain is a number in all three coordinates and far from all other points.
    """
    given = [w for w in answers.get("no_reading", "").replace(" ", "").split(",") if w]
    try:
        void = [float(word) for word in given if word != "none"]
    except ValueError:
        allowed = "a number such as 9999.999, or none"
        message = f"{answers['no_reading']!r} is no number"
        raise InputError(Problem("--no-reading", message, allowed)) from None
    for name, target in columns.targets.items():
        points = np.stack([table.values(target[axis].column) for axis in "xyz"], axis=1)
        alike = points[(points == points[:, :1]).all(axis=1), 0]
        large = np.unique(points[np.abs(points) >= 999.0])
        numbers = {*alike.tolist(), *filter(is_no_coordinate, large.tolist())}
        unread = np.any([none_read(points, number) for number in numbers], axis=0)
        others = points[~unread & np.isfinite(points).all(axis=1)]
        centre = np.median(others, axis=0) if len(others) else np.zeros(3)
        extent = np.max(np.linalg.norm(others - centre, axis=1), initial=0.0)
        for number in sorted(numbers - {*void}):
            rows = none_read(points, number)
            far = np.linalg.norm(number - centre) > _FAR * extent and len(others) > 2
            if abs(number) >= BEYOND or (far and (points[rows] == number).all()):
                void.append(number)
            elif "none" not in given:
                before = "".join(f"{word}," for word in given)
                meant = {f"{before}{number:.10g}": "nothing was read there",
                         f"{before}none": "it was read so"}  # fmt: skip
                where = table.rows_in_words(np.flatnonzero(rows))
                about = f"the point of {name} is {number:.10g} in x, y or z of {where}"
                raise Undecided(table.path, [Choice("--no-reading", about, meant)])
    return sorted(void)


def _unit(
    names: Sequence[Name], setting: str, table: RawTable, values, answers, above, assumed, problems
) -> str:
    """The unit of columns: as stated, as answered, or by the size of their numbers.

    ``above``: the units of lines around the rows. What is assumed and what is wrong is added.
    """
    known, usual, small, largest = _UNITS[setting]
    if not names:
        return usual
    text = listed([name.column for name in names])
    most = max(np.nanmax(np.abs(values(name)), initial=0.0) for name in names)
    given = answers.get(setting)
    stated = {name.unit for name in names} - {""}
    where = f"{table.path}: columns {', '.join(name.column for name in names)}"
    if len(stated) > 1 or (given and stated - {given}):
        option = f" ({OPTIONS[setting][0]} {given})" if given else ""
        message = f"are in {' and '.join(sorted({*stated, *filter(None, [given])}))}{option}"
        problems.append(Problem(where, message, "one unit for all"))
    unit = given or next(iter(stated), above.get(setting.removesuffix("_unit"), ""))
    if not unit:
        unit = small if most <= largest else usual
        assumed[setting] = f"{text} are in {unit}: the largest number is {most:.4g}"
    elif unit not in known:
        problems.append(Problem(where, f"are in {unit}", " or ".join(known)))
    elif unit == "m" and most > largest:
        message = f"are in m, and the largest number is {most:.4g}"
        problems.append(Problem(where, message, f"at most {largest:g} m"))
    return unit if unit in known else usual


def _mapping(
    path: str, columns: NamedColumns, joint_unit: str, length_unit: str, angle_unit: str, problems
) -> dict[str, str]:
    """Our names and the file's, of every column that is read."""
    mapping: dict[str, str] = {}

    def put(ours: str, name: Name, unit: str) -> None:
        if name.unit in ("", unit) or not unit or is_pulse(name):
            mapping[ours] = name.column
        elif name.column != f"{ours}_{name.unit}":  # our own name states its unit
            message = f"is in {name.unit}, others of its kind are in {unit}"
            fix = "export all of them in one unit"
            problems.append(Problem(f"{path}: column {name.column}", message, unit, fix))

    for suffix, names in (("", columns.joints), ("_cmd", columns.commanded)):
        for number, name in enumerate(names, 1):
            put(f"q{number}{suffix}", name, length_unit if name.unit in LENGTH else joint_unit)
    for target, parts in columns.targets.items():
        for quantity, name in parts.items():
            turned = quantity.removeprefix("std_").startswith("r")
            unit = "" if quantity[0] == "q" else angle_unit if turned else length_unit
            put(quantity if target == TOOL else f"{target}_{quantity}", name, unit)
    for quantity, name in columns.single.items():
        put(quantity, name, length_unit if quantity.startswith("payload_") else "")
    return mapping


def summary(guess: Guess) -> list[str]:
    """What the columns were read as, a line each."""
    columns, (kind, convention) = guess.columns, guess.columns.turn
    target = next(iter(columns.targets.values()), {})
    turn = [name.column for quantity, name in target.items() if quantity[0] in "qr"]
    turned = f"w, x, y, z of a {kind}" if kind == "quaternion" else f"{kind} {convention}"
    parts = {
        "joints": [name.column for name in columns.joints],
        "point": [target[axis].column for axis in "xyz" if target],
        turned: turn,
    }
    return [f"{listed(names)}: read as {text}" for text, names in parts.items() if names]
