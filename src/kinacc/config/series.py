"""A series of one data set: measured files of one arm over time, each calibrated as a data set.

The arm's data set itself is its newest line, with everything a data set has.
"""

from __future__ import annotations

import datetime
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationInfo

from kinacc.config.fields import Section, Text, is_there, refused, setting
from kinacc.config.records import Settings
from kinacc.config.values import overlay

SAME, MOVED = "same", "moved"
FLAGS = {
    "base": "the robot and the instrument stand to each other",
    "tool": "the tool or targets sit on the flange",
}
Moved = Literal["same", "moved"] | None


def _existing(path: str, info: ValidationInfo) -> str:
    if not is_there(path, info):
        raise refused(f"{path!r} does not exist")
    return path


class Line(Section):
    """One file of a series; whether base and tool moved is since the line before it by date."""

    path: Annotated[Text, AfterValidator(_existing)] = setting(
        ..., "measured file, relative to the folder of the file this stands in"
    )
    date: Annotated[datetime.date, Field(strict=False)] = setting(
        ..., "day it was measured", allowed="a day as 2026-03-01"
    )
    base: Moved = setting(None, f"how {FLAGS['base']}; null in the first")
    tool: Moved = setting(None, f"how {FLAGS['tool']}; null in the first")


def _of_each_other(lines: list[Line]) -> list[Line]:
    """Lines by date. Raises where a line contradicts one before it, or leaves open what moved."""
    ordered = sorted(lines, key=lambda line: line.date)
    paths = [line.path for line in ordered]
    for before, line in pairwise(ordered):
        message = ""
        if line.date == before.date:
            message = f"{line.date} is the date of two lines"
        elif missing := [name for name in FLAGS if getattr(line, name) is None]:
            how = FLAGS[missing[0]]
            message = f"does not say whether {how} as on {before.date}: {missing[0]}: same or moved"
        elif paths.count(line.path) > 1:
            message = f"{line.path} stands in two lines"
        if message:
            raise refused(message, "", lines.index(line))
    return ordered


Series = Annotated[list[Line], Field(max_length=1000), AfterValidator(_of_each_other)]


def expanded(name: str, full: Settings) -> dict[str, dict[str, Any]]:
    """Full settings of the data set ``name``, its newest line, and of the data set of each line.

    The first has its lines under ``series``, without their paths; those of lines have the name of
    the first under ``line_of``, and no gates: these are about the arm as it is now.
    """
    rest = {key: value for key, value in full.items() if key != "series"}
    if not full["series"]:
        return {name: rest}
    lines = {f"{name}-{line['date']}": line for line in full["series"]}
    first, last = min(lines), max(lines)  # named by their dates
    files = {
        item: overlay(rest, {"measurements": {"file": {"path": line["path"]}}})
        for item, line in lines.items()
    }
    series = [
        {"name": item, "date": str(line["date"])}
        | {flag: None if item == first else line[flag] for flag in FLAGS}
        for item, line in lines.items()
    ]
    newest = {name: {**files[last], "series": series}}
    return newest | {
        item: {**settings, "line_of": name, "gates": []} for item, settings in files.items()
    }
