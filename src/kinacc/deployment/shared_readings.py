"""Readings that a table holds already: they show no change and are not compared with themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinacc.deployment.record import Calibration
from kinacc.tables.allowed import SUBSETS

_COINCIDENCE = 0.01  # of the smaller table: equal digits of so few readings may be chance
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


def known_rows(table: Mapping, earlier: Mapping) -> np.ndarray:
    """True (n,) for rows of a table ``measurements`` that an ``earlier`` one holds as well.

    Joints and position agree to the last digits; nowhere where so few do that it may be chance.
    """
    if not len(earlier):
        return np.zeros(len(table["x_mm"]), dtype=bool)
    joints = [name for name in table if name[0] == "q" and name[1:].isdecimal()]
    names = (joints, ["x_mm", "y_mm", "z_mm"])
    own, other = (
        [np.stack([np.asarray(each[name], dtype=float) for name in part], axis=1) for part in names]
        for each in (table, earlier)
    )
    return known_readings(own, other)


def known_readings(own: Sequence[np.ndarray], earlier: Sequence[np.ndarray]) -> np.ndarray:
    """The same (n,) of joints (n, k) and positions (n, 3) mm, and those of an earlier series."""
    one, other = (
        pd.MultiIndex.from_arrays(
            np.hstack([joints.round(_DIGITS + 3), position_mm.round(_DIGITS)]).T + 0.0
        )
        for joints, position_mm in (own, earlier)
    )
    found = one.isin(other)
    return found & (found.sum() >= _COINCIDENCE * min(len(one), len(other)))


def shared(first: Mapping, second: Mapping, same_file: bool) -> SharedReadings:
    """Readings in both of two ``measurements`` tables, as far as they are fitted to.

    Readings are one where joints and position agree to the last digits, or where they stand on the
    same line of ``same_file``, however that was read.
    """
    fitted = []
    for each in (first, second):
        rows = np.asarray(each["subset"]) == SUBSETS[0]
        fitted.append({name: np.asarray(values)[rows] for name, values in each.items()})
    count = int(known_rows(*fitted).sum())
    if same_file and all("row" in each for each in fitted):
        lines = [pd.DataFrame({name: each[name] for name in ("row", "target")}) for each in fitted]
        count = max(count, len(lines[0].dropna().merge(lines[1].dropna())))
    return SharedReadings(count, *(len(each["subset"]) for each in fitted))


def counted_once(
    first: Calibration, second: Calibration, readings: SharedReadings
) -> tuple[Calibration, Calibration]:
    """The calibrations with covariances whose sum is that of their difference.

    Estimates from common readings err together. With s of n1 and n2 readings in both, of equal
    information each, the difference has covariance (1 - s / n2) C1 + (1 - s / n1) C2.
    """

    def scaled(calibration: Calibration, fitted: int) -> Calibration:
        known = calibration.known
        if known is None or not readings.count:
            return calibration
        covariance = known.covariance * (1.0 - readings.count / fitted)
        return replace(calibration, known=replace(known, covariance=covariance))

    return scaled(first, readings.second), scaled(second, readings.first)
