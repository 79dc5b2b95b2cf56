"""How a file states its measurements: which column holds which quantity, in which unit.

A quantity of a row is ``q1``, ``q1_cmd`` (as commanded), ``s1``, ``pose``, ``repeat``, ``target``,
``session``, ``temperature``, ``payload`` or ``payload_x``. A quantity of a target is ``x``, ``rx``,
``qw``, ``std_x``, ``cov_xy`` and the like, alone or behind the target's name (``mA_x``). A column
of the file carries
the unit in its name (``q1_deg``, ``mA_x_mm``), or is mapped to our name and then has the layout's
unit. A name that says another unit than the layout is refused, and a point that its name calls
nominal, a deviation or an uncertainty is read only where ``targets`` or ``columns`` name it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.errors import Problem
from kinacc.measurements import column_names
from kinacc.measurements.column_names import name_of
from kinacc.measurements.table import RawTable, numbers

TOOL = "tool"  # name of the target whose columns carry no name

ANGLE = {"deg": np.pi / 180.0, "rad": 1.0}
LENGTH = {"mm": 1.0, "m": 1000.0}
# By so much may a quantity given in two units differ: rounding to the digits commands show.
ROUNDED_RAD, ROUNDED_MM = 1e-6, 1e-3
AREA = {"mm2": 1.0, "m2": 1.0e6}
CELSIUS = {"c": 1.0, "C": 1.0}
MASS = {"kg": 1.0}
PURE = {"": 1.0}

POSITION = ("x", "y", "z")
PAYLOAD = ("payload", "payload_x", "payload_y", "payload_z")
STD = ("std_x", "std_y", "std_z")
STD_TURN = ("std_rx", "std_ry", "std_rz")
COVARIANCE = ("cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz")
QUATERNION = ("qw", "qx", "qy", "qz")
QUATERNION_IN_ORDER = ("quat1", "quat2", "quat3", "quat4")
ANGLES = ("rx", "ry", "rz")
ANGLES_IN_ORDER = ("e1", "e2", "e3")
_TARGET_QUANTITIES = (
    *POSITION,
    *STD,
    *STD_TURN,
    *COVARIANCE,
    *QUATERNION,
    *QUATERNION_IN_ORDER,
    *ANGLES,
    *ANGLES_IN_ORDER,
)
_POINT = re.compile(r"(?P<name>.+_x)_(?:mm|m)")
_READ = (column_names.MEASURED, column_names.REPORTED, column_names.PLAIN)


@dataclass(frozen=True)
class Layout:
    """The ``measurements.file`` section of the configuration, as far as it speaks of columns.

    ``columns`` maps our names (``q1``, ``x``, ``mA_x``, ``pose``, ...) to the file's own, which
    then carry ``joint_unit``, ``length_unit`` and ``angle_unit``. ``orientation`` is none,
    quaternion (``order`` of quat1..quat4), rotation_vector or euler (of ``convention``).
    ``targets`` names those to read; None for all that are there. ``no_reading`` are numbers that
    say that nothing was read; uncertainties are ``sigma`` standard deviations. ``pulses_per_deg``:
    mapped joints are motor pulses. ``repeats_in_names``: P12_1 and P12-2 are readings of one pose.
    """

    columns: Mapping[str, str]
    joint_unit: str
    length_unit: str
    orientation: str
    convention: str
    angle_unit: str
    order: str | None
    targets: tuple[str, ...] | None
    no_reading: tuple[float, ...] = ()
    sigma: int = 1
    pulses_per_deg: tuple[float, ...] | None = None
    repeats_in_names: bool = False

    @classmethod
    def of(cls, section: Mapping) -> Layout:
        """Layout from the configuration section ``measurements.file``."""
        turn, targets = section["orientation"], section.get("targets")
        return cls(
            section["columns"],
            section["joint_unit"],
            section["length_unit"],
            turn["kind"],
            turn["convention"],
            turn["unit"],
            turn.get("order"),
            None if targets is None else tuple(targets),
            tuple(section.get("no_reading", ())),
            section.get("sigma", 1),
            tuple(section.get("pulses_per_deg") or ()) or None,
            section.get("repeats_in_names", False),
        )


@dataclass(frozen=True)
class Place:
    """The column of the file a quantity stands in, and the factor to our unit."""

    column: str
    factor: float


@dataclass(frozen=True)
class Target:
    """Columns of one target: position always, the rest where the file has it (else empty).

    ``turn`` are the orientation's columns in the order its kind is read in; ``std``, ``std_turn``
    and ``covariance`` as ``STD``, ``STD_TURN`` and ``COVARIANCE``.
    """

    name: str
    position: tuple[Place, ...]
    turn: tuple[Place, ...] = ()
    std: tuple[Place, ...] = ()
    std_turn: tuple[Place, ...] = ()
    covariance: tuple[Place, ...] = ()

    def places(self) -> Iterator[Place]:
        """Every column of the target."""
        for group in (self.position, self.turn, self.std, self.std_turn, self.covariance):
            yield from group


@dataclass(frozen=True)
class FoundColumns:
    """Every column that is used. ``single`` holds pose, repeat, target, session, temperature.

    ``payload``: mass and, where the file has it, the three coordinates of its centre.
    """

    joints: tuple[Place, ...]
    commanded: tuple[Place, ...]
    directions: Mapping[int, Place]
    targets: tuple[Target, ...]
    single: Mapping[str, Place]
    payload: tuple[Place, ...] = ()

    def unused(self, table: RawTable) -> tuple[str, ...]:
        """Columns of the file that hold nothing that was recognised."""
        used = {place.column for place in (*self.joints, *self.commanded, *self.payload)}
        used |= {place.column for place in (*self.directions.values(), *self.single.values())}
        used |= {place.column for target in self.targets for place in target.places()}
        return tuple(name for name in table.columns if name not in used)


def find(
    table: RawTable, layout: Layout, prismatic: np.ndarray, problems: list[Problem]
) -> FoundColumns | None:
    """Columns of every quantity; None where one is missing, which is added to ``problems``.

    ``prismatic`` (k,) marks joints whose position is a length.
    """
    finder = _Finder(table, layout, problems)
    before = len(problems)
    joints = finder.group([f"q{i + 1}" for i in range(len(prismatic))], prismatic, required=True)
    commanded = finder.group([f"q{i + 1}_cmd" for i in range(len(prismatic))], prismatic)
    finder.refuse_spare_joint(len(prismatic))
    directions = {i: finder.any(f"s{i + 1}", PURE, "") for i in range(len(prismatic))}
    single = {name: finder.any(name, PURE, "") for name in ("pose", "repeat", "target", "session")}
    single["temperature"] = finder.any("temperature", CELSIUS, "C") or finder.any(
        "temp", CELSIUS, "C"
    )
    payload = finder.payload()
    names = finder.targets()
    targets = tuple(finder.target(name, alone=len(names) == 1) for name in names)
    finder.refuse_unknown_columns()
    if len(problems) > before:
        return None
    found = FoundColumns(
        joints,
        commanded,
        {joint: place for joint, place in directions.items() if place},
        targets,
        {name: place for name, place in single.items() if place},
        payload,
    )
    finder.refuse_shared_columns(found)
    return found if len(problems) == before else None


@dataclass(frozen=True)
class _Finder:
    table: RawTable
    layout: Layout
    problems: list[Problem]

    def any(self, name: str, units: Mapping[str, float], mapped_unit: str) -> Place | None:
        """The column of ``name``, if there is one; in two units it has to say the same twice."""
        if name in self.layout.columns:
            foreign = self.layout.columns[name]
            # A mapped column that is not there is named once, by refuse_unknown_columns.
            return Place(foreign, units[mapped_unit]) if foreign in self.table.columns else None
        present = columns_of_quantity(self.table, name, units)
        if len(present) > 1 and not self._alike(present, units):
            names = " or ".join(each.column for each in present)
            self._problem(names, "is given in two units that do not say the same")
        return present[0] if present else None

    def _alike(self, places: list[Place], units: Mapping[str, float]) -> bool:
        """Whether columns of one quantity say the same, but for rounding."""
        first, *others = (
            numbers(self.table, each.column, [], gaps=True) * each.factor for each in places
        )
        rounded = ROUNDED_RAD if units is ANGLE else ROUNDED_MM if units is LENGTH else 0.0
        return all(np.allclose(first, each, 0.0, rounded, equal_nan=True) for each in others)

    def required(self, name: str, units: Mapping[str, float], mapped_unit: str) -> Place | None:
        place = self.any(name, units, mapped_unit)
        if place is None and name not in self.layout.columns:
            fix = f"or map {name} in measurements.file.columns"
            self._problem(" or ".join(names_of(name, units)), "is missing", listed(self.table), fix)
        return place

    def group(self, names, prismatic, required: bool = False) -> tuple[Place, ...]:
        """Columns of all joints, or none of them where they are not ``required``."""
        places = []
        for name, slides in zip(names, prismatic, strict=True):
            units, unit = (
                (LENGTH, self.layout.length_unit) if slides else (ANGLE, self.layout.joint_unit)
            )
            look = self.required if required else self.any
            places.append(look(name, units, unit))
        if None in places and any(places):
            missing = [name for name, place in zip(names, places, strict=True) if place is None]
            if not required:
                self._problem(", ".join(missing), "is missing beside the other joints")
        if None in places:
            return ()
        return self._in_pulses(places) if self.layout.pulses_per_deg else tuple(places)

    def _in_pulses(self, places: list[Place]) -> tuple[Place, ...]:
        """The joints as pulses of their motors, each with its own number of them in a degree."""
        count = self.layout.pulses_per_deg or ()
        if len(count) != len(places) or 0.0 in count:
            what = f"{len(count)} numbers for {len(places)} joints" if 0.0 not in count else "a 0"
            allowed = "one number for each joint, none of them 0"
            self.problems.append(Problem("measurements.file.pulses_per_deg", what, allowed))
            return tuple(places)
        return tuple(
            Place(place.column, ANGLE["deg"] / each)
            for place, each in zip(places, count, strict=True)
        )

    def targets(self) -> list[str]:
        """Names of the targets to read, in order of their columns.

        A point whose name leaves open whether it was measured is a problem, unless it is named.
        """
        if self.layout.targets is not None:
            return list(self.layout.targets)
        mapped = [split(name) for name in self.layout.columns]
        named = [target or TOOL for target, quantity in mapped if quantity == "x"]
        there = list(dict.fromkeys(self._points()))
        says = {name: column_names.role(name_of(f"{name} x").words) for name in there}
        letters = [n for n in there if len(n) == 1 and says[n] == column_names.PLAIN]
        read = [n for n in there if says[n] in _READ or n in named or (letters and len(n) == 1)]
        frames = [n for n in there if n not in read and column_names.is_frame(name_of(n).words)]
        if not read and not named and len(frames) == 1:
            read = frames  # the tool centre point, under its usual name
        unclear = [n for n in there if n not in read and says[n] == column_names.OPEN]
        if unclear or (there and not read and not named):
            self._unclear(unclear or there, read)
        return list(dict.fromkeys([*read, *named])) or [TOOL]

    def _points(self) -> Iterator[str]:
        """Names of the points whose columns have our names."""
        for column in self.table.columns:
            if column in ("x_mm", "x_m"):
                yield TOOL
            match = _POINT.fullmatch(column)
            if match and split(match["name"])[1] == "x":
                yield split(match["name"])[0]

    def _unclear(self, names: list[str], read: list[str]) -> None:
        columns = [c for c in self.table.columns for n in names if c in (f"{n}_x_mm", f"{n}_x_m")]
        said = [column_names.role(name_of(column).words) for column in columns]
        told = ", ".join("open" if each == column_names.OPEN else each for each in said)
        named = ", ".join(dict.fromkeys([*read, *names]))
        self._problem(
            ", ".join(columns),
            f"the name does not say that this was measured ({told})",
            "measured points",
            f"name those that were measured in measurements.file.targets (of: {named})",
        )

    def target(self, name: str, alone: bool) -> Target:
        """Columns of a target; ``alone`` it must have an orientation, where there is a kind."""
        bare = name == TOOL and ("x" in self.layout.columns or not self._has_prefix(TOOL))
        prefix = "" if bare else f"{name}_"
        length, angle = self.layout.length_unit, self.layout.angle_unit
        position = [self.required(f"{prefix}{axis}", LENGTH, length) for axis in POSITION]
        covariance = self._all(prefix, COVARIANCE, AREA, f"{length}2")
        std = self._all(prefix, STD, LENGTH, length)
        if std and covariance:
            where = ", ".join(place.column for place in (*std, *covariance))
            self._problem(where, "standard deviations and a covariance", "one of them")
        return Target(
            name,
            tuple(place for place in position if place),
            self._turn(prefix, alone),
            std,
            self._all(prefix, STD_TURN, ANGLE, angle),
            covariance,
        )

    def _has_prefix(self, name: str) -> bool:
        return any(f"{name}_x{unit}" in self.table.columns for unit in ("_mm", "_m")) or (
            f"{name}_x" in self.layout.columns
        )

    def _turn(self, prefix: str, alone: bool) -> tuple[Place, ...]:
        kind = self.layout.orientation
        if kind == "none":
            return ()
        unit = self.layout.angle_unit
        if kind == "quaternion":
            ordered = self._all(prefix, QUATERNION_IN_ORDER, PURE, "")
            if ordered:
                return tuple(ordered[self.layout.order.index(part)] for part in "wxyz")
            names, units, unit = QUATERNION, PURE, ""
        else:
            names, units = ANGLES, ANGLE
            ordered = self._all(prefix, ANGLES_IN_ORDER, ANGLE, unit) if kind == "euler" else ()
            if ordered:
                return ordered
            if kind == "euler":
                names = in_order_of(self.layout.convention)
        # A single target must have its orientation; one of several may be a bare point.
        look = self.required if alone else self.any
        own = [f"{prefix}{name}" for name in names]
        places = [self.any(name, units, unit) for name in own]
        if look == self.required and not any(places) and not set(own) & set(self.layout.columns):
            self._problem(", ".join(own), "are missing: the file states no orientation",
                          listed(self.table), "set measurements.file.orientation.kind (none for "
                          "positions alone), or map them in measurements.file.columns")  # fmt: skip
            return ()
        places = [look(name, units, unit) for name in own]
        if None in places and any(places) and look == self.any:
            missing = [f"{prefix}{n}" for n, p in zip(names, places, strict=True) if p is None]
            self._problem(", ".join(missing), "is missing beside the rest of the orientation")
        return () if None in places else tuple(places)

    def _all(self, prefix: str, names, units, unit) -> tuple[Place, ...]:
        """Columns of all ``names``; none where none is there, a problem where only some are."""
        places = [self.any(f"{prefix}{name}", units, unit) for name in names]
        missing = [f"{prefix}{n}" for n, p in zip(names, places, strict=True) if p is None]
        if not missing:
            return tuple(places)
        if len(missing) < len(places):
            self._problem(", ".join(missing), "is missing beside " + _with(names, missing, prefix))
        return ()

    def payload(self) -> tuple[Place, ...]:
        """Columns of mass and centre of what is carried; none where the file does not say."""
        mass = self.any(PAYLOAD[0], MASS, "kg")
        centre = self._all("", PAYLOAD[1:], LENGTH, self.layout.length_unit)
        if centre and not mass:
            self._problem("payload_kg", "is missing beside the centre of the payload")
        return (mass, *centre) if mass else ()

    def refuse_spare_joint(self, joints: int) -> None:
        spare = f"q{joints + 1}"
        if spare in self.layout.columns or any(
            f"{spare}_{unit}" in self.table.columns for unit in (*ANGLE, *LENGTH)
        ):
            self.problems.append(
                Problem(
                    f"{self.table.path}: columns",
                    f"{spare} is there, the robot has {joints} joints",
                )
            )

    def refuse_unknown_columns(self) -> None:
        for name, foreign in self.layout.columns.items():
            if foreign not in self.table.columns:
                what = f"is not there, but measurements.file.columns maps {name} to it"
                self._problem(foreign, what, listed(self.table))

    def refuse_shared_columns(self, found: FoundColumns) -> None:
        """A column that is taken for two measured quantities, as a slip in a mapping makes it."""
        measured = [*found.joints, *found.commanded, *found.directions.values()]
        measured += [place for target in found.targets for place in target.places()]
        measured += found.payload
        count = Counter(place.column for place in measured)
        for column in (each for each in count if count[each] > 1):
            mapped = [name for name, own in self.layout.columns.items() if own == column]
            what = f"is taken for {count[column]} quantities, {', '.join(mapped)} among them"
            self._problem(column, what, "one", "correct measurements.file.columns")

    def _problem(self, column: str, what: str, allowed: str = "", fix: str = "") -> None:
        self.problems.append(Problem(f"{self.table.path}: column {column}", what, allowed, fix))


def in_order_of(convention: str) -> tuple[str, ...]:
    """Names of an Euler convention's angles, first to last: rz, ry, rx for ZYX.

    A convention that repeats an axis (ZYZ) has its first, second and third angle as rx, ry, rz.
    """
    axes = convention.lower()
    return tuple(f"r{axis}" for axis in axes) if len(set(axes)) == 3 else ANGLES


def split(name: str) -> tuple[str, str]:
    """Target (may be empty) and quantity of a name such as std_x or mA_std_x; empty if neither."""
    if name in _TARGET_QUANTITIES:
        return "", name
    if name in PAYLOAD:
        return "", ""
    # The longest quantity counts: mA_std_x is no x of a target named mA_std.
    ends = [each for each in _TARGET_QUANTITIES if name.endswith(f"_{each}")]
    if not ends:
        return "", ""
    quantity = max(ends, key=len)
    return name[: -len(quantity) - 1], quantity


def _with(names, missing, prefix: str) -> str:
    return ", ".join(f"{prefix}{name}" for name in names if f"{prefix}{name}" not in missing)


def names_of(name: str, units: Mapping[str, float]) -> dict[str, float]:
    """Names of the columns a quantity may stand in, each with the factor of its unit."""
    return {f"{name}_{unit}" if unit else name: factor for unit, factor in units.items()}


def columns_of_quantity(table: RawTable, name: str, units: Mapping[str, float]) -> list[Place]:
    """The columns of a table that hold a quantity: one for every unit it is given in."""
    found = (Place(*each) for each in names_of(name, units).items())
    return [place for place in found if place.column in table.columns]


def listed(table: RawTable) -> str:
    """The columns a file has, in words."""
    return "the file has " + ", ".join(table.columns)
