"""KUKA KRL: a .src file and the .dat file beside it; frames of $config.dat."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from kinacc.deployment.programs.orientation import KUKA, Convention
from kinacc.deployment.programs.record import (
    BASE,
    CHANGED,
    NUMBER,
    STILL,
    TOOL,
    UNUSED,
    Frames,
    Language,
    Moves,
    Place,
    Position,
    Program,
    Source,
    Use,
    blanked,
)

CONVENTION = Convention(KUKA)
_FRAME, _AXES = list("XYZABC"), [f"A{number}" for number in range(1, 7)]
_AGGREGATE = re.compile(r"\{\s*(?:\w+\s*:)?([^{}]*)\}")
_PART = re.compile(rf"(\w+)(?:\[\])?\s+({NUMBER}|'[BH][0-9A-F]+'|[^,\s][^,]*)", re.I)
_MOTION = re.compile(r"\s*(?:S?PTP|S?LIN|S?(CIRC)|SPL)(_REL)?\b(.*)", re.I)
_ASSIGNED = re.compile(r"\s*(?:\w+\s+)*(\w+(?:\s*\[\s*\d+\s*\])?)\s*=", re.I)
_DATA = re.compile(
    r"\s*(?:DECL\s+\w+\s+)?(?:\$(TOOL|BASE)|(TOOL|BASE)_DATA\s*\[\s*(\d+)\s*\])\s*=\s*\{", re.I
)
_SET = re.compile(
    r"(?:BAS\s*\(\s*#|\$)(TOOL|BASE)\s*[,=](?!=)\s*"
    r"(?:(?:(?:TOOL|BASE)_DATA\s*\[\s*)?(\d+)|S\w+\s*\(\s*(\w+)|(\$?\w*))",
    re.I,
)
_CHANGED = re.compile(r"\b(TOOL|BASE)_DATA\s*\[\s*(\d+)\s*\]\s*(?:\.\w+\s*=|=\s*[^\s{])", re.I)
_MOVED = re.compile(r"\$(?:TOOL|BASE)(?:\.\w+\s*=|\s*=[^{]*:)", re.I)
_COMPONENT = re.compile(r"\s*\w+(?:\[\w+\])?\.(?:[XYZABC]|A[1-6])\s*=", re.I)
_SIGNS = ("positive", "negative")
_SIDES = (
    ("basic area", "overhead area"),
    ("elbow down", "elbow up"),
    ("wrist positive", "wrist negative"),
)
Parts = dict[str, tuple[str, Place]]


def frames_of(source: Source) -> Frames:
    """TOOL_DATA and BASE_DATA, and frames written in assignments to $TOOL and $BASE."""
    frames = {}
    for offset, text in _lines(source.text):
        data, places = _DATA.match(text), _places(next(_aggregates(offset, text), {}), _FRAME)
        if data and places:
            name = str(int(data[3])) if data[3] else source.where(offset)
            frames[(data[1] or data[2]).lower(), name] = CONVENTION.pose(source.values(places))
    return frames


def read(sources: Sequence[Source], _: np.ndarray | None) -> Program:
    """Positions of a KRL program."""
    moves, data = Moves(), dict[str, Use]()
    targets: list[tuple[str, list[str]]] = []
    assigned: set[str] = set()
    for source in sorted(sources, key=lambda source: source.path.suffix.lower()):  # .dat first
        use = UNUSED
        for offset, text in _lines(source.text):
            statement, aggregates = source.statement(offset, text), list(_aggregates(offset, text))
            use = _in_force(use, text, data, source.where(offset))
            for kind, number in _CHANGED.findall(text):
                moves.refused[kind.lower(), str(int(number))] = CHANGED
            if motion := _MOTION.match(text):
                written = [
                    _position(source, source.line(offset) + " end" * number, parts)
                    for number, parts in enumerate(aggregates[: 2 if motion[1] else 1])
                ]
                inline = [(position.name, position) for position in written if position]
                target = re.split(r"\bWITH\b|\bC_\w+", re.sub(r"\{[^}]*\}", "", motion[3]))[0]
                if motion[2] or ":" in target or len(inline) < len(written):
                    moves.not_corrected.append(statement)
                    continue
                moves.positions += inline
                target = re.sub(r"\[.*?\]", "", target.upper())
                names = [name for name in re.findall(r"\$?\b[A-Z_]\w*", target) if name != "CA"]
                targets.append((statement, names))
                in_line = (data[word] for word in re.findall(r"\w+", text.upper()) if word in data)
                way = next(in_line, use)
                for name in (*names, *dict(inline)):
                    moves.use(name, *way)
            elif _COMPONENT.match(text):
                moves.not_corrected.append(statement)
            elif aggregates and (variable := _ASSIGNED.match(text)):
                name, parts = re.sub(r"\s", "", variable[1].upper()), aggregates[0]
                if {"TOOL_NO", "BASE_NO"} <= set(parts):
                    still = "#TCP" in parts.get("IPO_FRAME", ("",))[0].upper()
                    data[name] = parts["TOOL_NO"][0], parts["BASE_NO"][0], STILL if still else ""
                elif "_DATA" not in name and (position := _position(source, name, parts)):
                    if name in assigned or re.search(r"\}\s*:|:\s*\{", text):
                        moves.not_corrected.append(statement)
                    else:
                        assigned.add(name)
                        moves.positions.append((name.split("[")[0], position))
    defined = {name for name, _ in moves.positions}
    moves.not_corrected += [text for text, names in targets if not defined.issuperset(names)]
    for name, _unused in moves.positions:
        if name not in moves.uses and (use_data := data.get(f"F{str(name)[1:]}")):
            moves.use(name, *use_data)
    return moves.program(sources, CONVENTION)


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Status and turn: bits 0 to 2, and of the six axes, in words."""
    is_ahead, is_above, _ = sides
    status = (not is_ahead) + 2 * is_above + 4 * (q_deg[4] < 0.0)
    return _stated(status, sum(int(angle < 0.0) << axis for axis, angle in enumerate(q_deg)))


