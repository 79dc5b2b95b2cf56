"""KUKA KRL: a .src file and the .dat file beside it; frames of $config.dat."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kinacc.deployment.programs.orientation import KUKA, Convention
from kinacc.deployment.programs.record import (
    BASE,
    CHANGED,
    NO_FRAMES,
    NUMBER,
    SEVERAL,
    STILL,
    TOOL,
    Frames,
    Language,
    Place,
    Position,
    Program,
    Source,
    blanked,
)

CONVENTION = Convention(KUKA)
_FRAME, _AXES = list("XYZABC"), [f"A{number}" for number in range(1, 7)]
_AGGREGATE = re.compile(r"\{\s*(?:\w+\s*:)?([^{}]*)\}")
_PART = re.compile(rf"(\w+)(?:\[\])?\s+({NUMBER}|'[BH][0-9A-F]+'|[^,\s][^,]*)", re.I)
_MOTION = re.compile(r"\s*(S?PTP|S?LIN|S?CIRC|SPL)(_REL)?\b(.*)", re.I)
_ASSIGNED = re.compile(r"\s*(?:\w+\s+)*(\$?\w+(?:\s*\[\s*\d+\s*\])?)\s*=", re.I)
_DATA = re.compile(r"\s*(?:DECL\s+\w+\s+)?(TOOL|BASE)_DATA\s*\[\s*(\d+)\s*\]\s*=", re.I)
_SET = re.compile(
    r"BAS\s*\(\s*#(TOOL|BASE)\s*,\s*(\d+)|"
    r"\$(TOOL|BASE)\s*=\s*(?:(?:TOOL|BASE)_DATA\s*\[\s*(\d+)|S\w+\s*\(\s*(\w+)|(\$?\w*))",
    re.I,
)
_CHANGED = re.compile(r"\b(TOOL|BASE)_DATA\s*\[\s*(\d+)\s*\]\s*(?:\.\w+\s*=|=\s*[^\s{])", re.I)
_MOVED = re.compile(r"\$(?:TOOL|BASE)\.\w+\s*=", re.I)
_COMPONENT = re.compile(r"\s*\w+(?:\[\w+\])?\.(?:[XYZABC]|A[1-6])\s*=", re.I)
Parts = dict[str, tuple[str, Place]]


class _State(NamedTuple):
    """Tool and base in force by name, None where not stated; why positions are refused."""

    tool: str | None = None
    base: str | None = None
    refused: str = ""


def frames_of(source: Source) -> Frames:
    """TOOL_DATA and BASE_DATA, and frames written in assignments to $TOOL and $BASE."""
    frames = {}
    for offset, text in _lines(source.text):
        result = _DATA.match(text) or re.match(r"\s*\$(TOOL|BASE)()\s*=\s*\{", text, re.I)
        for parts in _aggregates(offset, text) if result else ():
            if (places := _places(parts, _FRAME)) is not None:
                name = str(int(result[2])) if result[2] else source.where(offset)
                frames[result[1].lower(), name] = CONVENTION.pose(source.values(places))
    return frames


def read(sources: Sequence[Source], frames: Frames, _: np.ndarray | None) -> Program:
    """Positions of a KRL program."""
    data: dict[str, _State] = {}
    uses: dict[str, set[_State]] = {}
    result: dict[str, Position] = {}
    computed, changed, motions = [], set(), []
    for source in sorted(sources, key=_ending):  # .dat first
        state = _State()
        for offset, text in _lines(source.text):
            aggregates, place = list(_aggregates(offset, text)), source.where(offset)
            where = f"{place}: {text.strip()}"
            state = _in_force(state, text, data, place)
            changed |= {(kind.lower(), str(int(n))) for kind, n in _CHANGED.findall(text)}
            if motion := _MOTION.match(text):
                target = re.split(r"\bWITH\b|\bC_\w+", re.sub(r"\{[^}]*\}", "", motion[3]))[0]
                named = [
                    data[each] for each in re.findall(r"\w+", motion[3].upper()) if each in data
                ]
                names = re.findall(r"\$?\b[A-Z_]\w*", target.upper())
                inline = {
                    f"line {place.split(':')[1]}{' end' * number}": _position(source, parts)
                    for number, parts in enumerate(aggregates[: 1 + ("CIRC" in motion[1].upper())])
                }
                if motion[2] or ":" in target or None in inline.values():
                    computed.append(where)
                    continue
                result |= inline
                plain = re.findall(r"\$?\b[A-Z_]\w*", re.sub(r"\[.*?\]", "", target.upper()))
                motions.append((where, {*plain} - {"CA"}))
                for name in (*names, *inline):
                    uses.setdefault(name, set()).add((named or [state])[0])
            elif _COMPONENT.match(text):
                computed.append(where)
            elif aggregates and (assigned := _ASSIGNED.match(text)):
                name, parts = re.sub(r"\s", "", assigned[1].upper()), aggregates[0]
                if {"TOOL_NO", "BASE_NO"} <= set(parts):
                    still = "#TCP" in parts.get("IPO_FRAME", ("",))[0].upper()
                    numbers = parts["TOOL_NO"][0], parts["BASE_NO"][0]
                    data[name] = _State(*numbers, STILL if still else "")
                elif (
                    name[0] != "$"
                    and "_DATA" not in name
                    and (position := _position(source, parts))
                ):
                    if name in result or re.search(r"\}\s*:", text):
                        computed.append(where)
                    else:
                        result[name] = position
    defined = {name.split("[")[0] for name in result}
    computed += [where for where, names in motions if not defined.issuperset(names)]
    positions = []
    for name, position in result.items():
        ways = uses.get(name.split("[")[0]) or {data.get(f"F{name[1:]}", _State())}
        tool, base, why = next(iter(ways))
        if len(ways) > 1 or {(TOOL, tool), (BASE, base)} & changed:
            why = SEVERAL if len(ways) > 1 else CHANGED
        positions.append(replace(position, name=name, tool=tool, base=base, refused=why))
    positions.sort(key=lambda each: (_ending(each.source), each.places[0]))
    return Program(sources, positions, {**NO_FRAMES, **frames}, computed)


def _ending(source: Source) -> str:
    return source.path.suffix.lower()


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Status bits 0 to 2 and turn bits of the six axes."""
    is_ahead, is_above, _ = sides
    bent_back = -180.0 <= q_deg[4] < 0.0 or q_deg[4] >= 180.0
    status = (not is_ahead) + 2 * is_above + 4 * bent_back
    return _bits(status, sum(int(angle < 0.0) << axis for axis, angle in enumerate(q_deg)))


