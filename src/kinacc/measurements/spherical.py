"""Readings as a horizontal angle, a vertical angle and a distance, turned into x, y and z.

Clockwise horizontal angles, as of theodolites, count from y to x: x is east and y north, z is up.
Counterclockwise ones, as of trackers in the mathematical sense, count from x to y.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinacc.config.measured import Directions
from kinacc.errors import Problem, input_error, refuse
from kinacc.measurements.column_names import MEASURED, PLAIN, REPORTED, WORDS, Name, role
from kinacc.measurements.intake.choices import Answers, Choice, Undecided
from kinacc.measurements.intake.columns import names_in
from kinacc.measurements.layout import LENGTH
from kinacc.measurements.table import RawTable, numbers

PER_UNIT = {"deg": np.pi / 180.0, "gon": np.pi / 200.0, "rad": 1.0}
_WORDS = WORDS["spherical"]
_PARTS = {w: part for part in ("horizontal", "vertical", "distance") for w in _WORDS[part]}


@dataclass(frozen=True)
class Reading:
    """The three columns of a target and the words their names share beside (its name)."""

    horizontal: Name
    vertical: Name
    distance: Name
    rest: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The three names in the file."""
        return self.horizontal.column, self.vertical.column, self.distance.column

    @property
    def angle_units(self) -> set[str]:
        """Units its angles state."""
        return {self.horizontal.unit, self.vertical.unit} - {""}


def readings_of(names: Sequence[Name]) -> list[Reading]:
    """Spherical readings among columns; none where one names x, y and z, or a part is missing."""
    if {*"xyz"} <= {term for name in names for term in name.terms}:
        return []
    parts: dict[tuple[str, ...], dict[str, Name]] = {}
    for name in names:
        whole = "".join(name.spelled).lower()  # Az is no acceleration along z here
        terms = (whole,) if whole in _PARTS else name.terms
        rest = tuple(t for t in terms if t not in _PARTS and t not in _WORDS["filling"])
        of_part = [t for t in terms if t in _PARTS]
        of_part = [t for t in of_part if t not in _WORDS["filling"]] or of_part
        if len(part := {_PARTS[term] for term in of_part}) == 1:
            parts.setdefault(rest, {}).setdefault(part.pop(), name)
    return [
        Reading(**columns, rest=rest)
        for rest, columns in parts.items()
        if len(columns) == 3 and role(rest) in (PLAIN, MEASURED, REPORTED)
    ]


def directions_of(
    table: RawTable, readings: Sequence[Reading], stated: str, answers: Answers
) -> Directions:
    """How the angles of readings are counted; ``stated``: their unit, above the rows.

    Raises Undecided where it is open, InputError where they state units that are not read.
    """
    first, units = readings[0], set[str]().union(*(reading.angle_units for reading in readings))
    lengths = {reading.distance.unit for reading in readings} - {"", *LENGTH}
    if wrong := sorted(units - {*PER_UNIT} | lengths):
        where = f"{table.path}: columns {', '.join(n for r in readings for n in r.names)}"
        allowed = ", ".join((*PER_UNIT, *LENGTH))
        raise input_error(where, f"are in {' and '.join(wrong)}", allowed)
    horizontal, vertical, _ = first.names
    if re.search(r"\bgra(d|de|ds|des)\b", f"{horizontal} {vertical}".lower()):
        units = set()  # grad is gon in one language and degrees in another
    unit = answers.get("direction_unit") or (units.pop() if len(units) == 1 else stated)
    choices = []
    if unit not in PER_UNIT:
        turn = table.values(horizontal)[0]
        meant = {u: f"{turn:g} is {np.rad2deg(turn * PER_UNIT[u]):.4g} degrees" for u in PER_UNIT}
        about = f"{horizontal} and {vertical} state no unit of angles"
        choices.append(Choice("--direction-unit", about, meant))
    values = table.values(vertical)
    quarter = 0.5 * np.pi / PER_UNIT.get(unit, PER_UNIT["deg"])
    low, high, terms = np.nanmin(values), np.nanmax(values), {*first.vertical.terms}
    zero = answers.get("vertical")
    zero = zero or next((name for name in ("horizon", "zenith") if terms & _WORDS[name]), "")
    if not zero and low > 0.0 and high > 1.002 * quarter:
        zero = "zenith"
    elif not zero and low < 0.0 and max(-low, high) <= quarter:
        zero = "horizon"
    if not zero:
        meant = {"zenith": "counted from straight up", "horizon": "up from level"}
        about = f"{vertical} may be counted from the zenith or from the horizon"
        choices.append(Choice("--vertical", about, meant))
    if choices:
        raise Undecided(table.path, *choices)
    is_geodetic = {*first.horizontal.terms} & _WORDS["theodolite"]
    turning = answers.get("horizontal") or ("clockwise" if is_geodetic else "counterclockwise")
    return Directions.model_construct(unit=unit, vertical=zero, horizontal=turning)


def cartesian(table: RawTable, directions: Directions) -> RawTable:
    """The table with x, y, z for the three columns of every target.

    Raises InputError where there are none, or a cell of them is no number.
    """
    readings = readings_of(names_in(table))
    if not readings:
        message = "has no columns of a horizontal angle, a vertical angle and a distance"
        raise input_error(table.path, message, "such as Hz, V and D")
    problems, per_unit = list[Problem](), PER_UNIT[directions.unit]
    cells = table.columns.drop(columns=[name for reading in readings for name in reading.names])
    for reading in readings:
        column, unit = reading.horizontal.column, reading.distance.unit
        stated = reading.angle_units - {directions.unit}
        if stated and "grad" not in column.lower():
            message = f"says {' and '.join(sorted(stated))}, the configuration {directions.unit}"
            fix = "correct measurements.file.directions.unit"
            problems.append(Problem(table.where(column), message, fix=fix))
        turn, vertical, distance = (numbers(table, n, problems, gaps=True) for n in reading.names)
        distance = np.where(distance > 0.0, distance, np.nan)  # 0: nothing was read
        turn, above = turn * per_unit, vertical * per_unit
        above = np.pi / 2.0 - above if directions.vertical == "zenith" else above
        level = np.cos(above) * distance
        point = {"x": np.cos(turn) * level, "y": np.sin(turn) * level}
        if directions.horizontal == "clockwise":
            point = {"x": point["y"], "y": point["x"]}
        for axis, values in {**point, "z": np.sin(above) * distance}.items():
            cells["_".join([*reading.rest, axis, *([unit] if unit in LENGTH else [])])] = values
    refuse(problems, f"{table.path} cannot be read")
    return replace(table, columns=cells)