def _stated(status: int, turn: int) -> tuple[str, ...]:
    sides = (pair[status >> bit & 1] for bit, pair in enumerate(_SIDES))
    return *sides, *(f"A{axis + 1} {_SIGNS[turn >> axis & 1]}" for axis in range(6))


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Offset and text of each line, comments and strings blank."""
    plain = blanked(text, r'"[^"\r\n]*"', r";.*", r"^[ \t]*&.*")
    for line in re.finditer(r"[^\r\n]+", plain):
        yield line.start(), line[0]


def _aggregates(start: int, text: str) -> Iterator[Parts]:
    """Components of each ``{..}`` of a line by name, with the places of their values."""
    for result in _AGGREGATE.finditer(text):
        parts = _PART.finditer(text, *result.span(1))
        yield {
            part[1].upper(): (part[2].strip(), (start + part.start(2), start + part.end(2)))
            for part in parts
        }


def _places(parts: Parts, keys: Sequence[str]) -> list[Place]:
    """Where the numbers of components are; empty where one is missing or no number."""
    if all(re.fullmatch(NUMBER, parts.get(key, ("",))[0]) for key in keys):
        return [parts[key][1] for key in keys]
    return []


def _in_force(use: Use, text: str, data: dict[str, Use], where: str) -> Use:
    """The frames after a line that may set them."""
    if active := re.search(r"\bFDAT_ACT\s*=\s*(\w+)", text, re.I):
        return data.get(active[1].upper(), UNUSED)
    *frames, reason = use
    if mode := re.search(r"\bIPO_MODE\s*=\s*#(TCP|BASE)\b", text, re.I):
        reason = STILL if mode[1].upper() == "TCP" else ""
    for kind, number, named, variable in _SET.findall(text):
        column = (TOOL, BASE).index(kind.lower())
        if number or variable.upper() == "$NULLFRAME":
            frames[column] = str(int(number or 0))
        elif named:
            frames[column] = data.get(named.upper(), UNUSED)[column]
        else:
            frames[column] = variable or where
    return frames[0], frames[1], CHANGED if _MOVED.search(text) else reason


def _position(source: Source, name: str, parts: Parts) -> Position | None:
    """The position of an aggregate; None where some of its numbers are missing."""
    if places := _places(parts, _AXES):
        return Position(name, source, places, 4, 1.0)
    if not (places := _places(parts, _FRAME)):
        return None
    status, turn = (_whole(parts[key][0]) if key in parts else 0 for key in "ST")
    if status is None or turn is None:  # a variable
        return None
    outer = [parts[key][0] for key in parts if re.fullmatch(r"E[1-6]", key)]
    moves = any(re.fullmatch(NUMBER, text) and float(text) for text in outer)
    stated = _stated(status, turn) if {*"ST"} <= set(parts) else ()
    return Position(name, source, places, 4, posture=stated, moves_outside=moves)


def _whole(text: str) -> int | None:
    """A status or turn: 6, 'B110' or 'H6'; None for a variable."""
    base = {"'B": 2, "'H": 16}.get(text[:2].upper(), 10)
    with suppress(ValueError):
        return int(text if base == 10 else text[2:-1], base)
    return None


LANGUAGE = Language(
    "KUKA KRL",
    (".src", ".dat"),
    CONVENTION,
    read,
    frames_of,
    posture,
    (".src", ".dat"),
    ("$config.dat",),
)
