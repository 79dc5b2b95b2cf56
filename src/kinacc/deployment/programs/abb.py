"""ABB RAPID: robtarget and jointtarget data, and those written in a move; tooldata and wobjdata."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from kinacc.deployment.programs.orientation import QUATERNION, Convention
from kinacc.deployment.programs.record import (
    BASE,
    CHANGED,
    NUMBER,
    SEVERAL,
    STILL,
    TOOL,
    Frames,
    Language,
    Position,
    Program,
    Source,
    blanked,
)
from kinacc.geometry import IDENTITY, compose

CONVENTION = Convention(QUATERNION)


def _list(*parts: int | str) -> str:
    inside = [
        rf"{NUMBER}\s*(?:,\s*{NUMBER}\s*){{{part - 1}}}" if isinstance(part, int) else part
        for part in parts
    ]
    return r"\[\s*" + r"\s*,\s*".join(inside) + r"\s*\]"


_FRAME = _list(_list(3), _list(4))
_TARGET = re.compile(
    _list(_list(3), _list(4), _list(4), _list(6)) + "|" + _list(_list(6), _list(6))
)
_TARGET_DATA = re.compile(r"\b(?:robtarget|jointtarget)\s+(\w+)[^:]*:=", re.I)
_FRAME_DATA = re.compile(
    r"\b(?:(tool)|wobj)data\s+(\w+)\s*:=\s*\[\s*(\w+)\s*,\s*(\w+)?([^;]*)", re.I
)
_MOVE = re.compile(r"\s*(?:\w+\s*:\s*)?(?:Move|Trigg|Search|Arc|Spot|Paint|Disp)\w*\b", re.I)
_COMPUTED = re.compile(
    r"\b(?:Offs|RelTool|CRobT|CalcRobT)\s*\(|\.(?:trans|rot|robconf|robax)\b[^;]*:=", re.I
)
_SET = re.compile(r"\s*(\w+)\.(?:[tou]frame|robhold|ufprog)\b[^;=]*:=", re.I)
_UNUSED = 8.9e9


def frames_of(source: Source) -> Frames:
    """Tools and work objects that a module declares, and tool0 and wobj0."""
    frames = {(TOOL, "TOOL0"): IDENTITY, (BASE, "WOBJ0"): IDENTITY}
    text = _plain(source)
    for data in _FRAME_DATA.finditer(text):
        poses = [
            CONVENTION.pose(source.values(source.numbers(*result.span())))
            for result in re.compile(_FRAME).finditer(text, *data.span())
        ]
        if data[1] and poses:
            frames[TOOL, data[2].upper()] = poses[0]
        elif len(poses) > 1:
            frames[BASE, data[2].upper()] = compose(*poses[:2])
    return frames


def read(sources: Sequence[Source], frames: Frames, _: np.ndarray | None) -> Program:
    """Positions of a module."""
    (source,) = sources
    text, state = _plain(source), 0
    result = {item.start(): item.end() for item in _TARGET.finditer(text)}
    names: dict[int, str] = {}
    uses: dict[int, set[tuple[str | None, str | None]]] = {}
    computed, refused, motions = [], {}, []
    for data in _FRAME_DATA.finditer(text):
        flags = data[3].upper(), data[1] or (data[4] or "").upper()
        if flags[0] == ("FALSE" if data[1] else "TRUE") or flags[1] == "FALSE":
            refused[data[2].upper()] = STILL
    for statement in text.split(";"):
        end = state + len(statement)
        here = [start for start in result if state <= start < end]
        if named := _TARGET_DATA.search(statement):
            names |= dict.fromkeys(here, named[1])
        elif _MOVE.match(statement):
            bare = re.sub(r"\[.*?\](?=\s*[,\\])|\(.*\)", "", statement, flags=re.S)
            last = re.match(r"\s*(\w+)", bare.split(",")[-1])
            work = re.search(r"\\WObj\s*:=\s*(\w+)", statement, re.I)
            way = last and last[1].upper(), work[1].upper() if work else "WOBJ0"
            texts = {*re.findall(r"(?<!\\)\b[A-Z]\w*", bare.upper())}
            if not here and not _COMPUTED.search(statement):
                first = state + len(statement) - len(statement.lstrip())
                motions.append((f"{source.where(first)}: {' '.join(statement.split())}", texts))
            for start in [
                *here,
                *(state for state, name in names.items() if name.upper() in texts),
            ]:
                uses.setdefault(start, set()).add(way)
        else:
            result = {start: last for start, last in result.items() if start not in here}
        if _COMPUTED.search(statement):
            first = state + len(statement) - len(statement.lstrip())
            computed.append(f"{source.where(first)}: {' '.join(statement.split())}")
        if changed := _SET.match(statement):
            refused[changed[1].upper()] = CHANGED
        state = end + 1
    defined = {name.upper() for name in names.values()}
    computed += [where for where, texts in motions if not texts & defined]
    positions = []
    for start, end in result.items():
        ways = uses.get(start, {(None, None)})
        tool, base = next(iter(ways))
        why = SEVERAL if len(ways) > 1 else refused.get(tool) or refused.get(base) or ""
        array = [item for item, name in names.items() if name == names.get(start)]
        index = f"{{{array.index(start) + 1}}}" if len(array) > 1 else ""
        name = names.get(start, f"line {source.where(start).split(':')[1]}") + index
        position = _position(name, source, source.numbers(start, end))
        positions.append(replace(position, tool=tool, base=base, refused=why))
    return Program(sources, positions, frames, computed)


def _position(name: str, source: Source, places: list) -> Position:
    values = source.values(places)
    outer = values[-6:]
    moves = bool(np.any((np.abs(outer) < _UNUSED) & (outer != 0.0)))
    if len(places) == 12:
        return Position(name, source, places[:6], 4, 1.0, moves_outside=moves)
    stated = _words(values[7:11])
    decimals = (3, 3, 3, 9, 9, 9, 9)
    return Position(name, source, places[:7], decimals, posture=stated, moves_outside=moves)


def _words(numbers: Iterable[float]) -> tuple[str, ...]:
    names = zip(("cf1", "cf4", "cf6", "cfx"), numbers, strict=True)
    return tuple(f"{name} {int(number)}" for name, number in names)


def _plain(source: Source) -> str:
    return blanked(source.text, r'"[^"\r\n]*"', r"!.*")


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Quadrants of axes 1, 4 and 6, and the number of the eight postures."""
    is_ahead, is_above, is_positive = sides
    number = 4 * (not is_ahead) + 2 * (not is_above) + (not is_positive)
    return _words([*np.floor(q_deg[[0, 3, 5]] / 90.0), number])


LANGUAGE = Language(
    "ABB RAPID", (".mod", ".prg", ".sys", ".modx"), CONVENTION, read, frames_of, posture
)
