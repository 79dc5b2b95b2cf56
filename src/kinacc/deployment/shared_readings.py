"""Readings that two tables share: these show no change, and are not compared with themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from kinacc.deployment.record import Calibration
from kinacc.tables.allowed import SUBSETS
from kinacc.tables.columns import Columns

_COINCIDENCE = 0.01  # of the smaller table: fewer equal readings may be chance
_DIGITS = 6  # of mm; angles have three more


@dataclass(frozen=True)
class SharedReadings:
    """Number of readings that two fits share, and of those each is fitted to."""

    count: int
    first: int
    second: int

    @property
    def all_of_both(self) -> bool:
        """Whether both are fitted to the same readings."""
        return 0 < self.count == self.first == self.second


NONE_SHARED = SharedReadings(0, 0, 0)


def known_rows(table: Columns | pd.DataFrame, earlier: Columns | pd.DataFrame) -> np.ndarray:
    """True (n,) for rows of a table ``measurements`` that an ``earlier`` one holds as well.

    Joints and position agree to the last digits; nowhere where so few do that it may be chance.
    """
    if not len(earlier):
        return np.zeros(len(table["x_mm"]), dtype=bool)
    joints = [name for name in table if name[0] == "q" and name[1:].isdecimal()]
    both = [
        [item[part].to_numpy(float) for part in (joints, ["x_mm", "y_mm", "z_mm"])]
        for item in map(pd.DataFrame, (table, earlier))
    ]
    return known_readings(*both)


def known_readings(readings: Sequence[np.ndarray], earlier: Sequence[np.ndarray]) -> np.ndarray:
    """The same of joints (n, k) and positions (n, 3) mm, and those of an earlier series."""
    index, index_before = (
        pd.MultiIndex.from_arrays(
            np.hstack([joints.round(_DIGITS + 3), position_mm.round(_DIGITS)]).T + 0.0
        )
        for joints, position_mm in (readings, earlier)
    )
    known = index.isin(index_before)
    return known & (known.sum() >= _COINCIDENCE * min(len(index), len(index_before)))


def shared(first: Columns | None, second: Columns | None) -> SharedReadings:
    """Readings in both of two tables ``measurements``, of those that are fitted to."""
    if first is None or second is None:
        return NONE_SHARED
    tables = map(pd.DataFrame, (first, second))
    fitted = [table[table["subset"] == SUBSETS[0]] for table in tables]
    count = int(known_rows(*fitted).sum())
    return SharedReadings(count, *map(len, fitted))


def counted_once(
    first: Calibration, second: Calibration, readings: SharedReadings
) -> tuple[Calibration, Calibration]:
    """The calibrations with covariances whose sum is the covariance of their difference.

    With s of n1 and n2 readings in both, of equal information each, the difference has the
    covariance (1 - s / n2) C1 + (1 - s / n1) C2.
    """

    def scaled(calibration: Calibration, fitted: int) -> Calibration:
        known = calibration.known
        if known is None or not readings.count:
            return calibration
        covariance = known.covariance * (1.0 - readings.count / fitted)
        return replace(calibration, known=replace(known, covariance=covariance))

    return scaled(first, readings.second), scaled(second, readings.first)
