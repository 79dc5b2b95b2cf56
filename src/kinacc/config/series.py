"""A series of one data set: measured files of one arm over time, each calibrated as a data set.

The arm's data set itself is its newest line, with everything a data set has.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import date, datetime
from itertools import pairwise
from typing import Any

from kinacc.config.names import LONGEST
from kinacc.config.reading import KeyPath
from kinacc.config.values import Place, nearest, shown
from kinacc.errors import Problem, first_few

SAME, MOVED = "same", "moved"
FLAGS = {
    "base": "the robot and the instrument stand to each other",
    "tool": "the tool or targets sit on the flange",
}
KEYS = ("path", "date", *FLAGS)
MOST = 1_000
_DAY = re.compile(r"\d{4}-\d{2}-\d{2}")
_DAYS = "a day as 2026-03-01"
# Settings that speak of one file by its lines or name, and of which every line would have its own.
_OF_ONE_FILE = (("path",), ("joints", "path"), ("exclude",))


@dataclass(frozen=True)
class Line:
    """One file of a series: ``date`` is ISO, ``number`` its place in the configuration, from 0.

    ``base`` and ``tool`` are ``same`` or ``moved`` since the line before it by date; None in the
    first.
    """

    path: str
    date: str
    base: str | None
    tool: str | None
    number: int

    def dataset(self, name: str) -> str:
        """Name of the data set of this line of the series ``name``."""
        return f"{name}-{self.date}"


def lines(value: Any, path: KeyPath, place: Place) -> tuple[list[Line], list[Problem]]:
    """The lines in the order of their dates, and everything wrong with them."""
    if not isinstance(value, list) or not 0 < len(value) <= MOST:
        what = f"{shown(value)} is not a list" if not isinstance(value, list) else ""
        what = what or ("has no line" if not value else f"has {len(value)} lines")
        allowed = f"1 to {MOST} lines such as {{path: march.csv, date: 2026-03-01}}"
        return [], [Problem(place(path), what, allowed)]
    found: list[Line] = []
    problems: list[Problem] = []
    for number, each in enumerate(value):
        here = (*path, number)
        if not isinstance(each, Mapping):
            what = f"{shown(each)} is not a line of a series"
            allowed = "{path: march.csv, date: 2026-03-01, base: same, tool: same}"
            problems.append(Problem(place(here), what, allowed))
            continue
        wrong = list(_wrong(each, here, place))
        problems += wrong
        day = day_of(each.get("date"))
        if day is not None and not wrong:
            found.append(Line(each["path"], day, each.get("base"), each.get("tool"), number))
    found.sort(key=lambda line: line.date)
    if not problems:
        problems += _of_each_other(found, path, place)
    if found:
        first = found[0]
        found[0] = Line(first.path, first.date, None, None, first.number)
    return found, problems


def _wrong(each: Mapping[Any, Any], here: KeyPath, place: Place) -> Iterator[Problem]:
    """What is wrong with one line by itself."""
    for name in each:
        if name not in KEYS:
            close = nearest(name, KEYS)
            fix = f"did you mean {close}?" if close else ""
            yield Problem(place((*here, name)), f"unknown key {shown(name)}", ", ".join(KEYS), fix)
    if not isinstance(each.get("path"), str) or not each["path"]:
        given = f"{shown(each['path'])} is not the path of a file" if "path" in each else ""
        yield Problem(place((*here, "path")), given or "names no file", "path: march.csv")
    if "date" not in each:
        yield Problem(place(here), "has no date", f"date: {_DAYS}, on which it was measured")
    elif day_of(each["date"]) is None:
        what = f"{shown(each['date'])} is no day"
        yield Problem(place((*here, "date")), what, _DAYS)
    for name in FLAGS:
        if each.get(name, SAME) not in (SAME, MOVED):
            what = f"{shown(each[name])} is neither {SAME} nor {MOVED}"
            yield Problem(place((*here, name)), what, f"{SAME}, {MOVED}")


def _of_each_other(found: Sequence[Line], path: KeyPath, place: Place) -> Iterator[Problem]:
    """What is wrong with lines, ordered by date, beside one another."""
    for before, line in pairwise(found):
        here = (*path, line.number)
        if line.date == before.date:
            what = f"{line.date} is the date of two lines"
            yield Problem(place((*here, "date")), what, "a day of its own for each")
        for name, how in FLAGS.items():
            if getattr(line, name) is None:
                what = f"does not say whether {how} as on {before.date}"
                yield Problem(place(here), what, f"{name}: {SAME}, or {name}: {MOVED}")
    for number, line in enumerate(found):
        if any(line.path == other.path for other in found[:number]):
            what = f"{line.path} stands in two lines"
            yield Problem(place((*path, line.number, "path")), what, "every file once")


def day_of(value: Any) -> str | None:
    """A day as ISO text, of what YAML makes of it or of text; None for what is no day."""
    if isinstance(value, date) and not isinstance(value, datetime):
        return value.isoformat()
    if not isinstance(value, str) or not _DAY.fullmatch(value):
        return None
    try:
        return date.fromisoformat(value).isoformat()
    except ValueError:
        return None


def contradicted(full: Mapping[str, Any], place: Callable[..., str]) -> Iterator[Problem]:
    """What of the full settings of a data set cannot stand beside a series."""
    measurements = full["measurements"]
    if measurements["source"] != "file":
        what = f"{measurements['source']}, but a series is of measured files"
        yield Problem(place("measurements", "source"), what, "file")
    for keys in _OF_ONE_FILE:
        given = measurements["file"]
        for key in keys:
            given = given[key]
        if given:
            what = "is of one file, and the data set has a series of them"
            fix = "make the file a line of the series" if keys == ("path",) else ""
            allowed = "not beside series"
            yield Problem(place("measurements", "file", *keys), what, allowed, fix)


def taken(
    name: str, found: Mapping[str, Any], datasets: Mapping[Any, Any], place: Place
) -> Iterator[Problem]:
    """Names of data sets of lines that cannot be, or that another data set has."""
    names = [each for each in found if each != name]
    both = [each for each in names if each in datasets]
    for each in both:
        what = f"has the name of a line of the series of {name}"
        yield Problem(place(("datasets", each)), what, "another name")
    long = [each for each in names if len(each) > LONGEST]
    if long:
        what = f"{first_few(long, 1)} cannot be the name of a data set"
        allowed = f"at most {LONGEST - len('-2026-03-01')} characters where there is a series"
        yield Problem(place(("datasets", name)), what, allowed)


def expanded(
    name: str, full: Mapping[str, Any], found: Sequence[Line]
) -> dict[str, dict[str, Any]]:
    """Full settings of the data set ``name``, its newest line, and of the data set of each line.

    The first has its lines under ``series``, without their paths; those of lines have the name of
    the first under ``line_of``, and no gates: these are about the arm as it is now.
    """

    def of(line: Line) -> dict[str, Any]:
        file = {**full["measurements"]["file"], "path": line.path}
        return {**full, "measurements": {**full["measurements"], "file": file}}

    told = ("date", *FLAGS)
    series = [
        {"name": line.dataset(name), **{key: asdict(line)[key] for key in told}} for line in found
    ]
    own = {line.dataset(name): {**of(line), "line_of": name, "gates": []} for line in found}
    return {name: {**of(found[-1]), "series": series}, **own}
