"""A file nobody has described as a ``measurements.file`` section, with all that was assumed."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.column_names import NOMINAL, Name
from kinacc.measurements.intake import columns, no_reading, pairs, targets_in_rows, text
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import NO_SIGMA, NamedColumns
from kinacc.measurements.intake.groups import is_pulse, listed
from kinacc.measurements.layout import ANGLE, LENGTH, TOOL, Layout, find
from kinacc.measurements.table import RawTable

FULL_TURN_RAD = 2.0 * np.pi * 1.05
_LARGEST_M = 50.0  # no instrument stands further away
_MOST_DEG = 7200.0  # no joint turns further
_UNITS = {  # usual and small unit, and the largest number that is taken for the small one
    "joint_unit": ("deg", "rad", FULL_TURN_RAD),
    "length_unit": ("mm", "m", _LARGEST_M),
    "angle_unit": ("deg", "rad", FULL_TURN_RAD),
}


@dataclass(frozen=True)
class Guess:
    """What ``measurements.file`` would say, and what of it the file does not.

    ``assumed`` are words on settings taken by default or by the size of numbers, by setting:
    joint_unit, length_unit, angle_unit, orientation, order. ``stated``: columns that state a unit,
    by setting. ``found`` is what the columns were recognised as; its questions are open. ``told``
    are words on what else is known of the file.
    """

    section: dict[str, Any]
    table: RawTable
    found: NamedColumns
    assumed: dict[str, str] = field(default_factory=dict)
    stated: dict[str, tuple[str, str]] = field(default_factory=dict)
    told: tuple[str, ...] = ()

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.found.joints)

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of the targets."""
        return tuple(self.found.targets)

    def but(self, settings: Mapping[str, Any]) -> Guess:
        """The guess with other settings; ``orientation`` is taken key by key."""
        turn = self.section["orientation"] | settings.get("orientation", {})
        return replace(self, section=self.section | {**settings, "orientation": turn})

    def unused(self) -> tuple[tuple[tuple[str, ...], str], ...]:
        """Columns the section does not have read, as the reader itself sees it, and why (or "").

        Raises InputError where the reader cannot follow the section.
        """
        problems = []
        slides = np.array([name.unit in LENGTH for name in self.found.joints])
        read = find(self.table, Layout.of(self.section), slides, problems)
        refuse(problems, f"{self.table.path} cannot be described")
        left = list(read.unused(self.table))
        told = []
        for group, why in self.found.aside:
            if {*group.names} <= {*left}:
                told.append((group.names, why))
                left = [name for name in left if name not in group.names]
        return (*told, (tuple(left), "")) if left else tuple(told)


def look(
    path: str | Path | Sequence[str | Path],
    take: Sequence[str] = (),
    turned: bool = True,
    answers: Mapping[str, str] | None = None,
) -> Guess:
    """The best guess at a file; what it leaves open stands in ``found.questions``.

    ``take``: columns that are read whatever their names say, each for all that go with it;
    ``turned``: orientations are wanted; ``answers`` to choices, by key. Two paths are joints and
    points of the same poses, as are two sheets of a workbook. Raises Undecided where a choice is
    open, InputError where joints or positions cannot be found, where units contradict each other,
    and where ``take`` names what cannot be read.
    """
    answers, sheets = answers or {}, ()
    if isinstance(path, (str, Path)):
        sheets = pairs.sheets_apart(Path(path), answers)
    pair = None
    if sheets or not isinstance(path, (str, Path)):
        pair = pairs.look([path, path] if sheets else path, take, turned, answers, sheets)
        path = pair.path
    path = str(path)
    looked = pair.points if pair else text.look(path, answers)
    table, sigma = pair.table if pair else looked.table, answers.get("sigma", "")
    found = pair.found if pair else columns.of_table(table, take, turned, sigma)
    per_deg, told = pulses(found, table, answers)
    _refuse(path, table, found, take)
    void: list[float] = [] if found.questions else _no_reading(table, found, answers)

    def values(name: Name) -> np.ndarray:
        # What says that nothing was read tells nothing of units and distances.
        every = table.values(name.column)
        return np.where(np.isin(every, void), np.nan, every)

    problems = []
    units = Units(table.path, values, problems, dict(looked.assumed), above=looked.stated)
    turning = [name for name in found.joints if name.unit not in LENGTH and not per_deg]
    first = next(iter(found.targets.values()))
    joint_unit = units.of(turning, "joint_unit")
    length_unit = units.of(
        [t[axis] for t in found.targets.values() for axis in "xyz"], "length_unit"
    )
    angle_unit = units.of([n for q, n in first.items() if q in ("rx", "ry", "rz")], "angle_unit")
    apart: tuple[str, ...] = ()
    q_rad = np.stack([values(name) for name in found.joints], axis=1)
    q_rad = q_rad * ANGLE[joint_unit] / np.array(per_deg or 1.0)
    if not found.questions:
        point = np.stack([values(first[axis]) for axis in "xyz"], axis=1) * LENGTH[length_unit]
        found, apart = targets_in_rows.told_apart(table, found, q_rad, point, values)
    kind, convention = found.turn
    orientation = {"kind": kind, "convention": convention, "unit": angle_unit}
    if kind == "euler":
        words = f"the orientations are Euler angles of convention {convention}"
        units.assumed["orientation"] = words
    if "quat1" in first:
        orientation["order"] = "wxyz"
        parts = ", ".join(first[f"quat{number}"].column for number in range(1, 5))
        units.assumed["order"] = f"{parts} are w, x, y, z of the quaternion"
    mapping = _mapping(path, found, joint_unit, length_unit, angle_unit, problems)
    refuse(problems, f"{path} cannot be described")
    section: dict[str, Any] = {
        "path": path,
        **looked.written.written(),
        "no_reading": void,
        "sigma": _sigma(path, found, sigma),
        "joint_unit": joint_unit,
        "length_unit": length_unit,
        "orientation": orientation,
        "targets": list(found.targets),
        "columns": mapping,
    }
    section |= {"pulses_per_deg": list(per_deg)} if per_deg else {}
    section |= {"joints": pair.joints} if pair else {}
    again, words = targets_in_rows.counted(table, found, q_rad)
    section |= {"repeats_in_names": True} if again else {}
    every = (*looked.told, *table.notes, *(pair.told if pair else ()), *told, *apart, *words)
    return Guess(section, table, found, units.assumed, units.stated, tuple(dict.fromkeys(every)))


