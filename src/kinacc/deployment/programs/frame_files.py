"""Tools and bases by number: a YAML file, or Yaskawa's TOOL.CND and UFRAME.CND."""

from __future__ import annotations

import re
from collections.abc import Iterable

import yaml

from kinacc.deployment.programs.orientation import Convention
from kinacc.deployment.programs.record import (
    BASE,
    TOOL,
    Source,
    numbers_in,
    values_at,
)
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose

_CND = re.compile(r"^//(TOOL|UFRAME)\s+(\d+)(.*?)(?=^//(?!/)|\Z)", re.M | re.S)
_TOOL_ROW = re.compile(r"^[-+.\d][^\r\n/]*", re.M)
_USER_ROW = re.compile(r"^/{3,4}BUSER\s+([^\r\n]*)", re.M)


def frames_of(sources: Iterable[Source], convention: Convention) -> dict[tuple[str, str], Pose]:
    """Frames by kind and number of all files.

    The YAML file: ``tools: {1: [six numbers]}``, ``bases: {1: [..]}`` in mm and degrees.
    """
    frames: dict[tuple[str, str], Pose] = {}
    for source in sources:
        if source.path.suffix.lower() == ".cnd":
            frames.update(_of_conditions(source, convention))
        else:
            frames.update(_of_yaml(source, convention))
    return frames


def _of_yaml(source: Source, convention: Convention) -> dict[tuple[str, str], Pose]:
    where = str(source.path)
    try:
        content = yaml.safe_load(source.text)
        return {
            (kind, str(number)): convention.typed(numbers)
            for kind, key in ((TOOL, "tools"), (BASE, "bases"))
            for number, numbers in (content.get(key) or {}).items()
            if len(numbers) >= 6
        }
    except (yaml.YAMLError, AttributeError, TypeError, ValueError):
        allowed = "tools: {1: [six numbers]}, bases: {1: [six numbers]}"
        raise InputError(Problem(where, "is no file of frames", allowed)) from None


def _of_conditions(source: Source, convention: Convention) -> dict[tuple[str, str], Pose]:
    frames = {}
    for block in _CND.finditer(source.text):
        is_tool = block[1] == "TOOL"
        row = (_TOOL_ROW if is_tool else _USER_ROW).search(block[3])
        if row is None:
            continue
        text = row[0] if is_tool else row[1]
        values = values_at(text, numbers_in(text, 0, len(text)))
        if len(values) >= 6:
            kind = TOOL if is_tool else BASE
            frames[kind, str(int(block[2]))] = convention.pose(values[:6])
    return frames
