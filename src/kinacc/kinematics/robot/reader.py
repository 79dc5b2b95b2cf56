"""Reading values of a description: units from key names, every fault noted with its place."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from typing import Any

from kinacc.config.reading import Document
from kinacc.errors import Problem

LENGTH = {"mm": 1.0, "m": 1e3}
ANGLE = {"deg": math.pi / 180.0, "rad": 1.0}

_QUARTER = math.pi / 2.0
_LONGEST_M = 20.0  # no arm has a link this long, so it was meant in mm
_MOST_TURNS_RAD = 4.0 * math.pi
_LARGEST = 1e9  # of any number: beyond, nothing about an arm is meant, and products overflow
_SUGGESTIONS = 20


class Reader:
    """Takes values out of one document and collects problems; nothing here raises."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.problems: list[Problem] = []
        self._lines: list[int] = []

    def fault(
        self, path: Sequence[Any], what: str, allowed: str = "", fix: str = "", value: Any = None
    ) -> None:
        """Note a problem at a key path."""
        if value is not None:
            what = f"{shown(value)} {what}"
        self.problems.append(Problem(self._place(path), what, allowed, fix))
        self._lines.append(self._line(path))

    def in_order(self) -> list[Problem]:
        """The problems as they stand in the file."""
        order = sorted(range(len(self.problems)), key=self._lines.__getitem__)
        return [self.problems[number] for number in order]

    def _line(self, path: Sequence[Any]) -> int:
        """Line of a key path, or of the nearest table around it; 0 for the whole file."""
        known = tuple(path)
        while known and known not in self.document.lines:
            known = known[:-1]
        return self.document.lines.get(known, 0)

    def _place(self, path: Sequence[Any]) -> str:
        """File, line, table, joint (counted from 1) and key."""
        line = self._line(path)
        name = f"{self.document.name}:{line}" if line else self.document.name
        words = [f"joint {step + 1}" if isinstance(step, int) else str(step) for step in path]
        return ", ".join([name, *words])

    def known_keys(self, table: Mapping, allowed: Sequence[str], path: Sequence[Any] = ()) -> None:
        """Note keys of a table that are none of ``allowed``, with the nearest one that is."""
        unknown = [key for key in table if key not in allowed]
        for number, key in enumerate(unknown):
            near = _nearest(str(key), allowed) if number < _SUGGESTIONS else ""
            self.fault((*path, key), "unknown key", ", ".join(allowed), near)

    def number(self, value: Any, path: Sequence[Any], allowed: str = "a finite number") -> float:
        """A number an arm may have; NaN, with a problem, for anything else."""
        if is_number(value) and abs(value) <= _LARGEST:
            return float(value)
        if is_number(value):
            self.fault(path, "is beyond all arms", f"at most {_LARGEST:g}", value=value)
            return math.nan
        fix = ""
        if isinstance(value, str):
            try:
                fix = f"write {float(value.replace(',', '.')):g}, without quotes"
            except ValueError:
                fix = "write the number alone; the unit belongs to the key"
        self.fault(path, "is not a number", allowed, fix, value="null" if value is None else value)
        return math.nan

    def numbers(self, value: Any, count: int, path: Sequence[Any]) -> list[float]:
        """A list of ``count`` finite numbers; NaNs, with a problem, for anything else."""
        if not isinstance(value, list) or len(value) != count:
            self.fault(path, "has the wrong form", f"{count} numbers in brackets", value=value)
            return [math.nan] * count
        return [self.number(each, path, f"{count} numbers") for each in value]

    def unit_key(
        self, table: Mapping, stem: str, units: Mapping[str, float], path: Sequence[Any]
    ) -> str | None:
        """The key of a quantity, whose name ends in its unit; None where it is not given."""
        given = [f"{stem}_{unit}" for unit in units if f"{stem}_{unit}" in table]
        if len(given) > 1:
            self.fault((*path, given[1]), f"{stem} is given twice", f"one of {', '.join(given)}")
        return given[0] if given else None

    def quantity(
        self,
        table: Mapping,
        stem: str,
        units: Mapping[str, float],
        path: Sequence[Any],
        default: float | None = None,
    ) -> float:
        """A length in mm or an angle in rad; required where there is no ``default``."""
        key = self.unit_key(table, stem, units, path)
        if key is None:
            if default is None:
                names = " or ".join(f"{stem}_{unit}" for unit in units)
                self.fault(path, f"{stem} is missing", f"a number as {names}")
                return math.nan
            return default
        value = self.number(table[key], (*path, key))
        if math.isfinite(value):
            self._unit_mixed_up(value, key, (*path, key))
        return value * units[key.rpartition("_")[2]]

    def pair(
        self, value: Any, unit: str, path: Sequence[Any], factor: float
    ) -> tuple[float, float]:
        """Limits [lower, upper] in mm or rad."""
        allowed = f"[lower, upper] in {unit}"
        if not isinstance(value, list) or len(value) != 2:
            self.fault(path, "is not a pair", allowed, value="null" if value is None else value)
            return math.nan, math.nan
        low, high = (self.number(each, path, allowed) for each in value)
        if low >= high:
            fix = "put the smaller number first" if low > high else ""
            self.fault(path, "is reversed or empty", allowed, fix, value=value)
        whole = all(each == round(each) for each in (low, high) if math.isfinite(each))
        if unit == "rad" and max(abs(low), abs(high)) > _MOST_TURNS_RAD and whole:
            self.fault(path, "looks like degrees", allowed, "write limits_deg", value=value)
        return low * factor, high * factor

    def _unit_mixed_up(self, value: float, key: str, path: Sequence[Any]) -> None:
        """Numbers that make sense in another unit only."""
        stem, _, unit = key.rpartition("_")
        quarters = value / _QUARTER
        near = round(quarters)
        if unit == "deg" and near and abs(near) <= 4 and abs(value - near * _QUARTER) < 2e-3:
            fix = f"write {stem}_rad, or {near * 90} as {key}"
            self.fault(path, f"is {near} quarter turns in rad", "degrees", fix, value=value)
        elif unit == "rad" and abs(value) > 2.0 * math.pi + 1e-3:
            self.fault(path, "is more than a turn", "rad", f"write {stem}_deg", value=value)
        elif unit == "m" and abs(value) > _LONGEST_M:
            self.fault(path, "is longer than any arm", "m", f"write {stem}_mm", value=value)


def is_number(value: Any) -> bool:
    """Whether a value is a finite number (and not true or false)."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and abs(value) < math.inf  # isfinite fails for a whole number without a float


def shown(value: Any) -> str:
    """A value as it stands in the file, shortened."""
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, int) and abs(value) > _LARGEST:
        return f"{float(value):.9g}" if abs(value) < 1e300 else "a number of more than 300 digits"
    text = value if value == "null" else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _nearest(name: str, known: Sequence[str]) -> str:
    """What to write instead of an unknown key; empty where nothing is like it."""
    units = (*ANGLE, *LENGTH)
    head, _, unit = name.rpartition("_")
    stem = head if unit in units else name
    measured = [each for each in known if each.rpartition("_")[2] in units]
    same = [each for each in measured if each.rpartition("_")[0] == stem]
    if same:
        return f"the unit is part of the name: {' or '.join(same)}"
    # To compare words takes their lengths multiplied.
    close = difflib.get_close_matches(name[:100].lower(), known, n=1, cutoff=0.55)
    return f"did you mean {close[0]}?" if close else ""