def _bits(status: int, turn: int) -> tuple[str, ...]:
    return tuple(
        f"{name} bit {bit} {number >> bit & 1}"
        for name, number, count in (("S", status, 3), ("T", turn, 6))
        for bit in range(count)
    )


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Offset and text of each line, comments and strings blank."""
    offset = 0
    for line in text.splitlines(keepends=True):
        yield offset, blanked(line, r'"[^"\r\n]*"', r";.*", r"^\s*&.*")
        offset += len(line)


def _aggregates(at: int, text: str) -> Iterator[Parts]:
    """Components of each ``{..}`` of a line by name, with the places of their values."""
    for result in _AGGREGATE.finditer(text):
        parts = _PART.finditer(text, *result.span(1))
        yield {
            part[1].upper(): (part[2].strip(), (at + part.start(2), at + part.end(2)))
            for part in parts
        }


def _places(parts: Parts, keys: Sequence[str]) -> list[Place] | None:
    """Where the numbers of components are; None where one is missing or no number."""
    if all(re.fullmatch(NUMBER, parts.get(key, ("",))[0]) for key in keys):
        return [parts[key][1] for key in keys]
    return None


def _in_force(state: _State, text: str, data: dict[str, _State], where: str) -> _State:
    """The frames after a line that may set them."""
    if active := re.search(r"\bFDAT_ACT\s*=\s*(\w+)", text, re.I):
        return data.get(active[1].upper(), _State())
    if _MOVED.search(text):
        return state._replace(refused=CHANGED)
    if mode := re.search(r"\bIPO_MODE\s*=\s*#(TCP|BASE)\b", text, re.I):
        state = state._replace(refused=STILL if mode[1].upper() == "TCP" else "")
    for result in _SET.finditer(text):
        kind, number = (result[1] or result[3]).lower(), result[2] or result[4]
        if result[5]:
            name = getattr(data.get(result[5].upper(), _State()), kind)
        elif number or result[6].upper() == "$NULLFRAME":
            name = str(int(number or 0))
        else:
            name = result[6] or where
        state = state._replace(**{kind: name})
    return state


def _position(source: Source, parts: Parts) -> Position | None:
    """The position of an aggregate; None where some of its numbers are missing."""
    outer = [parts[key][0] for key in parts if re.fullmatch(r"E[1-6]", key)]
    moves = any(re.fullmatch(NUMBER, item) and float(item) for item in outer)
    if (places := _places(parts, _FRAME)) is not None:
        stated = _bits(*(_whole(parts[key][0]) for key in "ST")) if {*"ST"} <= set(parts) else None
        return Position("", source, places, 4, posture=stated, moves_outside=moves)
    places = _places(parts, _AXES)
    return None if places is None else Position("", source, places, 4, 1.0)


def _whole(text: str) -> int:
    """A status or turn: 6, 'B110' or 'H6'."""
    base = {"'B": 2, "'H": 16}.get(text[:2].upper(), 10)
    return int(text.strip("'BbHh") if base != 10 else text, base)


LANGUAGE = Language(
    "KUKA KRL", (".src", ".dat"), CONVENTION, read, frames_of, posture, (".src", ".dat"),
    ("$config.dat",),
)  # fmt: skip
