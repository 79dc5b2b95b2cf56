"""Times of rows in seconds, where they are good enough to tell one pose from the next; days."""

from __future__ import annotations

import re
from collections.abc import Collection
from datetime import datetime

import numpy as np
import pandas as pd

from kinacc.errors import Problem
from kinacc.measurements.table import RawTable

_CLOCK = r"(?:(\S+)[ T])?(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?) ?(?:Z|[+-]\d{2}:?\d{2})?"
_SPOILT = {
    r"\d(?:[.,]\d+)?[eE]\+?\d+": "a spreadsheet has rounded these times",
    r"\d{1,2}:\d{2}[.,]\d+": "times without hours",  # 07:41.5, as shown of 10:07:41.5
    r"(?:\S+[ T])?\d{1,2}:\d{2}": "times without seconds",
}
_DATES = ("%Y-%m-%d", "%d.%m.%Y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d.%m.%y")
# Numbers that can be no seconds of this century are milli-, micro- or nanoseconds.
_LATEST_S = 4.2e9
_OWN_UNITS = {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
_DAY = re.compile(r"(\d{1,4}[-./]\d{1,2}[-./]\d{2,4})(?:[T ].*)?")
_YEARS = (1990, 2100)  # of measurements; others are numbers that look like a day


def seconds(table: RawTable, column: str, problems: list[Problem]) -> np.ndarray:
    """Times (n,) in s from some zero; what a spreadsheet has made of them is a problem."""
    fix = "export the times again, with hours and seconds, as text or as a number of seconds"
    texts = pd.Series(table.texts(column), dtype=object)
    for spoilt, what in _SPOILT.items():
        if (bad := texts[texts.str.fullmatch(spoilt)]).size:
            problems.append(Problem(table.where(column), f"{what}: {bad.iloc[0]}", fix=fix))
            return np.full(len(table), np.nan)
    values = table.values(column)
    if np.isfinite(values).any():
        units = [u for u in re.findall(r"[^\W\d_]+", column) if u in _OWN_UNITS]
        largest = np.nanmax(np.abs(values), initial=0.0)
        factors = (1.0, 1e-3, 1e-6, 1e-9)
        fit = next((f for f in factors if largest * f < _LATEST_S), 1e-9)
        values = values * (_OWN_UNITS[units[0]] if units else fit)
    else:
        values = _of_clock(texts)
    if np.unique(values[np.isfinite(values)]).size < 2:
        what = f"holds no times that differ, or dates that can be read in two ways: {texts[0]}"
        problems.append(Problem(table.where(column), what, "2026-03-01 12:30:05.2", fix))
    return values


def _of_clock(texts: pd.Series) -> np.ndarray:
    """Times of the day (n,), of days where there are dates, in s; NaN where they are none."""
    parts = texts.str.extract(f"^{_CLOCK}$")
    clock = parts[[1, 2, 3]].replace(",", ".", regex=True).astype(float)
    values = (clock * [3600.0, 60.0, 1.0]).sum(axis=1, skipna=False).to_numpy()
    dates = parts[0].dropna()
    if dates.empty:
        return values
    spans = {tuple((each - each[0]).days) for each in _read(dates.tolist())}
    days = np.full(len(texts), np.nan)
    if len(spans) == 1:
        days[dates.index] = spans.pop()
    return values + days * 86400.0


def _read(words: Collection[str]) -> list[pd.DatetimeIndex]:
    """Dates by every form in which all of them are dates of measurements."""
    found = [pd.to_datetime(list(words), format=form, errors="coerce") for form in _DATES]
    return [f for f in found if ((f.year >= _YEARS[0]) & (f.year <= _YEARS[1])).all()]


def days(table: RawTable) -> list[str]:
    """Days (ISO) that the columns of dates of a file hold, from the first to the last.

    None where no column holds dates alone, or where they can be read as those of other days.
    """
    found: set[str] = set()
    for column in table.columns:
        cells = [c for c in table.columns[column] if str(c).strip()]
        stated = {c.date().isoformat() for c in cells if isinstance(c, datetime)}
        words = [_DAY.fullmatch(str(c).strip()) for c in cells if not isinstance(c, datetime)]
        if not all(words):
            continue
        ways = {
            tuple(sorted({*each.strftime("%Y-%m-%d")})) for each in _read([w[1] for w in words])
        }
        if not words or len(ways) == 1:
            found |= stated.union(*ways)
    return sorted(found)
