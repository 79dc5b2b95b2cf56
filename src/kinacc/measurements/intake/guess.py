"""A file nobody has described as a ``measurements.file`` section, with all that was assumed."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.column_names import NOMINAL, Name, name_of
from kinacc.measurements.intake import (
    columns,
    counted_readings,
    motor_pulses,
    no_reading,
    pairs,
    targets_in_rows,
    text,
)
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import NO_SIGMA, NamedColumns
from kinacc.measurements.intake.groups import is_pulse
from kinacc.measurements.layout import ANGLE, LENGTH, TOOL, Layout, find
from kinacc.measurements.table import RawTable, numbers

_FULL_TURN_RAD = 2.0 * np.pi * 1.05
_LARGEST_M = 50.0  # no instrument stands further away


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
        section = self.section | {k: v for k, v in settings.items() if k != "orientation"}
        turn = section["orientation"] | settings.get("orientation", {})
        return replace(self, section=section | {"orientation": turn})

    def unused(self) -> tuple[tuple[tuple[str, ...], str], ...]:
        """Columns the section does not have read, as the reader itself sees it, and why (or "").

        Raises InputError where the reader cannot follow the section.
        """
        problems: list[Problem] = []
        slides = np.array([name.unit in ("mm", "m") for name in self.found.joints])
        read = find(self.table, Layout.of(self.section), slides, problems)
        if read is None:
            raise InputError(problems, f"{self.table.path} cannot be described")
        left = list(read.unused(self.table))
        told = []
        for group, why in self.found.aside:
            if set(group.names) <= set(left):
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
    answers = answers or {}
    pair = None
    sheets = pairs.sheets_apart(Path(path), answers) if isinstance(path, (str, Path)) else ()
    if sheets or not isinstance(path, (str, Path)):
        pair = pairs.look([path, path] if sheets else path, take, turned, answers, sheets)
        path = pair.path
    looked = pair.points if pair else text.look(path, answers)
    table, stated = pair.table if pair else looked.table, looked.stated
    units = table.under or ("",) * len(table.columns)
    if len(units) != len(table.columns):
        what = f"{len(units)} units under {len(table.columns)} column names"
        where = f"{path}: line {looked.written.skip_lines + 2}"
        raise InputError(Problem(where, what, "a unit, or nothing, for each"))
    names = [name_of(c, u) for c, u in zip(table.columns, units, strict=True)]
    cells: dict[str, np.ndarray] = {}

    def values(name: Name) -> np.ndarray:
        if name.column not in cells:
            cells[name.column] = numbers(table, name.column, [], gaps=True)
            # What says that nothing was read tells nothing of units and distances.
            every = cells[name.column]
            cells[name.column] = np.where(np.isin(every, void), np.nan, every)
        return cells[name.column]

    void: list[float] = []
    given = answers.get("sigma", "")
    found = pair.found if pair else columns.recognise(names, values, take, turned, given)
    pulses = motor_pulses.pulses(found, values, answers, table.path)
    found = pulses.found
    _refuse(str(path), table, found, take)
    none = [] if found.questions else _no_reading(table, found, values, answers)
    void += none
    cells.clear()
    problems: list[Problem] = []
    sizes = _Units(table.path, values, problems, dict(looked.assumed), above=stated)
    first = next(iter(found.targets.values()))
    turn = [n for q, n in first.items() if q in ("rx", "ry", "rz")]
    joint_unit = sizes.of(
        [n for n in found.joints if n.unit not in ("mm", "m") and not pulses.per_deg],
        "joint_unit",
        ("deg", "rad"),
        _FULL_TURN_RAD,
    )
    points = [each[axis] for each in found.targets.values() for axis in "xyz"]
    length_unit = sizes.of(points, "length_unit", ("mm", "m"), _LARGEST_M)
    angle_unit = sizes.of(turn, "angle_unit", ("deg", "rad"), _FULL_TURN_RAD)
    found, apart = targets_in_rows.told_apart(
        table,
        found,
        values,
        ANGLE[joint_unit] / np.array(pulses.per_deg or 1.0),
        LENGTH[length_unit],
    )
    kind, convention = found.turn
    if kind == "euler":
        sizes.assumed["orientation"] = (
            f"the orientations are Euler angles of convention {convention}"
        )
    turned_as = {"kind": kind, "convention": convention, "unit": angle_unit}
    if "quat1" in first:
        turned_as["order"] = "wxyz"
        listed = ", ".join(first[f"quat{number}"].column for number in range(1, 5))
        sizes.assumed["order"] = f"{listed} are w, x, y, z of the quaternion"
    units = {"joint_unit": joint_unit, "length_unit": length_unit}
    mapping = _mapping(str(path), found, joint_unit, length_unit, angle_unit, problems)
    refuse(problems, f"{path} cannot be described")
    section: dict[str, Any] = {
        "path": str(path),
        **looked.written.section(),
        "no_reading": none,
        "sigma": _sigma(str(path), found, given),
        **units,
        "orientation": turned_as,
        "targets": list(found.targets),
        "columns": mapping,
    }
    if pulses.per_deg:
        section["pulses_per_deg"] = list(pulses.per_deg)
    if pair:
        section["joints"] = pair.joints
    told = (*looked.told, *table.notes, *(pair.told if pair else ()), *pulses.told, *apart)
    again, words = counted_readings.found(table, found, values)
    if again:
        section["repeats_in_names"] = True
    told = tuple(dict.fromkeys((*told, *words)))
    return Guess(section, table, found, sizes.assumed, sizes.stated, told)


def _sigma(path: str, found: NamedColumns, given: str) -> int:
    """How many standard deviations the uncertainties that are read are, by name or by answer."""
    spreads = [n for t in found.targets.values() for q, n in t.items() if q.startswith("std_")]
    said = {name.coverage for name in spreads}
    if len(said) > 1 or (given not in ("", "none") and not said <= {0, int(given)}):
        names = ", ".join(name.column for name in spreads)
        what = f"not all of {names} are so many standard deviations"
        where = f"--sigma {given}" if given else path
        fix = "give --sigma none, which reads none of them"
        raise InputError(Problem(where, what, "one number for all of them", fix))
    named = max(said, default=0)
    return named or (1 if given in ("", "none") else int(given))


def sigma_choice(guess: Guess) -> Choice | None:
    """The question how many standard deviations an uncertainty is, where the file has some."""
    left = [group for group, why in guess.found.aside if why == NO_SIGMA]
    if not left:
        return None
    names = ", ".join(name for group in left for name in group.names)
    meant = {"1": "one standard deviation", "2": "two", "none": "they are not read"}
    return Choice("--sigma", f"{names} do not tell how many standard deviations they are", meant)


def _no_reading(
    table: RawTable, found: NamedColumns, values: Callable[[Name], np.ndarray], answers: Mapping
) -> list[float]:
    """Numbers that say that nothing was read, as answered or as found."""
    given = answers.get("no_reading")
    known: list[float] = []
    answered = [each.strip() for each in given.split(",")] if given else []
    if answered:
        try:
            known = [float(each) for each in answered if each != "none"]
        except ValueError:
            what, allowed = f"{given!r} is no number", "a number such as 9999.999, or none"
            raise InputError(Problem("--no-reading", what, allowed)) from None
    points = {
        name: np.stack([values(target[axis]) for axis in "xyz"], axis=1)
        for name, target in found.targets.items()
    }
    joints = np.stack([values(name) for name in found.joints], axis=1)
    none = no_reading.found(points, joints, table.rows_in_words, known, "none" not in answered)
    if none.choice:
        raise Undecided(table.path, [none.choice])
    return list(none.numbers)


def _refuse(path: str, table: RawTable, found: NamedColumns, take: Sequence[str]) -> None:
    problems = []
    by_hand = "or write the data set by hand (docs/configuration.md)"
    for column in take:
        if column not in table.columns:
            what = f"{path} has no such column"
            problems.append(Problem(f"--take {column}", what, ", ".join(table.columns)))
        elif column not in found.read():
            whys = [why for group, why in found.aside if column in group.names]
            what = f"cannot be read{f': {whys[0]}' if whys else ''}"
            allowed = "one column of joints, of a point or of an orientation"
            problems.append(Problem(f"--take {column}", what, allowed))
    for there, kinds, what, allowed, fix in (
        (found.joints, ("joints",), "no columns of 4 to 7 joints", "q1 ..", "q1_deg, q2_deg .."),
        (
            found.targets,
            ("point", "pose"),
            "no columns of a measured point",
            "x, y, z",
            "x_mm, y_mm, z_mm",
        ),
    ):
        if there:
            continue
        left = [(group, why) for group, why in found.aside if group.kind in kinds]
        told = "; ".join(f"{group.in_words()}: {why}" for group, why in left)
        takeable = [g.names[0] for g, _ in left if g.kind == "point" and g.role == NOMINAL]
        fix = f"name them {fix}, {by_hand}"
        if bool(found.joints) != bool(found.targets):
            fix += "; where they stand in a file of their own, give both: kinacc init JOINTS POINTS"
        if takeable:
            fix += f"; --take {shlex.quote(takeable[0])} reads them all the same"
        what = f"{what} were found" + (f" ({told})" if told else "")
        problems.append(Problem(path, what, allowed, fix))
    refuse(problems, f"{path} cannot be described")


@dataclass
class _Units:
    """Units of columns: those they state, or those the size of their numbers speaks for."""

    path: str
    values: Callable[[Name], np.ndarray]
    problems: list[Problem]
    assumed: dict[str, str] = field(default_factory=dict)
    stated: dict[str, tuple[str, str]] = field(default_factory=dict)
    above: Mapping[str, str] = field(default_factory=dict)

    def of(
        self, names: Sequence[Name], setting: str, units: tuple[str, str], largest: float
    ) -> str:
        usual, small = units
        if not names:
            return usual
        ends = [names[0].column, names[-1].column]
        listed = " .. ".join(ends) if len(names) > 3 else ", ".join(n.column for n in names)
        sizes = [np.nanmax(np.abs(self.values(n)), initial=0.0) for n in names]
        most = float(max(sizes))
        stated = list(dict.fromkeys(each.unit for each in names if each.unit))
        kind = {"length_unit": "length", "angle_unit": "angle"}.get(setting, "")
        if not stated and kind in self.above:
            stated = [self.above[kind]]  # in a line around the rows
        if not stated:
            unit = small if most <= largest else usual
            self.assumed[setting] = f"{listed} are in {unit}: the largest number is {most:.4g}"
            return unit
        unit = stated[0]
        self.stated[setting] = (unit, listed)
        where = f"{self.path}: columns {', '.join(n.column for n in names)}"
        if unit not in units:
            self.problems.append(Problem(where, f"are in {unit}", f"{usual} or {small}"))
        elif unit == "m" and most > largest:
            what = f"are in m, and the largest number is {most:.4g}"
            self.problems.append(
                Problem(where, what, f"at most {largest:g} m", "correct the names")
            )
        return unit if unit in units else usual


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
            slides = name.unit in ("mm", "m")
            put(f"q{number}{suffix}", name, length_unit if slides else joint_unit)
    for target, parts in found.targets.items():
        prefix = "" if target == TOOL else f"{target}_"
        for quantity, name in parts.items():
            turned = quantity.removeprefix("std_").startswith("r")
            unit = "" if quantity[0] == "q" else angle_unit if turned else length_unit
            put(f"{prefix}{quantity}", name, unit)
    for quantity, name in found.single.items():
        unit = length_unit if quantity.startswith("payload_") else ""
        put(quantity, name, unit)
    return mapping
