"""FANUC LS listings: Cartesian and joint positions of /POS; frames by number from a frames file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinacc.deployment.programs.frame_files import frames_of
from kinacc.deployment.programs.orientation import FIXED, Convention
from kinacc.deployment.programs.record import (
    JOINTS,
    NUMBER,
    POSE,
    Language,
    Place,
    Position,
    Program,
    Reading,
    unused,
)

CONVENTION = Convention(FIXED)
_POSITION = re.compile(r"^[ \t]*P\[(\d+)(?:\s*:\s*\"[^\"]*\")?\]\s*\{(.*?)\}\s*;", re.M | re.S)
_GROUP = re.compile(r"GP(\d+)\s*:(.*?)(?=GP\d+\s*:|\Z)", re.S)
_NUMBERED = re.compile(r"U([FT])\s*:\s*(\w+)")
_CONFIG = re.compile(r"[CK]ONFIG\s*:\s*'\s*([NF])?\s*([LR])?\s*([UD])?\s*([TB])?\s*,?\s*([^']*)'")
_VALUE = re.compile(rf"\b([XYZWPR]|J\d|E\d)\s*=\s*({NUMBER})\s*(mm|deg)?")
_MOTION = re.compile(r"^\s*\d*\s*:\s*[JLCAS]\s+P(R?)\[.*", re.M)
_OFFSET = re.compile(r"(?i)\b(?:Tool_)?Offset\b|\bINC\b|\bSkip")
_CURRENT = "F"


def read(reading: Reading) -> Program:
    """Positions of a listing, group 1; other groups stay as they are."""
    (source,) = reading.sources
    frames = {**unused(), **frames_of(reading.frame_files, CONVENTION)}
    left = []
    for found in _MOTION.finditer(source.text):
        if found[1] or _OFFSET.search(found[0]):
            line = source.line(found.start() + len(found[0]) - len(found[0].lstrip()))
            left.append(f"{source.path.name}:{line}: {' '.join(found[0].split())}")
    start = source.text.find("/POS")
    positions = [
        position
        for found in _POSITION.finditer(source.text, max(start, 0))
        for group in _GROUP.finditer(source.text, found.start(2), found.end(2))
        if group[1] == "1"
        for position in _of_group(reading, found, group)
    ]
    return Program(reading.sources, tuple(positions), frames, tuple(left))


def _of_group(reading: Reading, found: re.Match, group: re.Match) -> list[Position]:
    source = reading.sources[0]
    values, places, units = {}, {}, {}
    for value in _VALUE.finditer(source.text, group.start(2), group.end(2)):
        values[value[1]], units[value[1]] = float(value[2]), value[3]
        places[value[1]] = Place(*value.span(2))
    number = dict(_NUMBERED.findall(group[2]))
    is_pose = "X" in values
    keys = list("XYZWPR") if is_pose else sorted(key for key in values if key[0] == "J")
    line = source.line(found.start(1))
    name = f"P[{found[1]}]"
    if not keys or not all(key in values for key in keys):
        return []
    external = tuple(value for key, value in values.items() if key[0] == "E")
    stated = _stated(_CONFIG.search(group[2])) if is_pose else None
    tool, base = number.get("T"), number.get("F")
    position = Position(
        name,
        0,
        line,
        POSE if is_pose else JOINTS,
        tuple(places[key] for key in keys),
        np.array([values[key] for key in keys]),
        (3,) * len(keys),
        None if tool == _CURRENT else tool,
        None if base == _CURRENT else base,
        stated,
        external,
    )
    if not is_pose and "mm" in units.values():
        position = replace(position, refused="a joint in mm: no arm of turning joints")
    return [position]


def _stated(config: re.Match | None) -> tuple[str | None, ...] | None:
    if config is None:
        return None
    turns = [int(turn) for turn in re.findall(r"-?\d+", config[5])][:3]
    turns = [f"J{axis} turn {turn}" for axis, turn in zip((1, 4, 6), turns, strict=False)]
    turns += [None] * (3 - len(turns))
    return (config[1], config[3], config[4], *turns)


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Wrist N or F, elbow U or D, front T or B, and turns of J1, J4 and J6."""
    is_ahead, is_above, is_positive = sides
    turns = [
        f"J{axis + 1} turn {int(np.floor((q_deg[axis] + 180.0) / 360.0))}" for axis in (0, 3, 5)
    ]
    return ("F" if is_positive else "N", "U" if is_above else "D", "T" if is_ahead else "B", *turns)


LANGUAGE = Language("FANUC LS", (".ls",), CONVENTION, read, posture, (), ("frames.yaml",))
