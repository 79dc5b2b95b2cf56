"""ABB RAPID: robtarget and jointtarget data, and those written in a move; tooldata and wobjdata."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Sequence

import numpy as np

from kinacc.deployment.programs.orientation import QUATERNION, Convention
from kinacc.deployment.programs.record import (
    BASE,
    CHANGED,
    NUMBER,
    STILL,
    TOOL,
    Frames,
    Language,
    Moves,
    Position,
    Program,
    Source,
    blanked,
)
from kinacc.geometry import compose

CONVENTION = Convention(QUATERNION)


def _list(*parts: int) -> str:
    """Pattern of lists of so many numbers, one after another."""
    number = rf"\s*{NUMBER}\s*"
    return r"\s*,\s*".join(rf"\[{number}(?:,{number}){{{part - 1}}}\]" for part in parts)


_FRAME = re.compile(_list(3, 4))
_TARGET = re.compile(rf"\[\s*(?:{_list(3, 4, 4, 6)}|{_list(6, 6)})\s*\]")
_TARGET_DATA = re.compile(r"\b(?:robtarget|jointtarget)\s+(\w+)[^:]*:=", re.I)
_FRAME_DATA = re.compile(
    r"\b(?:(tool)|wobj)data\s+(\w+)\s*:=\s*\[\s*(\w+)\s*,\s*(\w+)?([^;]*)", re.I
)
_MOVE = re.compile(
    r"\s*(?:\w+\s*:\s*)?(?:Move|Trigg|Search|Arc|Spot|Paint|Disp)\w*\b(?!\s*:=)", re.I
)
_COMPUTED = re.compile(
    r"\b(?:Offs|RelTool|CRobT|CalcRobT)\s*\(|\.(?:trans|rot|robconf|robax)\b[^;]*:=", re.I
)
_SET = re.compile(r"\s*(\w+)\.(?:[tou]frame|robhold|ufprog)\b[^;=]*:=", re.I)
_CONTROL = re.compile(
    r"\b(?:THEN|ELSE|DO|ERROR|UNDO|END(?:IF|WHILE|FOR|PROC|FUNC|TEST|TRAP)|CASE\b[^:\n]*:|DEFAULT\s*:|"
    r"(?:PROC|TRAP|FUNC\s+\w+)\s+\w+\s*(?:\([^)]*\))?)(?!\w)",
    re.I,
)
_UNUSED = 8.9e9


def frames_of(source: Source) -> Frames:
    """Tools and work objects that a module declares."""
    frames = {}
    text = _plain(source)
    for data in _FRAME_DATA.finditer(text):
        poses = [
            CONVENTION.pose(source.values(source.numbers(*frame.span())))
            for frame in _FRAME.finditer(text, *data.span())
        ]
        if data[1] and poses:
            frames[TOOL, data[2].upper()] = poses[0]
        elif len(poses) > 1:
            frames[BASE, data[2].upper()] = compose(*poses[:2])
    return frames


def read(sources: Sequence[Source], _: np.ndarray | None) -> Program:
    """Positions of a module."""
    (source,) = sources
    text, moves = _plain(source), Moves()
    for data in _FRAME_DATA.finditer(text):
        holds, programmed = data[3].upper(), data[1] or (data[4] or "").upper()
        if holds == ("FALSE" if data[1] else "TRUE") or programmed == "FALSE":
            moves.refused |= dict.fromkeys(_frames(data[2]), STILL)
    statements = [*re.finditer(r"[^;\s][^;]*", text)]
    for statement in statements:
        if named := _TARGET_DATA.search(statement[0]):
            for target in _TARGET.finditer(text, *statement.span()):
                position = _position(named[1], source, *target.span())
                moves.positions.append((named[1].upper(), position))
    declared = {name for name, _ in moves.positions}
    for statement in statements:
        words = statement[0]
        assigned = re.match(r"\s*(\w+)\s*(?:\{[^}]*\}\s*)?:=", words)
        is_lost = assigned and assigned[1].upper() in declared
        if _MOVE.match(words):
            bare = re.sub(r"\[.*?\](?=\s*[,\\])|\(.*\)", "", words, flags=re.S).upper()
            tool = re.match(r"\s*(\w+)", bare.split(",")[-1])
            work = re.search(r"\\WOBJ\s*:=\s*(\w+)", words.upper())
            used: list[Hashable] = []
            for target in _TARGET.finditer(text, *statement.span()):
                used.append(target.start())
                position = _position(source.line(target.start()), source, *target.span())
                moves.positions.append((target.start(), position))
            used += [name for name in re.findall(r"(?<!\\)\b[A-Z]\w*", bare) if name in declared]
            for key in used:
                moves.use(key, tool and tool[1], work[1] if work else "WOBJ0")
            is_lost = not used
        if is_lost or _COMPUTED.search(words):
            moves.not_corrected.append(source.statement(statement.start(), words))
        if changed := _SET.match(words):
            moves.refused |= dict.fromkeys(_frames(changed[1]), CHANGED)
    return moves.program(sources, CONVENTION)


def _frames(name: str) -> list[tuple[str, str]]:
    """Keys of a frame that may be a tool or a work object."""
    return [(kind, name.upper()) for kind in (TOOL, BASE)]


def _position(name: str, source: Source, start: int, end: int) -> Position:
    places = source.numbers(start, end)
    values = source.values(places)
    moves = bool(np.any((values[-6:] != 0.0) & (np.abs(values[-6:]) < _UNUSED)))
    if len(places) == 12:
        return Position(name, source, places[:6], 4, 1.0, moves_outside=moves)
    stated, decimals = _stated(values[7:11]), (3, 3, 3, 9, 9, 9, 9)
    return Position(name, source, places[:7], decimals, posture=stated, moves_outside=moves)


def _stated(numbers: Iterable[float]) -> tuple[str, ...]:
    names = zip(("cf1", "cf4", "cf6", "cfx"), numbers, strict=True)
    return tuple(f"{name} {int(number)}" for name, number in names)


def _plain(source: Source) -> str:
    """The text without comments and strings; words of control end a statement as ``;`` does."""
    text = blanked(source.text, r'"[^"\r\n]*"', r"!.*")
    return _CONTROL.sub(lambda word: word[0][:-1] + ";", text)


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Quadrants of axes 1, 4 and 6, and the number of the eight postures."""
    is_ahead, is_above, is_positive = sides
    number = 4 * (not is_ahead) + 2 * (not is_above) + (not is_positive)
    return _stated([*np.floor(q_deg[[0, 3, 5]] / 90.0), number])


LANGUAGE = Language(
    "ABB RAPID",
    (".mod", ".prg", ".sys", ".modx"),
    CONVENTION,
    read,
    frames_of,
    posture,
)
