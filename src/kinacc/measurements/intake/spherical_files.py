"""How a file of spherical readings counts its angles: by its names, by their size, else asked."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.spherical import PER_UNIT, Reading, refuse_units
from kinacc.measurements.table import RawTable, numbers
from kinacc.measurements.written import Directions

_TURN = {"deg": 360.0, "gon": 400.0, "rad": 2.0 * np.pi}
_SLACK = 1.002
_GRAD = re.compile(r"\bgra(d|de|ds|des)\b", re.IGNORECASE)


@dataclass(frozen=True)
class Way:
    """How the angles are counted, words on what was found, and on what was taken, by setting."""

    directions: Directions
    told: tuple[str, ...] = ()
    assumed: Mapping[str, str] = field(default_factory=dict)


def directions_of(
    table: RawTable, readings: Sequence[Reading], stated: str, answers: Mapping[str, str]
) -> Way:
    """How the angles of ``readings`` are counted; ``stated``: their unit, said above the rows.

    Raises Undecided where it is open, InputError where they state units that are not read.
    """
    refuse_units(readings, table.path)
    one = readings[0]
    horizontal = _values(table, [each.horizontal.column for each in readings])
    vertical = _values(table, [each.vertical.column for each in readings])
    units = sorted({unit for each in readings for unit in each.angle_units})
    if any(_GRAD.search(name) for each in readings for name in each.names[:2]):
        units = []  # grad is gon in one language and degrees in another
    told, choices = [], []
    unit = answers.get("direction_unit") or (units[0] if len(units) == 1 else stated)
    if unit not in PER_UNIT:
        unit = _by_size(horizontal)
        if unit:
            told.append(f"{one.horizontal.column} is in {unit}: it goes to {horizontal.max():.4g}")
        else:
            choices.append(_unit_choice(one, horizontal, vertical))
    quarter = _TURN[unit or "deg"] / 4.0
    counted = answers.get("vertical") or one.vertical_from
    if not counted and unit:
        counted = _counted_from(vertical, quarter)
    if counted:
        told.append(f"{one.vertical.column} is counted from the {counted}")
    elif unit:
        choices.append(_vertical_choice(one, vertical))
    if choices:
        raise Undecided(table.path, choices)
    turning = answers.get("horizontal") or ("clockwise" if one.is_geodetic else "counterclockwise")
    assumed = f"{one.horizontal.column} counts {turning}, seen from above"
    if "horizontal" in answers:
        return Way(Directions(unit, counted, turning), (*told, assumed))
    return Way(Directions(unit, counted, turning), tuple(told), {"horizontal": assumed})


def _values(table: RawTable, names: Sequence[str]) -> np.ndarray:
    values = np.concatenate([numbers(table, name, [], gaps=True) for name in names])
    return values[np.isfinite(values)] if np.isfinite(values).any() else np.zeros(1)


def _by_size(horizontal: np.ndarray) -> str:
    """The unit that the size of horizontal angles leaves, empty where it leaves several."""
    size = float(np.abs(horizontal).max())
    return "gon" if _TURN["deg"] * _SLACK < size <= _TURN["gon"] * _SLACK else ""


def _counted_from(vertical: np.ndarray, quarter: float) -> str:
    """The zenith where an angle is beyond a quarter, the horizon where one is below it."""
    if (vertical > quarter * _SLACK).any() and (vertical > 0.0).all():
        return "zenith"
    return "horizon" if (vertical < 0.0).any() and (np.abs(vertical) <= quarter).all() else ""


def _unit_choice(one: Reading, horizontal: np.ndarray, vertical: np.ndarray) -> Choice:
    size = max(float(np.abs(horizontal).max()), float(np.abs(vertical).max()))
    units = ["deg", "gon"] if size > _TURN["rad"] * _SLACK else ["rad", "deg", "gon"]
    first = float(horizontal[0])
    meant = {u: f"{first:g} is {np.rad2deg(first * PER_UNIT[u]):.4g} degrees" for u in units}
    columns = f"{one.horizontal.column} and {one.vertical.column}"
    return Choice("--direction-unit", f"{columns} state no unit of their angles", meant)


def _vertical_choice(one: Reading, vertical: np.ndarray) -> Choice:
    first = f"{vertical[0]:g}"
    meant = {
        "zenith": f"{first} is counted from straight up",
        "horizon": f"{first} is up from level",
    }
    about = f"{one.vertical.column} does not tell what it is counted from"
    return Choice("--vertical", about, meant)
