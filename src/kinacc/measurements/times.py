"""Times of rows in seconds, and the offset between the clocks of two files."""

from __future__ import annotations

import re
from collections.abc import Collection

import numpy as np
import pandas as pd

from kinacc.errors import input_error
from kinacc.measurements.table import RawTable

_CLOCK = r"(?:(\S+)[ T])?(\d{1,2}:\d{2}:\d{2}(?:[.,]\d+)?) ?(?:Z|[+-]\d{2}:?\d{2})?"
# A spreadsheet has rounded them (2,02E+13), or shows them without hours or seconds.
_SPOILT = r"\d(?:[.,]\d+)?[eE]\+?\d+|\d{1,2}:\d{2}[.,]\d+|(?:\S+[ T])?\d{1,2}:\d{2}"
_DATES = ("%Y-%m-%d", "%d.%m.%Y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d.%m.%y")
# Numbers that can be no seconds of this century are milli-, micro- or nanoseconds.
_LATEST_S = 4.2e9
_UNITS = {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
_FEWEST = 4
_SHARE = 0.6  # of the points, that must fall where the arm stood still
_RIVAL = 0.85  # of the most points: another offset explains as much
_SHORTEST_S = 0.3  # of a standstill in a record that runs on
_MOST = 4_000_000
STILL_RAD = np.deg2rad(0.02)  # joints that move less stand still
_YEARS = (1990, 2100)  # of measurements; others are numbers that look like a day


def seconds(table: RawTable, column: str) -> np.ndarray:
    """Times (n,) in s from some zero. Raises InputError for what a spreadsheet has made of them."""
    fix = "export the times again, with hours and seconds, as text or as a number of seconds"
    texts = pd.Series(table.texts(column), dtype=object)
    if (bad := texts[texts.str.fullmatch(_SPOILT)]).size:
        message = f"times that are rounded, or without hours or seconds: {bad.iloc[0]}"
        raise input_error(table.where(column), message, fix=fix)
    values = table.values(column)
    if np.isfinite(values).any():
        units = [u for u in re.findall(r"[^\W\d_]+", column) if u in _UNITS]
        largest = np.nanmax(np.abs(values), initial=0.0)
        fit = next((f for f in (1.0, 1e-3, 1e-6) if largest * f < _LATEST_S), 1e-9)
        values = values * (_UNITS[units[0]] if units else fit)
    else:
        parts = texts.str.extract(f"^{_CLOCK}$")
        clock = pd.to_timedelta(parts[1].str.replace(",", "."), errors="coerce")
        values = clock.dt.total_seconds().to_numpy()
        dates = parts[0].dropna()
        if len(dates):
            spans = {tuple((days - days[0]).days) for days in _dates(dates.tolist())}
            of_row = np.full(len(texts), np.nan)
            if len(spans) == 1:
                of_row[dates.index] = spans.pop()
            values = values + of_row * 86400.0
    if np.unique(values[np.isfinite(values)]).size < 2:
        message = f"holds no times that differ, or dates of several readings: {texts[0]}"
        raise input_error(table.where(column), message, "2026-03-01 12:30:05.2", fix)
    return values


def _dates(texts: Collection[str]) -> list[pd.DatetimeIndex]:
    """Dates by every form in which all of them are dates of measurements."""
    forms = [pd.to_datetime([*texts], format=form, errors="coerce") for form in _DATES]
    return [f for f in forms if ((f.year >= _YEARS[0]) & (f.year <= _YEARS[1])).all()]


def offsets(points_s: np.ndarray, stands: np.ndarray, within_s: float) -> list[float]:
    """Seconds to add to times of points (n,) so that most fall into standstills (m, 2).

    The best first; behind it others that give other joints to as many points. Empty for none.
    """
    points_s = points_s[np.isfinite(points_s)]
    if min(len(points_s), len(stands)) < _FEWEST or len(points_s) * len(stands) > _MOST:
        return []
    starts, ends = np.sort((stands.T[:, None, :] - points_s[:, None]).reshape(2, -1))
    edges = np.unique(np.append(starts, ends))
    middle = 0.5 * (edges[1:] + edges[:-1])
    count = np.searchsorted(starts, middle) - np.searchsorted(ends, middle)
    if count.max() < max(_FEWEST, _SHARE * len(points_s)):
        return []

    def stand(offset: float) -> np.ndarray:
        place = np.searchsorted(stands[:, 0], points_s + offset, side="right") - 1
        return np.where((place >= 0) & (points_s + offset <= stands[place, 1]), place, -1)

    order = np.lexsort((-np.diff(edges), -count))
    best = [float(middle[order[0]])]
    joints = stand(best[0])
    for offset in middle[order[count[order] >= _RIVAL * count.max()]].tolist():
        theirs = stand(offset)
        both = (joints >= 0) & (theirs >= 0)
        apart = min(abs(offset - rival) for rival in best) > 2.0 * within_s
        if apart and np.sum((joints != theirs) & both) > 0.2 * max(both.sum(), 1):
            best.append(offset)
    return [round(offset, 3) for offset in best]


def standstills(time_s: np.ndarray, q_rad: np.ndarray) -> tuple[np.ndarray, float]:
    """Begin and end (m, 2) of every standstill, and how near in time joints belong to a point."""
    order = np.argsort(time_s, kind="stable")
    time, q = time_s[order], q_rad[order]
    moved = np.flatnonzero(np.abs(np.diff(q, axis=0)).max(axis=1, initial=0.0) > 0.5 * STILL_RAD)
    starts, ends = np.append(0, moved + 1), np.append(moved, len(time) - 1)
    runs, gaps = ends - starts + 1, np.diff(time)
    long = runs >= 3
    if 2 * long.sum() >= len(runs) or runs[long].sum() > 0.3 * len(time):
        long &= time[ends] - time[starts] >= _SHORTEST_S
        stands = np.stack([time[starts[long]], time[ends[long]]], axis=1)
        return stands, max(2.0 * float(np.median(gaps)), 0.05)
    within = 0.25 * float(np.min(gaps[gaps > 0.0], initial=np.inf))  # single rows, far apart
    return np.stack([time - within, time + within], axis=1), within
