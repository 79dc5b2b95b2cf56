"""FANUC LS listings: Cartesian and joint positions of /POS; frames by number from a frames file."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kinacc.deployment.programs.orientation import FIXED, Convention
from kinacc.deployment.programs.record import (
    NO_FRAMES,
    NUMBER,
    Frames,
    Language,
    Position,
    Program,
    Source,
)

_POSITION = re.compile(
    r"^[ \t]*(P\[\d+)[^\]{]*\]\s*\{\s*GP1\s*:(.*?)(?=GP\d+\s*:|\}\s*;)", re.M | re.S
)
_NUMBERED = re.compile(r"U([FT])\s*:\s*(\w+)")
_CONFIG = re.compile(r"[CK]ONFIG\s*:\s*'\s*([NF])?\s*[LR]?\s*([UD])?\s*([TB])?\s*,?\s*([^']*)'")
_VALUE = re.compile(rf"\b([XYZWPR]|[JE]\d)\s*=\s*({NUMBER})\s*(mm)?")
_MOTION = re.compile(r"^\s*\d*\s*:\s*[JLCAS]\s+P(R?)\[.*", re.M)
_OFFSET = re.compile(r"\b(?:Tool_)?Offset\b|\bINC\b|\bSkip", re.I)


def read(sources: Sequence[Source], frames: Frames, _: np.ndarray | None) -> Program:
    """Positions of a listing, group 1; other groups stay as they are."""
    (source,) = sources
    computed = [
        f"{source.where(result.end())}: {' '.join(result[0].split())}"
        for result in _MOTION.finditer(source.text)
        if result[1] or _OFFSET.search(result[0])
    ]
    start = max(source.text.find("/POS"), 0)
    result = (_position(source, item) for item in _POSITION.finditer(source.text, start))
    return Program(sources, [item for item in result if item], {**NO_FRAMES, **frames}, computed)


def _position(source: Source, found: re.Match) -> Position | None:
    values = {item[1]: item for item in _VALUE.finditer(source.text, *found.span(2))}
    number = dict(_NUMBERED.findall(found[2]))
    frames = {"tool": number.get("T"), "base": number.get("F")}
    frames = {kind: None if name == "F" else name for kind, name in frames.items()}  # in force
    moves = any(float(item[2]) for key, item in values.items() if key[0] == "E")
    is_pose = "X" in values
    keys = list("XYZWPR") if is_pose else sorted(key for key in values if key[0] == "J")
    if not keys or not set(keys) <= set(values):
        return None
    slides = not is_pose and any(values[key][3] for key in keys)
    return Position(
        found[1] + "]",
        source,
        [values[key].span(2) for key in keys],
        3,
        None if is_pose else 1.0,
        **frames,
        posture=_stated(_CONFIG.search(found[2])) if is_pose else None,
        moves_outside=moves,
        refused="has a joint in mm" if slides else "",
    )


def _stated(config: re.Match | None) -> tuple[str | None, ...] | None:
    if config is None:
        return None
    turns = [*re.findall(r"-?\d+", config[4]), None, None, None][:3]
    named = zip((1, 4, 6), turns, strict=True)
    return (*config.groups()[:3], *(turn and f"J{axis} turn {int(turn)}" for axis, turn in named))


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Wrist N or F, elbow U or D, front T or B, and turns of J1, J4 and J6."""
    is_ahead, is_above, is_positive = sides
    turns = [f"J{axis} turn {int((q_deg[axis - 1] + 180.0) // 360.0)}" for axis in (1, 4, 6)]
    return ("F" if is_positive else "N", "U" if is_above else "D", "T" if is_ahead else "B", *turns)


LANGUAGE = Language(
    "FANUC LS", (".ls",), Convention(FIXED), read, posture=posture, frame_files=("frames.yaml",)
)
