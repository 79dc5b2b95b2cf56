"""Readings as a horizontal angle, a vertical angle and a distance, turned into x, y and z.

Clockwise horizontal angles, as of theodolites, count from y to x: x is east and y north, z is up.
Counterclockwise ones, as of trackers in the mathematical sense, count from x to y.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.column_names import MEASURED, PLAIN, REPORTED, Name, name_of, role
from kinacc.measurements.table import RawTable, numbers
from kinacc.measurements.written import Directions

PER_UNIT = {"deg": np.pi / 180.0, "gon": np.pi / 200.0, "rad": 1.0}
_LENGTH = ("mm", "m")

_HORIZONTAL = """
hz az azimuth azimut horizontal horizontalwinkel horizontalrichtung hzwinkel hzangle richtung
horizontale orizzontale azimutal acimut hztheta
"""
_VERTICAL = """
v vz ze zenith zenit zenitdistanz zenitwinkel vertical vertikal vertikalwinkel elevation el
hoehenwinkel hohenwinkel polar vwinkel zenital zenitale verticale cenital elev
"""
_DISTANCE = """
d dist distance distanz sd slopedistance schraegstrecke schragstrecke schraegdistanz schragdistanz
strecke r rho range entfernung distancia distanza radius slope
"""
_FROM_HORIZON = frozenset(("elevation", "el", "elev", "hoehenwinkel", "hohenwinkel"))
_FROM_ZENITH = frozenset(
    ("ze", "zenith", "zenit", "zenitdistanz", "zenitwinkel", "zenital", "zenitale", "cenital")
)
_GEODETIC = frozenset(("hz", "horizontalrichtung", "horizontalwinkel", "hzwinkel"))
_PARTS = {
    **dict.fromkeys(_HORIZONTAL.split(), "horizontal"),
    **dict.fromkeys(_VERTICAL.split(), "vertical"),
    **dict.fromkeys(_DISTANCE.split(), "distance"),
}
_FILLING = frozenset(("angle", "winkel", "angolo", "angulo", "wert", "value", "slope"))


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

    @property
    def vertical_from(self) -> str:
        """What the name of the vertical angle says that it is counted from, empty for nothing."""
        words = set(self.vertical.words)
        return "horizon" if words & _FROM_HORIZON else "zenith" if words & _FROM_ZENITH else ""

    @property
    def is_geodetic(self) -> bool:
        """Whether the name of the horizontal angle is that of a theodolite."""
        return bool(set(self.horizontal.words) & _GEODETIC)


def readings_of(names: Sequence[Name]) -> list[Reading]:
    """Spherical readings among columns; none where one names x, y and z, or a part is missing."""
    words = {word for name in names for word in name.words}
    if set("xyz") <= words:
        return []
    parts: dict[tuple[str, ...], dict[str, Name]] = {}
    for name in names:
        whole = "".join(name.spelled).lower()  # Az is no acceleration along z here
        own = (whole,) if whole in _PARTS else name.words
        said = [_PARTS[word] for word in own if word in _PARTS and word not in _FILLING]
        said = said or [_PARTS[word] for word in own if word in _PARTS]
        if len(set(said)) == 1:
            rest = tuple(w for w in own if w not in _PARTS and w not in _FILLING)
            parts.setdefault(rest, {}).setdefault(said[0], name)
    return [
        Reading(**found, rest=rest)
        for rest, found in parts.items()
        if len(found) == 3 and role(rest) in (PLAIN, MEASURED, REPORTED)
    ]


def cartesian(table: RawTable, directions: Directions) -> RawTable:
    """The table with x, y, z for the three columns of every target.

    Raises InputError where there are none, or a cell of them is no number.
    """
    units = table.under if len(table.under) == len(table.columns) else ("",) * len(table.columns)
    names = [name_of(column, unit) for column, unit in zip(table.columns, units, strict=True)]
    found = readings_of(names)
    problems: list[Problem] = []
    if not found:
        what = "has no columns of a horizontal angle, a vertical angle and a distance"
        problems.append(Problem(table.path, what, "such as Hz, V and D"))
    columns: dict[str, list] = {}
    under: list[str] = []
    gone = {name: each for each in found for name in each.names}
    for column, unit in zip(table.columns, units, strict=True):
        if column not in gone:
            columns[column] = table.columns[column]
            under.append(unit)
        elif column == gone[column].horizontal.column:
            each = gone[column]
            said = each.angle_units - {directions.unit}
            if said and "grad" not in column.lower():
                what = f"says {' and '.join(sorted(said))}, the configuration {directions.unit}"
                fix = "correct measurements.file.directions.unit"
                problems.append(Problem(f"{table.path}: column {column}", what, fix=fix))
            point = _point(table, each, directions, problems)
            own = point_names(each)
            columns |= {name: _cells(axis) for name, axis in zip(own, point.T, strict=True)}
            under += [""] * 3
    refuse(problems, f"{table.path} cannot be read")
    letters = {} if not table.letters else dict.fromkeys(columns, "") | dict(table.letters)
    return replace(
        table, columns=columns, under=tuple(under) if table.under else (), letters=letters
    )


def point_names(reading: Reading) -> tuple[str, ...]:
    """Names of the columns x, y, z that a reading becomes."""
    stem = "_".join(reading.rest)
    unit = f"_{reading.distance.unit}" if reading.distance.unit in _LENGTH else ""
    return tuple(f"{stem}_{axis}{unit}" if stem else f"{axis}{unit}" for axis in "xyz")


def _cells(values: np.ndarray) -> list:
    return [None if value != value else value for value in values.tolist()]


def _point(
    table: RawTable, reading: Reading, directions: Directions, problems: list[Problem]
) -> np.ndarray:
    """Points (n, 3) in the unit of the distance, NaN where one of the three is missing."""
    columns = [numbers(table, name, problems, gaps=True) for name in reading.names]
    horizontal, vertical, distance = columns
    distance = np.where(distance > 0.0, distance, np.nan)  # 0: nothing was read
    factor = PER_UNIT[directions.unit]
    above = vertical * factor
    above = np.pi / 2.0 - above if directions.vertical == "zenith" else above
    level, up = np.cos(above) * distance, np.sin(above) * distance
    turn = horizontal * factor
    along, across = np.cos(turn) * level, np.sin(turn) * level
    if directions.horizontal == "clockwise":
        along, across = across, along
    return np.stack([along, across, up], axis=1)


def unread_distance(reading: Reading, path: str) -> Problem | None:
    """What is wrong with the unit its distance states."""
    unit = reading.distance.unit
    if unit in ("", *_LENGTH):
        return None
    return Problem(f"{path}: column {reading.distance.column}", f"is in {unit}", "mm or m")


def refuse_units(found: Sequence[Reading], path: str) -> None:
    """Raise InputError where readings state units that are not read."""
    problems = [wrong for each in found if (wrong := unread_distance(each, path))]
    for each in found:
        if each.angle_units - set(PER_UNIT):
            where = f"{path}: columns {each.horizontal.column}, {each.vertical.column}"
            what = f"are in {' and '.join(sorted(each.angle_units))}"
            problems.append(Problem(where, what, ", ".join(PER_UNIT)))
    if problems:
        raise InputError(problems, f"{path} cannot be described")
