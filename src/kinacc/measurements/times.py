"""Times of rows in seconds, where they are good enough to tell one pose from the next; days."""

from __future__ import annotations

import re
from datetime import datetime, timedelta

import numpy as np

from kinacc.errors import Problem
from kinacc.measurements.table import RawTable

_CLOCK = re.compile(
    r"(?:(?P<date>\S+)[ T])?(?P<h>\d{1,2}):(?P<m>\d{2})(?::(?P<s>\d{2}(?:[.,]\d+)?))?"
)
_NO_HOUR = re.compile(r"\d{1,2}:\d{2}[.,]\d+")  # 07:41.5, as spreadsheets show 10:07:41.5
_ROUNDED = re.compile(r"\d(?:[.,]\d+)?E\+?\d+", re.IGNORECASE)
_DATES = ("%Y-%m-%d", "%d.%m.%Y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%d.%m.%y")
_ZONE = re.compile(r"(?:Z|[+-]\d{2}:?\d{2})$")
# Numbers that can be no seconds of this century are milli-, micro- or nanoseconds.
_LATEST_S = 4.2e9
_OWN_UNITS = (("ms", 1e-3), ("us", 1e-6), ("µs", 1e-6), ("μs", 1e-6), ("ns", 1e-9))
_DAY = re.compile(r"(\d{1,4}[-./]\d{1,2}[-./]\d{2,4})(?:[T ].*)?")
_YEARS = (1990, 2100)  # of measurements; others are numbers that look like a day
_FIX = "export the times again, with hours and seconds, as text or as a number of seconds"


def seconds(table: RawTable, column: str, problems: list[Problem]) -> np.ndarray:
    """Times (n,) in s from some zero; what a spreadsheet has made of them is a problem."""
    cells = table.columns[column]
    where = f"{table.path}: column {column}"
    texts = [each if isinstance(each, datetime) else str(each).strip() for each in cells]
    written = [each for each in texts if isinstance(each, str) and each]
    if any(_ROUNDED.fullmatch(each) for each in written):
        what = f"a spreadsheet has rounded these times: {written[0]}"
        problems.append(Problem(where, what, "times that tell the rows apart", _FIX))
    elif any(_NO_HOUR.fullmatch(each) for each in written):
        shown = next(each for each in written if _NO_HOUR.fullmatch(each))
        problems.append(Problem(where, f"times without hours: {shown}", fix=_FIX))
    elif any((found := _CLOCK.fullmatch(each)) and not found["s"] for each in written):
        problems.append(Problem(where, f"times without seconds: {written[0]}", fix=_FIX))
    else:
        values = _numbers(texts, column, table.decimal)
        values = _dated(texts, where, problems) if values is None else values
        if np.unique(values[np.isfinite(values)]).size > 1:
            return values
        if not problems:
            problems.append(Problem(where, "holds no times that differ", fix=_FIX))
    return np.full(len(cells), np.nan)


def days(table: RawTable) -> list[str]:
    """Days (ISO) that the columns of dates of a file hold, from the first to the last.

    None where no column holds dates alone, or where they can be read as those of other days.
    """
    found: set[str] = set()
    for cells in table.columns.values():
        texts = [each if isinstance(each, datetime) else str(each).strip() for each in cells]
        found |= _days({each for each in texts if each})
    return sorted(found)


def _days(cells: set) -> set[str]:
    """Days (ISO) of the cells of a column of dates; none where it is none, or ambiguous."""
    read = {each if isinstance(each, datetime) else _DAY.fullmatch(each) for each in cells}
    if None in read:
        return set()
    stated = {each.date().isoformat() for each in read if isinstance(each, datetime)}
    words = {each[1] for each in read if not isinstance(each, datetime)}
    readings = []
    for form in _DATES if words else ():
        try:
            given = [datetime.strptime(each, form) for each in words]
        except ValueError:
            continue
        if all(_YEARS[0] <= each.year <= _YEARS[1] for each in given):
            readings.append({each.date().isoformat() for each in given})
    if words and (not readings or any(each != readings[0] for each in readings)):
        return set()
    return stated.union(*readings[:1])


def _numbers(cells: list, column: str, decimal: str) -> np.ndarray | None:
    """Times that are numbers, in s; None where they are none."""
    try:
        values = np.array([float(str(each).replace(decimal, ".")) for each in cells])
    except ValueError:
        return None
    stated = re.findall(r"[^\W\d_]+", column)
    for unit, factor in _OWN_UNITS:
        if unit in stated:
            return values * factor
    largest = np.nanmax(np.abs(values), initial=0.0)
    factors = (1.0, 1e-3, 1e-6, 1e-9)
    return values * next((f for f in factors if largest * f < _LATEST_S), 1e-9)


def _dated(cells: list, where: str, problems: list[Problem]) -> np.ndarray:
    """Times of the day, of days where there are dates, in s."""
    nothing = np.full(len(cells), np.nan)
    found = [
        each if isinstance(each, datetime) else _CLOCK.fullmatch(_ZONE.sub("", each).rstrip())
        for each in cells
    ]
    parts = zip(cells, found, strict=True)
    wrong = [c for c, f in parts if c and (not f or (isinstance(f, re.Match) and not f["s"]))]
    if wrong:
        problems.append(Problem(where, f"no time: {wrong[0]}", "hh:mm:ss, with a date or without"))
        return nothing
    days = [f["date"] for f in found if isinstance(f, re.Match) and f["date"]]
    spans = {}
    for form in _DATES:
        try:
            starts = [datetime.strptime(day, form) for day in days]
        except ValueError:
            continue
        spans[form] = tuple(each - starts[0] for each in starts)
    if days and len(set(spans.values())) != 1:
        what = f"dates in a form that {'is not known' if not spans else 'can be read in two ways'}"
        problems.append(Problem(where, f"{what}: {days[0]}", "2026-03-01 12:30:05.2"))
        return nothing
    form = next(iter(spans), "")
    return np.array([_second(each, form) for each in found])


def _second(found, form: str) -> float:
    if found is None:
        return np.nan
    if isinstance(found, datetime):
        return (found.replace(tzinfo=None) - datetime(2000, 1, 1)) / timedelta(seconds=1)
    day = 0.0
    if found["date"]:
        day = (datetime.strptime(found["date"], form) - datetime(2000, 1, 1)).days * 86400.0
    second = float(found["s"].replace(",", "."))
    return day + 3600.0 * int(found["h"]) + 60.0 * int(found["m"]) + second
