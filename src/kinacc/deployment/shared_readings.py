"""Readings that two calibrations were both fitted to, which say nothing of a change."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kinacc.deployment.record import Calibration
from kinacc.errors import Problem
from kinacc.tables.allowed import SUBSETS

_COINCIDENCE = 0.01  # of the smaller set: equal digits of so few readings may be chance
_DIGITS = 6  # of mm; angles are held to as many and three more


class SharedReadings(NamedTuple):
    """How many readings the fits of two calibrations have in common, of those each is fitted to."""

    count: int
    first: int
    second: int

    @property
    def all_of_both(self) -> bool:
        """Whether both are fitted to the very same readings."""
        return 0 < self.count == self.first == self.second


NONE_SHARED = SharedReadings(0, 0, 0)


def shared(first: Mapping, second: Mapping, same_file: bool) -> SharedReadings:
    """Readings in both of two ``measurements`` tables, as far as they are fitted to.

    Readings are one where joints and reading agree to the last digits, or where they stand on the
    same line of ``same_file``, however that was read.
    """
    fitted = [np.asarray(each["subset"]) == SUBSETS[0] for each in (first, second)]
    tables = [_readings(each, rows) for each, rows in zip((first, second), fitted, strict=True)]
    counts = [len(each.values) for each in tables]
    common = _common(*(each.values for each in tables))
    if same_file:
        common = max(common, _common(*(each.places for each in tables)))
    common = 0 if common < _COINCIDENCE * min(counts) else common
    return SharedReadings(common, *counts)


def repeated(first: Mapping, second: Mapping) -> int:
    """How many readings of ``second`` the table ``first`` holds as well, whatever they are for.

    0 where so few agree to the last digits that it may be chance.
    """
    tables = [_readings(each, np.ones(len(each["subset"]), dtype=bool)) for each in (first, second)]
    common = _common(*(each.values for each in tables))
    return 0 if common < _COINCIDENCE * min(len(each.values) for each in tables) else common


def counted_once(
    first: Calibration, second: Calibration, readings: SharedReadings
) -> tuple[Calibration, Calibration]:
    """The calibrations with covariances whose sum is that of their difference.

    Estimates from common readings err together. With s of n1 and n2 readings in both, of equal
    information each, the difference has covariance (1 - s / n2) C1 + (1 - s / n1) C2.
    """
    if not readings.count:
        return first, second
    shares = 1.0 - readings.count / readings.second, 1.0 - readings.count / readings.first
    return _scaled(first, shares[0]), _scaled(second, shares[1])


def _scaled(calibration: Calibration, share: float) -> Calibration:
    if calibration.known is None:
        return calibration
    covariance = calibration.known.covariance * share
    return replace(calibration, known=replace(calibration.known, covariance=covariance))


class _Readings(NamedTuple):
    """Readings by their numbers, and by where they stand in their file."""

    values: list[tuple]
    places: list[tuple]


def _readings(table: Mapping, rows: np.ndarray) -> _Readings:
    joints = sum(name[0] == "q" and name[1:].isdecimal() for name in table)
    angles = [f"q{i + 1}" for i in range(joints)] + [f"q{part}" for part in "wxyz"]
    columns = [np.round(np.asarray(table[name], dtype=float), _DIGITS + 3) for name in angles]
    columns += [np.round(np.asarray(table[f"{axis}_mm"], dtype=float), _DIGITS) for axis in "xyz"]
    values = np.nan_to_num(np.stack(columns, axis=1)[rows], nan=np.inf)
    line = np.asarray(table.get("row", np.full(len(rows), np.nan)), dtype=float)[rows]
    pairs = zip(line.tolist(), np.asarray(table["target"])[rows].tolist(), strict=True)
    places = [(int(number), str(target)) for number, target in pairs if number == number]
    return _Readings([tuple(row) for row in values.tolist()], places)


def _common(first: list[tuple], second: list[tuple]) -> int:
    return (Counter(first) & Counter(second)).total()


def repeated_problems(path: str, own: Mapping, before: str, other: Mapping) -> list[Problem]:
    """That a file of a series holds readings of an earlier line: it says nothing new by them.

    A tracker's export that goes on holds the old readings among the new ones; the history would
    hold them against themselves.
    """
    count, rows = repeated(other, own), len(own["subset"])
    if not count:
        return []
    if count == rows:
        return [Problem(path, f"holds the readings of {before}, which is a line already",
                        "new readings")]  # fmt: skip
    what = f"{count} of its {rows} readings are those of {before}, which is a line already"
    fix = "leave those rows out of the file: a change would be held against readings before it"
    return [Problem(path, what, "new readings alone", fix)]
