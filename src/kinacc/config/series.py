"""A series of one data set: measured files of one arm over time, each calibrated as a data set.

The arm's data set itself is its newest line, with everything a data set has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import date, datetime
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from kinacc.config.fields import Section, Text, refused, setting
from kinacc.config.names import LONGEST
from kinacc.config.reading import Place
from kinacc.config.values import shown
from kinacc.errors import Problem

SAME, MOVED = "same", "moved"
FLAGS = {
    "base": "the robot and the instrument stand to each other",
    "tool": "the tool or targets sit on the flange",
}
_DAY = "a day as 2026-03-01"


def day_of(value: Any) -> str | None:
    """A day as ISO text, of what YAML makes of it or of text; None for what is no day."""
    if isinstance(value, date) and not isinstance(value, datetime):
        return value.isoformat()
    try:
        return date.fromisoformat(value).isoformat() if value[4] == value[7] == "-" else None
    except (TypeError, ValueError, IndexError):
        return None


def _day(value: Any) -> str:
    day = day_of(value)
    if day is None:
        raise refused(f"{shown(value)} is no day")
    return day


class Line(Section):
    """One file of a series; whether base and tool moved is since the line before it by date."""

    path: Text = setting(..., "measured file, relative to the folder of the file this stands in")
    date: Annotated[str, BeforeValidator(_day)] = setting(..., "day it was measured", allowed=_DAY)
    base: Literal["same", "moved"] | None = setting(None, f"how {FLAGS['base']}; null in the first")
    tool: Literal["same", "moved"] | None = setting(None, f"how {FLAGS['tool']}; null in the first")


Series = Annotated[list[Line], Field(max_length=1000)]
KEYS = tuple(Line.model_fields)


def by_date(given: Sequence[Mapping[str, Any]]) -> list[tuple[int, Line]]:
    """Lines with their places in the configuration, in the order of their dates."""
    numbered = enumerate(map(Line.model_validate, given))
    return sorted(numbered, key=lambda each: each[1].date)


def of_each_other(found: Sequence[tuple[int, Line]], place: Place) -> Iterator[Problem]:
    """What is wrong with lines, ordered by date, beside one another."""
    for (_, before), (number, line) in pairwise(found):
        if line.date == before.date:
            what = f"{line.date} is the date of two lines"
            yield Problem(place(("series", number, "date")), what, "a day of its own for each")
        for name, how in FLAGS.items():
            if getattr(line, name) is None:
                what = f"does not say whether {how} as on {before.date}"
                yield Problem(
                    place(("series", number)), what, f"{name}: {SAME}, or {name}: {MOVED}"
                )
    paths = [line.path for _, line in found]
    for order, (number, line) in enumerate(found):
        if line.path in paths[:order]:
            what = f"{line.path} stands in two lines"
            yield Problem(place(("series", number, "path")), what, "every file once")


def contradicted(full: Mapping[str, Any], place: Callable[..., str]) -> Iterator[Problem]:
    """What of the full settings of a data set cannot stand beside a series."""
    measurements, file = full["measurements"], full["measurements"]["file"]
    if measurements["source"] != "file":
        what = f"{measurements['source']}, but a series is of measured files"
        yield Problem(place("measurements", "source"), what, "file")
    of_one_file = {("path",): file["path"], ("exclude",): file["exclude"]}
    for keys, given in (of_one_file | {("joints", "path"): file["joints"]["path"]}).items():
        if given:
            what = "is of one file, and the data set has a series of them"
            fix = "make the file a line of the series" if keys == ("path",) else ""
            yield Problem(place("measurements", "file", *keys), what, "not beside series", fix)


def taken(
    name: str, found: Mapping[str, Any], datasets: Mapping[Any, Any], place: Place
) -> Iterator[Problem]:
    """Names of data sets of lines that cannot be, or that another data set has."""
    names = [each for each in found if each != name]
    for each in names:
        if each in datasets:
            what = f"has the name of a line of the series of {name}"
            yield Problem(place(("datasets", each)), what, "another name")
    if any(len(each) > LONGEST for each in names):
        allowed = f"at most {LONGEST - len('-2026-03-01')} characters where there is a series"
        yield Problem(place(("datasets", name)), "has too long a name", allowed)


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

    if not found:
        return {name: dict(full)}
    lines = {f"{name}-{line.date}": line for line in found}
    first = dict.fromkeys(FLAGS)
    series = [
        {"name": each, **line.model_dump(exclude={"path"}), **(first if line is found[0] else {})}
        for each, line in lines.items()
    ]
    own = {each: {**of(line), "line_of": name, "gates": []} for each, line in lines.items()}
    return {name: {**of(found[-1]), "series": series}, **own}
