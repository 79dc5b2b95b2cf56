"""Yaskawa JBI jobs: positions in pulses and Cartesian; frames of TOOL.CND and UFRAME.CND."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np

from kinacc.deployment.programs.orientation import FIXED, Convention
from kinacc.deployment.programs.record import (
    BASE,
    ROBOT,
    TOOL,
    Frames,
    Language,
    Place,
    Position,
    Program,
    Source,
)
from kinacc.errors import input_error

CONVENTION = Convention(FIXED)
_POSITION = re.compile(r"^(B?C|B?P|E[CX])(\d+)\s*=(.*)|^///(\w+)(.*)", re.M)
_BLOCK = re.compile(r"^//(TOOL|UFRAME)\s+(\d+)(.*?)(?=^//(?!/)|\Z)", re.M | re.S)
_ROW = re.compile(r"^(?:/{3,4}BUSER\s+)?[-+.\d][^\r\n/]*", re.M)
_INSTRUCTION = re.compile(r"^\s*(S?MOV[JLCS]\b)?(IMOV\b|SFTON\b|CNVRT\b|MULMAT\b|SETE\b)?.*", re.M)
_SIDES = (
    ("flip", "no flip"),
    ("upper arm", "lower arm"),
    ("front", "rear"),
    ("R < 180", "R >= 180"),
    ("T < 180", "T >= 180"),
    ("S < 180", "S >= 180"),
)


def frames_of(source: Source) -> Frames:
    """Tools of TOOL.CND, user frames of UFRAME.CND."""
    frames = {}
    for block in _BLOCK.finditer(source.text):
        row = _ROW.search(source.text, *block.span(3))
        places = source.numbers(*row.span()) if row else []
        if len(places) >= 6:
            kind = TOOL if block[1] == "TOOL" else BASE
            frames[kind, str(int(block[2]))] = CONVENTION.pose(source.values(places[:6]))
    return frames


def read(sources: Sequence[Source], pulses: np.ndarray | None) -> Program:
    """Positions of a job; those of base and station axes, and shifts, stay as they are."""
    (source,) = sources
    end = source.text.find("//INST") % (len(source.text) + 1)
    reached: set[int] = set()
    shifts: set[int] = set()
    computed, moving, positions = [], set(), []
    for line in _INSTRUCTION.finditer(source.text, end):
        numbers = map(int, re.findall(r"\bP(\d+)\b", line[0]))
        (reached if line[1] else shifts).update(numbers)
        if line[2]:
            computed.append(source.statement(line.end(), line[0]))
    state: dict[str, str] = {}
    for line in _POSITION.finditer(source.text, 0, end):
        kind, name, places = line[1], line[2], source.numbers(*line.span(3))
        if line[4]:
            state[line[4]] = line[5].strip()
            if line[4] in ("PULSE", "RECTAN"):
                state["unit"] = line[4]
        elif kind[0] in "BE":
            moving |= {name} if source.values(places).any() else set()
        elif kind == "C" or int(name) in reached - shifts:
            positions.append((kind, name, places, dict(state)))
    read = [
        _position(source, kind + name, places, state, pulses, name in moving)
        for kind, name, places, state in positions
    ]
    return Program(sources, read, CONVENTION, computed)


def _position(
    source: Source,
    name: str,
    places: list[Place],
    state: dict[str, str],
    pulses: np.ndarray | None,
    moves: bool,
) -> Position:
    if state.get("unit") != "RECTAN":
        if pulses is None:
            fix = "give --pulses-per-deg, one number an axis (S, L, U, R, B, T)"
            raise input_error(str(source.path), "positions are in pulses", fix=fix)
        return Position(name, source, places[: len(pulses)], 0, pulses)
    reference, rconf = state.get("POSTYPE", "").upper(), state.get("RCONF")
    known = reference in ("USER", "ROBOT", "BASE")
    return Position(
        name,
        source,
        places[:6],
        (3, 3, 3, 4, 4, 4),
        tool=str(int(state.get("TOOL", "0").split(",")[0])),
        base=str(int(state.get("USER") or 0)) if reference == "USER" else ROBOT,
        posture=_named(map(int, rconf.split(","))) if rconf else (),
        moves_outside=moves or bool(source.values(places[6:]).any()),
        refused="" if known else f"is in the frame {reference or 'of its axes'}",
    )


def _named(bits: Iterable[int]) -> tuple[str, ...]:
    return tuple(pair[bit] for pair, bit in zip(_SIDES, bits, strict=False))


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Flip by the R axis, upper arm, front, and turns of R, T and S."""
    is_ahead, is_above, _ = sides
    r = (q_deg[3] + 180.0) % 360.0 - 180.0
    turned = [not -180.0 < q_deg[axis] <= 180.0 for axis in (3, 5, 0)]
    return _named([not -90.0 < r <= 90.0, not is_above, not is_ahead, *turned])


LANGUAGE = Language(
    "Yaskawa JBI",
    (".jbi",),
    CONVENTION,
    read,
    frames_of,
    posture,
    (),
    ("tool.cnd", "uframe.cnd"),
)
