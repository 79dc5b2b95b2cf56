"""A file nobody has described as a ``measurements.file`` section, with all that was assumed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.config.measured import CONVENTIONS
from kinacc.config.records import Settings
from kinacc.errors import Problem, input_error, refuse
from kinacc.measurements.column_names import Name
from kinacc.measurements.faults import BEYOND, is_no_coordinate, none_read
from kinacc.measurements.intake import pairs, targets_in_rows
from kinacc.measurements.intake.choices import Answers, Choice, Undecided
from kinacc.measurements.intake.columns import MEASUREMENTS, NamedColumns
from kinacc.measurements.intake.groups import JOINTS, POINT, POSE, PULSES, listed
from kinacc.measurements.intake.text import Looked
from kinacc.measurements.layout import ANGLE, LENGTH, TOOL
from kinacc.measurements.table import RawTable, numbers_of

_FULL_TURN_RAD = 2.0 * np.pi * 1.05
_LARGEST_M = 50.0  # no instrument stands further away
_MOST_DEG = 7200.0  # no joint turns further
_FAR = 1.5  # times the extent of the other points
# By setting: the units that are known, the usual and the small one, and the largest number that is
# taken for the small one.
_UNITS: dict[str, tuple[Mapping[str, float], str, str, float]] = {
    "joint_unit": (ANGLE, "deg", "rad", _FULL_TURN_RAD),
    "length_unit": (LENGTH, "mm", "m", _LARGEST_M),
    "angle_unit": (ANGLE, "deg", "rad", _FULL_TURN_RAD),
}
_ORIENTATIONS = {
    **{kind: {"kind": kind} for kind in ("none", "quaternion", "rotation_vector")},
    "quaternion_xyzw": {"kind": "quaternion", "order": "xyzw"},
    **{name: {"kind": "euler", "convention": name} for name in CONVENTIONS},
}


@dataclass(frozen=True)
class Guess:
    """A ``measurements.file`` section, and what of it the file does not state.

    ``assumed``: settings taken by default or by the size of numbers, with a text on each.
    ``columns``: their meaning. ``notes``: facts on how the file was read.
    """

    section: dict[str, Any]
    table: RawTable
    columns: NamedColumns
    assumed: dict[str, str]
    notes: tuple[str, ...]

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.columns.joints)

    def but(self, settings: Settings) -> Guess:
        """The guess with other settings; ``orientation`` is taken key by key."""
        turn = self.section["orientation"] | settings.get("orientation", {})
        return replace(self, section=self.section | {**settings, "orientation": turn})

    def reasons(self, unused: Sequence[str]) -> dict[str, str]:
        """Why columns that the reader does not use are not read, by column; "" where unknown."""
        why = {name: g.why_unread for g in self.columns.aside for name in g.names}
        return {name: why.get(name, "") for name in unused}


def look(path: str | Path | Sequence[str | Path], answers: Answers | None = None) -> Guess:
    """The best guess at a file, or at two with joints and points of the same poses.

    As :func:`described`.
    """
    answers = answers or {}
    return described(pairs.look(path, answers), answers)


def described(looked: Looked, answers: Answers, need: str = MEASUREMENTS) -> Guess:
    """The best guess at a file whose table is known.

    ``answers`` to choices by key, ``take`` (columns that are read whatever their names mean) and
    units among them. ``need``: measurements (joints and points), or joints, points (measured) or
    poses (wanted) alone. Raises Undecided where a choice is open, InputError where the needed
    columns are missing, where units contradict each other, and where ``take`` names columns that
    cannot be read.
    """
    table, columns = looked.table, looked.columns
    if questions := (*columns.on_joints, *columns.questions):
        raise Undecided(table.path, *questions)
    refuse(_missing(looked, columns, answers.get("take", ()), need),
           f"{looked.path} cannot be described")  # fmt: skip
    guesser = _Guesser(looked, columns, answers)
    per_deg = guesser.pulses()
    if need == MEASUREMENTS:
        guesser.no_reading()
    joint_unit, length_unit, angle_unit = guesser.units(per_deg)
    if need != MEASUREMENTS and joint_unit == "rad" and "joint_unit" in guesser.assumed:
        meant = {"rad": "radians", "deg": "degrees, of an arm that hardly moves"}
        raise Undecided(table.path, Choice("--joint-unit", guesser.assumed["joint_unit"], meant))
    section: dict[str, Any] = {"path": looked.path, **looked.written.written()}
    if need == MEASUREMENTS:
        q_rad = guesser.stacked(columns.joints) * ANGLE[joint_unit] / np.array(per_deg or 1.0)
        first = next(iter(columns.targets.values()))
        point_mm = guesser.stacked([first[axis] for axis in "xyz"]) * LENGTH[length_unit]
        columns = targets_in_rows.with_targets(table, columns, q_rad, point_mm)
        if targets_in_rows.counts_readings(table, columns, q_rad):
            section["repeats_in_names"] = True
    section |= {
        "no_reading": sorted(guesser.void),
        "sigma": guesser.sigma(),
        "joint_unit": joint_unit,
        "length_unit": length_unit,
        "orientation": guesser.orientation(angle_unit),
        "targets": list(columns.targets) or [TOOL],
        "columns": {ours: name.column for ours, name in columns.by_our_names().items()},
    }
    section |= {"pulses_per_deg": per_deg} if per_deg else {}
    section |= {"joints": looked.joints} if looked.joints else {}
    notes = dict.fromkeys((*looked.notes, *table.notes))
    return Guess(section, table, columns, guesser.assumed, tuple(notes))


def _missing(
    looked: Looked, columns: NamedColumns, take: Sequence[str], need: str
) -> Iterator[Problem]:
    """Columns that are needed, or that ``take`` names, and that cannot be read."""
    table, path = looked.table, looked.path
    for column in take:
        if column not in table.columns:
            message = f"{path} has no such column"
            yield Problem(f"--take {column}", message, ", ".join(table.columns))
        elif column not in columns.read() and need == MEASUREMENTS:
            why = next((f": {g.why_unread}" for g in columns.aside if column in g.names), "")
            allowed = "one column of joints, of a point or of an orientation"
            yield Problem(f"--take {column}", f"cannot be read{why}", allowed)
    missing: list[tuple[str, Sequence[str], str]] = []
    if need in (JOINTS, MEASUREMENTS) and not columns.joints:
        missing.append(("no columns of 4 to 7 joints", (JOINTS,), "q1_deg .."))
    if need != JOINTS and not columns.targets:
        named = "x_mm .. (SMR1 X .. of several)"
        missing.append(("no columns of a measured point", (POINT, POSE), named))
    for message, kinds, names in missing:
        spare = [group for group in columns.aside if group.kind in kinds]
        why = "; ".join(f"{group.text}: {group.why_unread}" for group in spare)
        why = f" ({why})" if why else f" in {', '.join(table.columns)}"
        fix = f"name them {names} (also by --names), or give joints and points as two files"
        yield Problem(path, f"{message} were found{why}", fix=fix)


class _Guesser:
    """Settings of columns by their names and numbers; ``assumed`` grows.

    ``void``: numbers in place of a reading.
    """

    def __init__(self, looked: Looked, columns: NamedColumns, answers: Answers) -> None:
        self.looked, self.table, self.columns, self.answers = looked, looked.table, columns, answers
        self.first = next(iter(columns.targets.values()), {})
        self.assumed = dict(looked.assumed)
        self.void: set[float] = set()

    def stacked(self, names: Sequence[Name]) -> np.ndarray:
        """Numbers (n, len(names)) of columns, NaN where nothing was read."""
        numbers = self.table.stacked(name.column for name in names)
        return np.where(np.isin(numbers, [*self.void]), np.nan, numbers)

    def pulses(self) -> list[float]:
        """Pulses of every joint's motor in a degree, empty where joints are angles."""
        answer, joints = self.answers.get("pulses_per_deg"), self.columns.joints
        if joints and answer is None:
            most = np.nanmax(np.abs(self.stacked(joints)), initial=0.0)
            if joints[0].unit.lower() in PULSES or (not joints[0].unit and most >= _MOST_DEG):
                about = f"{listed([name.column for name in joints])} are pulses of the motors"
                meant = {",".join("ABCDEFG"[: len(joints)]): "pulses of each joint in a degree"}
                raise Undecided(self.table.path, Choice("--pulses-per-deg", about, meant))
        if not joints or answer is None:
            return []
        per_deg = numbers_of(answer)
        if len(per_deg) != len(joints) or not per_deg.all():
            allowed = f"{len(joints)} numbers parted by commas, none 0"
            raise input_error("--pulses-per-deg", repr(answer), allowed)
        return per_deg.tolist()

    def no_reading(self) -> None:
        """Numbers in place of a reading, as answered or as certain; raises Undecided on others.

        Certain is a number in all three coordinates and far from all other points.
        """
        answer = self.answers.get("no_reading", "").replace("none", "")
        self.void = {*numbers_of(answer).tolist()}
        if answer.strip(" ,") and not self.void:
            allowed = "a number such as 9999.999, or none"
            raise input_error("--no-reading", f"{answer!r} is no number", allowed)
        for name, target in self.columns.targets.items():
            points = self.stacked([target[axis] for axis in "xyz"])
            alike = points[(points == points[:, :1]).all(axis=1), 0]
            large = np.unique(points[np.abs(points) >= 999.0])
            numbers = {*alike.tolist(), *filter(is_no_coordinate, large.tolist())}
            unread = np.any([none_read(points, number) for number in numbers], axis=0)
            others = points[~unread & np.isfinite(points).all(axis=1)]
            centre = np.median(others, axis=0) if len(others) else np.zeros(3)
            extent = np.max(np.linalg.norm(others - centre, axis=1), initial=0.0)
            for number in sorted(numbers):
                rows = none_read(points, number)
                far = np.linalg.norm(number - centre) > _FAR * extent and len(others) > 2
                if abs(number) >= BEYOND or (far and (points[rows] == number).all()):
                    self.void.add(number)
                elif "none" not in self.answers.get("no_reading", ""):
                    before = "".join(f"{value:.10g}," for value in numbers_of(answer))
                    meant = {f"{before}{number:.10g}": "nothing was read there",
                             f"{before}none": "it was read so"}  # fmt: skip
                    where = self.table.rows_in_words(rows)
                    about = f"the point of {name} is {number:.10g} in x, y or z of {where}"
                    raise Undecided(self.table.path, Choice("--no-reading", about, meant))

    def units(self, per_deg: list[float]) -> list[str]:
        """The units of joints, lengths and angles."""
        turning = [name for name in self.columns.joints if name.unit not in LENGTH and not per_deg]
        points = [t[axis] for t in self.columns.targets.values() for axis in "xyz"]
        angles = [name for q, name in self.first.items() if q in ("rx", "ry", "rz")]
        return [self._unit(*pair) for pair in zip((turning, points, angles), _UNITS, strict=True)]

    def _unit(self, names: Sequence[Name], setting: str) -> str:
        """The unit of columns: as stated, as answered, or by the size of their numbers."""
        known, usual, small, largest = _UNITS[setting]
        if not names:
            return usual
        answer, columns = self.answers.get(setting, ""), [name.column for name in names]
        units = ({name.unit for name in names} | {answer}) - {""}
        units = units or {self.looked.stated.get(setting.removesuffix("_unit"), "")} - {""}
        most = np.nanmax(np.abs(self.stacked(names)), initial=0.0)
        if not units:
            unit = small if most <= largest else usual
            text = f"{listed(columns)} are in {unit}: the largest number is {most:.4g}"
            self.assumed[setting] = text
            return unit
        unit = min(units)
        if len(units) == 1 and unit in known and (unit != "m" or most <= largest):
            return unit
        option = f" (--{setting.replace('_', '-')} {answer})" if answer else ""
        message = f"are in {' and '.join(sorted(units))}{option}; the largest number is {most:.4g}"
        allowed = f"one unit for all: {' or '.join(known)}, at most {_LARGEST_M:g} m"
        where = f"{self.table.path}: columns {', '.join(columns)}"
        raise input_error(where, message, allowed)

    def orientation(self, angle_unit: str) -> dict[str, str]:
        """The section on orientations, as answered or by the names of their columns."""
        kind, convention = self.columns.turn
        section = {"kind": kind, "convention": convention, "unit": angle_unit}
        if "quat1" in self.first:
            section["order"] = "wxyz"
        if (answer := self.answers.get("orientation")) is not None:
            if answer not in _ORIENTATIONS:
                allowed = ", ".join(_ORIENTATIONS)
                raise input_error("--orientation", repr(answer), allowed)
            return section | _ORIENTATIONS[answer]
        if kind == "euler":
            text = f"the orientations are Euler angles of convention {convention}"
            self.assumed["orientation"] = text
        if "quat1" in self.first:
            parts = ", ".join(self.first[f"quat{number}"].column for number in range(1, 5))
            self.assumed["orientation"] = f"{parts} are w, x, y, z of the quaternion"
        return section

    def sigma(self) -> int:
        """How many standard deviations the uncertainties that are read are."""
        answer = self.answers.get("sigma", "")
        coverage = {
            name.column: name.coverage
            for target in self.columns.targets.values()
            for quantity, name in target.items()
            if quantity.startswith("std_")
        }
        stated = {*coverage.values()}
        numbers = (stated - {0}) | ({int(answer)} if answer.isdecimal() else set())
        if len(stated) > 1 or len(numbers) > 1:
            message = f"not all of {', '.join(coverage)} are so many standard deviations"
            where = f"--sigma {answer}" if answer else self.looked.path
            fix = "give --sigma none, which reads none of them"
            raise input_error(where, message, "one number for all of them", fix)
        return max(numbers, default=1)
