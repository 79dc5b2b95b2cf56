"""A series of one data set: measured files of one arm over time, each calibrated as a data set.

The arm's data set itself is its newest line, with everything a data set has.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date, datetime
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from kinacc.config.fields import Section, Text, refused, setting

SAME, MOVED = "same", "moved"
FLAGS = {
    "base": "the robot and the instrument stand to each other",
    "tool": "the tool or targets sit on the flange",
}


def day_of(value: Any) -> str | None:
    """A day as ISO text, of what YAML makes of it or of text; None for what is no day."""
    if isinstance(value, date) and not isinstance(value, datetime):
        return value.isoformat()
    try:
        return date.fromisoformat(value).isoformat() if value[4] == value[7] == "-" else None
    except (TypeError, ValueError, IndexError):
        return None


def _day(value: Any) -> str:
    if (day := day_of(value)) is None:
        raise refused(f"{str(value)[:60]!r} is no day", "write a day as 2026-03-01")
    return day


class Line(Section):
    """One file of a series; whether base and tool moved is since the line before it by date."""

    path: Text = setting(..., "measured file, relative to the folder of the file this stands in")
    date: Annotated[str, BeforeValidator(_day)] = setting(
        ..., "day it was measured", allowed="a day as 2026-03-01"
    )
    base: Literal["same", "moved"] | None = setting(None, f"how {FLAGS['base']}; null in the first")
    tool: Literal["same", "moved"] | None = setting(None, f"how {FLAGS['tool']}; null in the first")


def _of_each_other(lines: list[Line]) -> list[Line]:
    """Lines by date. Raises where a line contradicts one before it, or leaves open what moved."""
    ordered = sorted(lines, key=lambda line: line.date)
    paths = [line.path for line in ordered]
    for before, line in pairwise(ordered):
        number = lines.index(line)
        if line.date == before.date:
            raise refused(f"{line.date} is the date of two lines", "", number, "date")
        for name, how in FLAGS.items():
            if getattr(line, name) is None:
                what = f"does not say whether {how} as on {before.date}"
                raise refused(what, f"write {name}: {SAME}, or {name}: {MOVED}", number)
        if paths.count(line.path) > 1:
            raise refused(f"{line.path} stands in two lines", "write every file once", number)
    return ordered


Series = Annotated[list[Line], Field(max_length=1000), AfterValidator(_of_each_other)]


def expanded(name: str, full: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Full settings of the data set ``name``, its newest line, and of the data set of each line.

    The first has its lines under ``series``, without their paths; those of lines have the name of
    the first under ``line_of``, and no gates: these are about the arm as it is now.
    """
    rest = {key: value for key, value in full.items() if key != "series"}
    measurements = rest["measurements"]
    if not full["series"]:
        return {name: rest}
    found: dict[str, dict[str, Any]] = {}
    series: list[dict[str, Any]] = []
    for line in full["series"]:
        own = f"{name}-{line['date']}"
        file = {**measurements["file"], "path": line["path"]}
        found[own] = {**rest, "measurements": {**measurements, "file": file}}
        flags = {flag: line[flag] if series else None for flag in FLAGS}
        series.append({"name": own, "date": line["date"], **flags})
    newest = {**found[series[-1]["name"]], "series": series}
    return {name: newest} | {
        each: {**own, "line_of": name, "gates": []} for each, own in found.items()
    }
