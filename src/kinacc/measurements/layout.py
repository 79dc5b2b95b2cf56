"""How a file is written and which column holds which quantity, in which unit.

A quantity of a row is ``q1``, ``q1_cmd`` (as commanded), ``s1``, ``pose``, ``repeat``, ``target``,
``session``, ``temperature``, ``payload`` or ``payload_x``. A quantity of a target is ``x``, ``rx``,
``qw``, ``std_x`` and the like, alone or behind the target's name (``mA_x``). A column
of the file carries the unit in its name (``q1_deg``, ``mA_x_mm``), or is mapped to our name and
then has the layout's unit. A name that says another unit than the layout is refused, and a point
that its name calls nominal, a deviation or an uncertainty is read only where ``targets`` or
``columns`` name it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kinacc.config.measured import (
    ANGLES,
    ANGLES_IN_ORDER,
    PAYLOAD,
    POINT,
    POSITION,
    QUATERNION,
    QUATERNION_IN_ORDER,
    STD,
    Directions,
    MeasuredFile,
    Orientation,
    Written,
)
from kinacc.config.records import Settings
from kinacc.errors import Problem
from kinacc.measurements.column_names import KNOWN, MEASURED, OPEN, PLAIN, REPORTED, name_of, role
from kinacc.measurements.table import RawTable

TOOL = "tool"  # name of the target whose columns carry no name
TABLE, FEATURES, SPHERICAL = "table", "features", "spherical"

ANGLE = {"deg": np.pi / 180.0, "rad": 1.0}
LENGTH = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "inch": 25.4}
# By so much may a quantity given in two units differ: rounding to the digits commands show.
_ROUNDED_RAD, _ROUNDED_MM = 1e-6, 1e-3
_CELSIUS = ({"c": 1.0, "C": 1.0}, "C", "")
_SINGLE = {"temperature": _CELSIUS, "temp": _CELSIUS, "payload": ({"kg": 1.0}, "kg", "")}

JOINTS = "joints"
# The longest quantity counts: mA_std_x is no x of a target named mA_std.
_OF_TARGET = re.compile(rf"(?:(.*?)_)??({'|'.join(POINT)})", re.DOTALL)
_NAMES = ("pose", "repeat", "target", "session")
_READ = (MEASURED, REPORTED, PLAIN)


class Layout(MeasuredFile):
    """The ``measurements.file`` section of the settings: all there is to know of a file."""

    @classmethod
    def of(cls, section: Settings) -> Layout:
        """From a section that was validated; a key that is not there is at its default."""
        turn = Orientation.model_construct(**section.get("orientation", {}))
        ways = Directions.model_construct(**section.get("directions", {}))
        return cls.model_construct(**{**section, "orientation": turn, "directions": ways})

    def but(self, **keys: object) -> Layout:
        """The layout with other values of some keys."""
        return self.model_copy(update=keys)

    def written(self) -> dict[str, object]:
        """The keys of the section that state how the file is written, defaults included."""
        return self.model_dump(include={*Written.model_fields, "layout", "directions"})


@dataclass(frozen=True)
class Place:
    """The column of the file a quantity stands in, and the factor to our unit."""

    column: str
    factor: float


@dataclass(frozen=True)
class Target:
    """Columns of a target: position always, the rest where the file has it (else empty).

    ``turn`` are the orientation's columns in the order its kind is read in; ``std`` as ``STD``.
    """

    name: str
    position: tuple[Place, ...]
    turn: tuple[Place, ...] = ()
    std: tuple[Place, ...] = ()


@dataclass(frozen=True)
class FileColumns:
    """Every column that is used. ``single`` holds pose, repeat, target, session, temperature.

    ``payload``: mass and, where the file has it, the three coordinates of its centre.
    """

    joints: tuple[Place, ...]
    commanded: tuple[Place, ...]
    directions: Mapping[int, Place]
    targets: tuple[Target, ...]
    single: Mapping[str, Place]
    payload: tuple[Place, ...]

    def measured(self) -> list[Place]:
        """Columns of all but the names of rows."""
        of_targets = [group for t in self.targets for group in list(vars(t).values())[1:]]
        groups = (self.joints, self.commanded, self.directions.values(), self.payload, *of_targets)
        return [place for group in groups for place in group]

    def unused(self, table: RawTable) -> tuple[str, ...]:
        """Columns of the file that hold nothing that was recognised."""
        used = {place.column for place in (*self.measured(), *self.single.values())}
        return tuple(name for name in table.columns if name not in used)


def find(
    table: RawTable,
    layout: Layout,
    prismatic: np.ndarray,
    problems: list[Problem],
    need: Sequence[str | tuple[str, ...]] = (JOINTS, POSITION),
) -> FileColumns:
    """Columns of every quantity; columns that are missing are added to ``problems``.

    ``prismatic`` (k,) is True for joints whose position is a length. ``need`` are the quantities
    that must be there, of ``JOINTS`` and ``POSITION``.
    """
    finder = _Finder(table, layout, prismatic, problems)
    numbers = range(1, len(prismatic) + 1)
    joints = finder.group([f"q{n}" for n in numbers], JOINTS in need)
    commanded = finder.group([f"q{n}_cmd" for n in numbers])
    if len(prismatic) and finder.place(spare := f"q{len(prismatic) + 1}"):
        message = f"{spare} is there, the robot has {len(prismatic)} joints"
        problems.append(Problem(f"{table.path}: columns", message))
    directions = {n - 1: place for n in numbers if (place := finder.place(f"s{n}"))}
    single = {name: place for name in _NAMES if (place := finder.place(name))}
    if place := finder.place("temperature") or finder.place("temp"):
        single["temperature"] = place
    mass, centre = finder.group(PAYLOAD[:1]), finder.group(PAYLOAD[1:])
    if centre and not mass:
        finder.problem("payload_kg", "is missing beside the centre of the payload")
    names = finder.targets()
    targets = [finder.target(name, len(names) == 1, POSITION in need) for name in names]
    for name, column in layout.columns.items():
        if column not in table.columns:
            message = f"is not there, but measurements.file.columns maps {name} to it"
            finder.problem(column, message, listed(table))
    columns = FileColumns(
        joints,
        commanded,
        directions,
        tuple(target for target in targets if target.position),
        single,
        (*mass, *centre) if mass else (),
    )
    uses = Counter(place.column for place in columns.measured())
    for column in (column for column in uses if uses[column] > 1 and not problems):
        mapped = ", ".join(name for name, source in layout.columns.items() if source == column)
        message = f"is taken for {uses[column]} quantities, {mapped} among them"
        finder.problem(column, message, "one", "correct measurements.file.columns")
    return columns


class _Finder:
    """Columns of a table by our names; what is wrong is added to ``problems``."""

    def __init__(
        self, table: RawTable, layout: Layout, prismatic: np.ndarray, problems: list[Problem]
    ) -> None:
        self.table, self.layout, self.problems = table, layout, problems
        self.slides = {f"q{n}{end}" for n in np.flatnonzero(prismatic) + 1 for end in ("", "_cmd")}
        self.per_deg = dict(enumerate(layout.pulses_per_deg or (), 1))
        fits = len(self.per_deg) == len(prismatic) and 0.0 not in self.per_deg.values()
        if self.per_deg and len(prismatic) and not fits:
            where, allowed = "measurements.file.pulses_per_deg", "a number for each joint, none 0"
            problems.append(Problem(where, f"{layout.pulses_per_deg}", allowed))
            self.per_deg = {}
        self.mapped_keys = {self.kind(name)[2] for name in layout.columns}

    def kind(self, quantity: str) -> tuple[Mapping[str, float], str, str]:
        """Units of a quantity with factors, that of a mapped column, and the key that states it."""
        layout, part = self.layout, split(quantity)[1]
        if quantity in (*self.slides, *PAYLOAD[1:]) or part in (*POSITION, *STD):
            return LENGTH, layout.length_unit, "length_unit"
        if joint := re.fullmatch(r"q(\d)(?:_cmd)?", quantity):
            if per_deg := self.per_deg.get(int(joint[1])):
                return dict.fromkeys(ANGLE, ANGLE["deg"] / per_deg), layout.joint_unit, ""
            return ANGLE, layout.joint_unit, "joint_unit"
        if part in (*ANGLES, *ANGLES_IN_ORDER):
            return ANGLE, layout.orientation.unit, "orientation.unit"
        return _SINGLE.get(quantity, ({"": 1.0}, "", ""))

    def place(self, name: str) -> Place | None:
        """The column of ``name``, if there is one; in two units it has to hold the same twice."""
        units, unit, key = self.kind(name)
        mapped = self.layout.columns.get(name)
        if mapped and name in self.slides:  # travel has a unit of its own
            stated = _stated_unit(self.table, mapped)
            unit = stated if stated in LENGTH else unit
        names = {f"{name}_{u}" if u else name: factor for u, factor in units.items()}
        names = {mapped: units[unit]} if mapped else names
        present = [Place(*pair) for pair in names.items() if pair[0] in self.table.columns]
        if not present:
            return None
        column = present[0].column
        if len(present) > 1:
            first, *others = (self.table.values(p.column) * p.factor for p in present)
            rounding = _ROUNDED_RAD if units is ANGLE else _ROUNDED_MM
            if not all(np.allclose(first, x, 0.0, rounding, equal_nan=True) for x in others):
                both = " or ".join(place.column for place in present)
                self.problem(both, "is given in two units that do not say the same")
        stated = _stated_unit(self.table, column)
        # A key that is the default may not be meant, and one may be about a mapped column.
        is_meant = mapped or (unit not in ("deg", "mm") and key not in self.mapped_keys)
        if key and is_meant and stated not in (None, unit):
            message = f"says {stated}, but measurements.file.{key} says {unit}"
            self.problem(column, message, "the same in both places")
        return present[0]

    def group(self, names: Sequence[str], required: bool = False) -> tuple[Place, ...]:
        """Columns of quantities that come together, or none of them where not ``required``."""
        places = {name: place for name in names if (place := self.place(name))}
        missing = [name for name in names if name not in places]
        if missing and required:
            for name in (name for name in missing if name not in self.layout.columns):
                units = self.kind(name)[0]
                fix = f"or map {name} in measurements.file.columns"
                column = " or ".join([f"{name}_{unit}" if unit else name for unit in units][:2])
                self.problem(column, "is missing", listed(self.table), fix)
        elif missing and places:
            self.problem(", ".join(missing), f"is missing beside {', '.join(places)}")
        return () if missing else tuple(places.values())

    def targets(self) -> list[str]:
        """Names of the targets to read, in order of their columns.

        A point whose name leaves open whether it was measured is a problem, unless it is named.
        """
        if self.layout.targets is not None:
            return list(self.layout.targets)
        named = [target or TOOL for target, part in map(split, self.layout.columns) if part == "x"]
        points = {}
        for column in map(str, self.table.columns):
            ours, _, unit = column.rpartition("_")
            target, part = split(ours)
            if part == "x" and unit in LENGTH:
                points[target or TOOL] = column
        roles = {name: role(name_of(f"{name} x").terms) for name in points}
        read = [name for name in points if roles[name] in _READ or name in named]
        nothing = not read and not named
        unclear = [n for n in points if n not in read and (nothing or roles[n] == OPEN)]
        if unclear:
            fix = f"name those measured in measurements.file.targets, of {', '.join(points)}"
            message = "the name does not say that this was measured"
            self.problem(", ".join(points[n] for n in unclear), message, "measured points", fix)
        return list(dict.fromkeys([*read, *named])) or [TOOL]

    def target(self, name: str, alone: bool, required: bool) -> Target:
        """Columns of a target; ``alone`` it must have an orientation, where there is a kind."""
        is_plain = "x" in self.layout.columns or not self.place(f"{TOOL}_x")
        prefix = "" if name == TOOL and is_plain else f"{name}_"
        position = self.group([f"{prefix}{part}" for part in POSITION], required)
        std = self.group([f"{prefix}{part}" for part in STD])
        return Target(name, position, self._turn(prefix, alone and required), std)

    def _turn(self, prefix: str, alone: bool) -> tuple[Place, ...]:
        turn = self.layout.orientation
        if turn.kind == "none":
            return ()
        by_axis, in_order = {
            "quaternion": (QUATERNION, QUATERNION_IN_ORDER),
            "euler": (in_order_of(turn.convention), ANGLES_IN_ORDER),
        }.get(turn.kind, (ANGLES, ()))
        if ordered := self.group([f"{prefix}{part}" for part in in_order]):
            order = [turn.order.index(part) for part in "wxyz"]
            return tuple(ordered[n] for n in order) if turn.kind == "quaternion" else ordered
        names = [f"{prefix}{part}" for part in by_axis]
        there = any(self.place(name) or name in self.layout.columns for name in names)
        if there or not alone:  # of several targets some may be bare points
            return self.group(names, required=alone)
        fix = "set measurements.file.orientation.kind: none for positions alone"
        message = "are missing: the file states no orientation"
        self.problem(", ".join(names), message, listed(self.table), fix)
        return ()

    def problem(self, column: str, message: str, allowed: str = "", fix: str = "") -> None:
        """Add a problem with a column, once."""
        problem = Problem(f"{self.table.path}: column {column}", message, allowed, fix)
        if problem not in self.problems:
            self.problems.append(problem)


def _stated_unit(table: RawTable, column: str) -> str | None:
    """The unit a column states in its name or under it, None for none that is known."""
    under = table.units.get(column, "")
    unit = name_of(column, under if name_of("x", under).unit in KNOWN else "").unit
    return unit if unit in KNOWN or " or " in unit else None


def in_order_of(convention: str) -> tuple[str, ...]:
    """Names of an Euler convention's angles, first to last: rz, ry, rx for ZYX.

    A convention that repeats an axis (ZYZ) has its first, second and third angle as rx, ry, rz.
    """
    axes = convention.lower()
    return tuple(f"r{axis}" for axis in axes) if len(set(axes)) == 3 else ANGLES


def split(name: str) -> tuple[str, str]:
    """Target (may be empty) and quantity of a name such as std_x or mA_std_x; empty if neither."""
    match = _OF_TARGET.fullmatch(name) if name not in PAYLOAD else None
    return (match[1] or "", match[2]) if match else ("", "")


def listed(table: RawTable) -> str:
    """The columns a file has, in words."""
    return "the file has " + ", ".join(map(str, table.columns))
