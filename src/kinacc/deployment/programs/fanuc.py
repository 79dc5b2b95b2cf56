"""FANUC LS listings: Cartesian and joint positions of /POS; frames by number from a frames file."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kinacc.deployment.programs.orientation import FIXED, Convention
from kinacc.deployment.programs.record import (
    NUMBER,
    Language,
    Position,
    Program,
    Source,
)

CONVENTION = Convention(FIXED)
_POSITION = re.compile(
    r"^[ \t]*(P\[\d+)[^\]{]*\]\s*\{\s*GP1\s*:(.*?)(?=GP\d+\s*:|\}\s*;)", re.M | re.S
)
_NUMBERED = re.compile(r"U([FT])\s*:\s*(\d+)")  # UF : F is the one in force
_CONFIG = re.compile(r"[CK]ONFIG\s*:\s*'\s*([NF])?\s*[LR]?\s*([UD])?\s*([TB])?\s*,?\s*([^']*)'")
_VALUE = re.compile(rf"\b([XYZWPR]|[JE]\d)\s*=\s*({NUMBER})\s*(mm)?")
_MOTION = re.compile(r"^\s*\d*\s*:\s*[JLCAS]\s+P(R?)\[.*", re.M)
_OFFSET = re.compile(r"\b(?:Tool_)?Offset\b|\bINC\b|\bSkip", re.I)


def read(sources: Sequence[Source], _: np.ndarray | None) -> Program:
    """Positions of a listing, group 1; other groups stay as they are."""
    (source,) = sources
    computed = [
        source.statement(motion.end(), motion[0])
        for motion in _MOTION.finditer(source.text)
        if motion[1] or _OFFSET.search(motion[0])
    ]
    start = max(source.text.find("/POS"), 0)
    positions = []
    for match in _POSITION.finditer(source.text, start):
        if position := _position(source, match):
            positions.append(position)
        else:
            computed.append(source.statement(match.start(1), f"{match[1]}]"))
    return Program(sources, positions, CONVENTION, computed)


def _position(source: Source, match: re.Match[str]) -> Position | None:
    values = {value[1]: value for value in _VALUE.finditer(source.text, *match.span(2))}
    numbered, config = dict(_NUMBERED.findall(match[2])), _CONFIG.search(match[2])
    is_pose = "X" in values
    keys = list("XYZWPR") if is_pose else sorted(key for key in values if key[0] == "J")
    if not keys or not set(keys) <= set(values):
        return None
    slides = not is_pose and any(values[key][3] for key in keys)
    return Position(
        f"{match[1]}]",
        source,
        [values[key].span(2) for key in keys],
        3,
        None if is_pose else 1.0,
        numbered.get("T"),
        numbered.get("F"),
        _stated(config) if config and is_pose else (),
        moves_outside=any(float(value[2]) for key, value in values.items() if key[0] == "E"),
        refused="has a joint in mm" if slides else "",
    )


def _stated(config: re.Match[str]) -> tuple[str | None, ...]:
    turns = zip((1, 4, 6), re.findall(r"-?\d+", config[4]), strict=False)
    return (*config.groups()[:3], *(f"J{axis} turn {int(turn)}" for axis, turn in turns))


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Wrist N or F, elbow U or D, front T or B, and turns of J1, J4 and J6."""
    turns = [f"J{axis} turn {int((q_deg[axis - 1] + 180.0) // 360.0)}" for axis in (1, 4, 6)]
    is_ahead, is_above, is_positive = map(int, sides)
    return ("NF"[is_positive], "DU"[is_above], "BT"[is_ahead], *turns)


LANGUAGE = Language(
    "FANUC LS",
    (".ls",),
    CONVENTION,
    read,
    posture=posture,
    frame_files=("frames.yaml",),
)
