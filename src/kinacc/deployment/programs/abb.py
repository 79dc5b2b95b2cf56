"""ABB RAPID: robtarget and jointtarget data, and those written in a move; tooldata and wobjdata."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kinacc.deployment.programs.orientation import QUATERNION, Convention
from kinacc.deployment.programs.record import (
    BASE,
    JOINTS,
    NUMBER,
    POSE,
    TOOL,
    Language,
    Position,
    Program,
    Reading,
    Source,
    blanked,
    numbers_in,
    values_at,
)
from kinacc.geometry import IDENTITY, Pose, compose

CONVENTION = Convention(QUATERNION)


def _list(count: int) -> str:
    return rf"\[\s*{NUMBER}\s*(?:,\s*{NUMBER}\s*){{{count - 1}}}\]"


_FRAME = rf"\[\s*{_list(3)}\s*,\s*{_list(4)}\s*\]"
_ROBTARGET = re.compile(rf"\[\s*{_list(3)}\s*,\s*{_list(4)}\s*,\s*{_list(4)}\s*,\s*{_list(6)}\s*\]")
_JOINTTARGET = re.compile(rf"\[\s*{_list(6)}\s*,\s*{_list(6)}\s*\]")
_DATA = re.compile(
    r"\b(robtarget|jointtarget|tooldata|wobjdata)\s+(\w+)\s*(?:\{[^}]*\}\s*)?:=", re.I
)
_MOVE = re.compile(r"^\s*(?:\w+\s*:\s*)?((?:Move|Trigg|Search|Arc|Spot|Paint|Disp)\w*)\b", re.I)
_COMPUTED = re.compile(r"\b(Offs|RelTool|CRobT|CalcRobT)\s*\(", re.I)
_CHANGED = re.compile(r"\b(\w+)(?:\{[^}]*\})?\.(?:trans|rot|robconf|robax)\b[^;]*:=", re.I)
_UNUSED = 8.9e9
_JOINT_DECIMALS, _POSE_DECIMALS = (4,) * 6, (3, 3, 3, 9, 9, 9, 9)


def read(reading: Reading) -> Program:
    """Positions of a module."""
    (source,) = reading.sources
    frames = {(TOOL, "TOOL0"): IDENTITY, (BASE, "WOBJ0"): IDENTITY}
    still: set[str] = set()
    for each in (*reading.frame_files, source):
        _read_frames(each, frames, still)
    text = _plain(source)
    literals = {**_found(_ROBTARGET, text, POSE), **_found(_JOINTTARGET, text, JOINTS)}
    uses: dict[int, set[tuple[str | None, str | None]]] = {}
    named: dict[str, list[int]] = {}
    kind = {}
    start, left, statements = 0, [], []
    for end in [*(found.start() for found in re.finditer(";", text)), len(text)]:
        statements.append((start, end))
        start = end + 1
    for start, end in statements:
        statement = text[start:end]
        own = [at for at in literals if start <= at < end]
        if data := _DATA.search(statement):
            if data[1].lower() in ("robtarget", "jointtarget"):
                named[data[2].upper()] = own
        elif not _MOVE.match(statement):
            for at in own:
                kind[at] = "is no target of a move"
    for start, end in statements:
        statement = text[start:end]
        line = source.line(start + len(statement) - len(statement.lstrip()))
        where = f"{source.path.name}:{line}: {' '.join(statement.split())}"
        if _COMPUTED.search(statement) or _CHANGED.search(statement):
            left.append(where)
        if _DATA.search(statement) or not (move := _MOVE.match(statement)):
            continue
        inside = re.sub(r"\((?:[^()]|\([^()]*\))*\)", " ", statement[move.end(1) :])
        names = [name.upper() for name in re.findall(r"(?<![\\\w])[A-Za-z]\w*", inside)]
        wobj = re.search(r"\\WObj\s*:=\s*(\w+)", statement, re.I)
        base = wobj[1].upper() if wobj else "WOBJ0"
        tools = [name for name in names if (TOOL, name) in frames]
        if not tools:
            bare = re.sub(r"\[[^;]*\]", "", re.sub(r"\\\w+(\s*:=\s*[\w.]+)?", "", inside))
            tools = [
                each.strip().upper() for each in bare.split(",") if re.fullmatch(r"\s*\w+\s*", each)
            ][-1:]
        targets = [at for at in literals if start <= at < end]
        targets += [at for name in names for at in named.get(name, [])]
        for at in targets:
            uses.setdefault(at, set()).add((tools[-1] if tools else None, base))
    labels = {}
    for data in _DATA.finditer(text):
        several = named.get(data[2].upper(), [])
        for number, at in enumerate(several, 1):
            labels[at] = f"{data[2]}{{{number}}}" if len(several) > 1 else data[2]
    positions = []
    for at in sorted(literals):
        if at in kind:
            continue
        line = source.line(at)
        name = labels.get(at, f"line {line}")
        position = _position(source, at, *literals[at], name, line)
        ways = uses.get(at, {(None, None)})
        tool, base = next(iter(ways))
        position = replace(position, tool=tool, base=base)
        if len(ways) > 1:
            position = replace(position, refused="is used with different tools or work objects")
        elif position.kind == POSE and {tool, base} & still:
            position = replace(position, refused="the tool stands still or the work object moves")
        positions.append(position)
    return Program(reading.sources, tuple(positions), frames, tuple(left))


def _plain(source: Source) -> str:
    return blanked(source.text, r'"[^"\r\n]*"', r"!.*")


def _found(pattern: re.Pattern, text: str, kind: str) -> dict[int, tuple[str, int]]:
    return {found.start(): (kind, found.end()) for found in pattern.finditer(text)}


def _position(source: Source, at: int, kind: str, end: int, name: str, line: int) -> Position:
    places = numbers_in(source.text, at, end)
    values = values_at(source.text, places)
    count = 7 if kind == POSE else 6
    stated = None
    if kind == POSE:
        words = ("cf1", "cf4", "cf6", "cfx")
        stated = tuple(
            f"{word} {int(value)}" for word, value in zip(words, values[7:11], strict=True)
        )
    return Position(
        name,
        0,
        line,
        kind,
        tuple(places[:count]),
        values[:count],
        _POSE_DECIMALS if kind == POSE else _JOINT_DECIMALS,
        posture=stated,
        external=tuple(value for value in values[-6:] if abs(value) < _UNUSED),
    )


def _read_frames(source: Source, frames: dict[tuple[str, str], Pose], still: set[str]) -> None:
    """Tools and work objects that a module declares; ``still``: those held the other way round."""
    text = _plain(source)
    for data in _DATA.finditer(text):
        kind, name = data[1].lower(), data[2].upper()
        value = text[data.end() : text.find(";", data.end())]
        written = [Pose(*_frame(found[0])) for found in re.finditer(_FRAME, value)]
        held = re.match(r"\s*\[\s*(TRUE|FALSE)", value, re.I)
        if kind == "tooldata" and written:
            frames[TOOL, name] = written[0]
            if held and held[1].upper() == "FALSE":
                still.add(name)
        elif kind == "wobjdata" and len(written) >= 2:
            frames[BASE, name] = compose(written[0], written[1])
            fixed = re.match(r"\s*\[\s*\w+\s*,\s*(TRUE|FALSE)", value, re.I)
            if (held and held[1].upper() == "TRUE") or (fixed and fixed[1].upper() == "FALSE"):
                still.add(name)


def _frame(text: str) -> Pose:
    return CONVENTION.pose(values_at(text, numbers_in(text, 0, len(text))))


def posture(sides: Sequence[bool], q_deg: np.ndarray) -> tuple[str, ...]:
    """Quadrants of axes 1, 4 and 6, and the number of the eight postures."""
    quadrants = [f"{word} {int(np.floor(q_deg[axis] / 90.0))}" for word, axis in _QUADRANTS]
    is_ahead, is_above, is_positive = sides
    return (*quadrants, f"cfx {4 * (not is_ahead) + 2 * (not is_above) + (not is_positive)}")


_QUADRANTS = (("cf1", 0), ("cf4", 3), ("cf6", 5))

LANGUAGE = Language("ABB RAPID", (".mod", ".prg", ".sys", ".modx"), CONVENTION, read, posture)