def _sigma(path: str, found: NamedColumns, given: str) -> int:
    """How many standard deviations the uncertainties that are read are, by name or by answer."""
    spreads = [n for t in found.targets.values() for q, n in t.items() if q.startswith("std_")]
    said = {name.coverage for name in spreads}
    answered = {int(given)} if given not in ("", "none") else set()
    if len(said) > 1 or len((said - {0}) | answered) > 1:
        what = f"not all of {', '.join(n.column for n in spreads)} are so many standard deviations"
        where = f"--sigma {given}" if given else path
        fix = "give --sigma none, which reads none of them"
        raise InputError(Problem(where, what, "one number for all of them", fix))
    return max((said - {0}) | answered, default=1)


def sigma_choice(guess: Guess) -> Choice | None:
    """The question how many standard deviations an uncertainty is, where the file has some."""
    names = ", ".join(n for group, why in guess.found.aside if why == NO_SIGMA for n in group.names)
    meant = {"1": "one standard deviation", "2": "two", "none": "they are not read"}
    about = f"{names} do not tell how many standard deviations they are"
    return Choice("--sigma", about, meant) if names else None


def pulses(
    found: NamedColumns, table: RawTable, answers: Mapping[str, str]
) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Pulses of every joint's motor in a degree, empty where joints are angles; words on it.

    Raises Undecided where that was not answered, InputError where the answer does not fit.
    """
    given, joints = answers.get("pulses_per_deg"), found.joints
    if found.questions or not joints:
        return (), ()
    about = f"{listed([name.column for name in joints])} are pulses of the motors"
    if given is None:
        most = max(np.nanmax(np.abs(table.values(n.column)), initial=0.0) for n in joints)
        if is_pulse(joints[0].unit) or (not joints[0].unit and most >= _MOST_DEG):
            meant = {",".join("ABCDEFG"[: len(joints)]): "pulses of each joint in a degree"}
            raise Undecided(table.path, [Choice("--pulses-per-deg", about, meant)])
        return (), ()
    try:
        per_deg = tuple(float(each) for each in given.split(","))
    except ValueError:
        per_deg = ()
    if len(per_deg) != len(joints) or 0.0 in per_deg or not np.isfinite(per_deg).all():
        allowed = f"{len(joints)} numbers parted by commas, none 0"
        raise InputError(Problem("--pulses-per-deg", repr(given), allowed))
    return per_deg, (f"{about}, turned into degrees as answered",)


def _no_reading(table: RawTable, found: NamedColumns, answers: Mapping) -> list[float]:
    """Numbers that say that nothing was read, as answered or as found."""
    given = [w for w in answers.get("no_reading", "").replace(" ", "").split(",") if w]
    try:
        known = [float(each) for each in given if each != "none"]
    except ValueError:
        what = f"{answers['no_reading']!r} is no number"
        allowed = "a number such as 9999.999, or none"
        raise InputError(Problem("--no-reading", what, allowed)) from None

    def stacked(names) -> np.ndarray:
        return np.stack([table.values(name.column) for name in names], axis=1)

    points = {
        name: stacked(target[axis] for axis in "xyz") for name, target in found.targets.items()
    }
    none = no_reading.found(
        points, stacked(found.joints), table.rows_in_words, known, "none" not in given
    )
    if isinstance(none, Choice):
        raise Undecided(table.path, [none])
    return none


def _refuse(path: str, table: RawTable, found: NamedColumns, take: Sequence[str]) -> None:
    problems = []
    for column in take:
        if column not in table.columns:
            what = f"{path} has no such column"
            problems.append(Problem(f"--take {column}", what, ", ".join(table.columns)))
        elif column not in found.read():
            why = next((f": {why}" for group, why in found.aside if column in group.names), "")
            allowed = "one column of joints, of a point or of an orientation"
            problems.append(Problem(f"--take {column}", f"cannot be read{why}", allowed))
    joints = (found.joints, "no columns of 4 to 7 joints", ("joints",), "q1_deg ..")
    points = (found.targets, "no columns of a measured point", ("point", "pose"), "x_mm ..")
    for _, what, kinds, names in (each for each in (joints, points) if not each[0]):
        left = [(group, why) for group, why in found.aside if group.kind in kinds]
        told = "; ".join(f"{group.in_words()}: {why}" for group, why in left)
        takes = [g.names[0] for g, _ in left if g.kind == "point" and g.role == NOMINAL][:1]
        fix = f"name them {names}, or give joints and points as two files: init JOINTS POINTS"
        fix += "".join(f"; --take {shlex.quote(name)} reads them all the same" for name in takes)
        problems.append(Problem(path, f"{what} were found ({told})", fix=fix))
    refuse(problems, f"{path} cannot be described")


@dataclass
class Units:
    """Units of columns: those they state, or those the size of their numbers speaks for."""

    path: str
    values: Callable[[Name], np.ndarray]
    problems: list[Problem]
    assumed: dict[str, str] = field(default_factory=dict)
    stated: dict[str, tuple[str, str]] = field(default_factory=dict)
    above: Mapping[str, str] = field(default_factory=dict)
    given: Mapping[str, str] = field(default_factory=dict)  # asks for one unit for all

    def of(self, names: Sequence[Name], setting: str) -> str:
        """The unit of columns; what is wrong with it is a problem."""
        usual, small, largest = _UNITS[setting]
        if not names:
            return usual
        known = LENGTH if setting == "length_unit" else ANGLE
        words = listed([name.column for name in names])
        most = max(np.nanmax(np.abs(self.values(name)), initial=0.0) for name in names)
        above = self.above.get(setting.removesuffix("_unit"), "")  # in a line around the rows
        given = self.given.get(setting)
        unit = given or next((n.unit for n in names if n.unit), above)
        if self.given and (odd := {n.unit for n in names} - {"", unit}):
            what = f"are in {' and '.join(sorted({*odd, unit}))}"
            self.problems.append(Problem(f"{self.path}: columns {words}", what, "one unit for all"))
        if not unit:
            unit = small if most <= largest else usual
            self.assumed[setting] = f"{words} are in {unit}: the largest number is {most:.4g}"
            return unit
        self.stated[setting] = (unit, words)
        where = f"{self.path}: columns {', '.join(name.column for name in names)}"
        if unit not in known:
            self.problems.append(Problem(where, f"are in {unit}", " or ".join(known)))
        elif unit == "m" and most > largest:
            what = f"are in m, and the largest number is {most:.4g}"
            self.problems.append(Problem(where, what, f"at most {largest:g} m"))
        return unit if unit in known else usual


def _mapping(
    path: str, found: NamedColumns, joint_unit: str, length_unit: str, angle_unit: str, problems
) -> dict[str, str]:
    """Our names and the file's, of every column that is read."""
    mapping: dict[str, str] = {}

    def put(ours: str, name: Name, unit: str) -> None:
        if name.unit in ("", unit) or not unit or is_pulse(name.unit):
            mapping[ours] = name.column
        elif name.column != f"{ours}_{name.unit}":  # our own name says its unit
            what = f"is in {name.unit}, others of its kind are in {unit}"
            fix = "export all of them in one unit"
            problems.append(Problem(f"{path}: column {name.column}", what, unit, fix))

    for suffix, names in (("", found.joints), ("_cmd", found.commanded)):
        for number, name in enumerate(names, 1):
            put(f"q{number}{suffix}", name, length_unit if name.unit in LENGTH else joint_unit)
    for target, parts in found.targets.items():
        for quantity, name in parts.items():
            turned = quantity.removeprefix("std_").startswith("r")
            unit = "" if quantity[0] == "q" else angle_unit if turned else length_unit
            put(quantity if target == TOOL else f"{target}_{quantity}", name, unit)
    for quantity, name in found.single.items():
        put(quantity, name, length_unit if quantity.startswith("payload_") else "")
    return mapping
