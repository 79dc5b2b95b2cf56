"""Universal Robots scripts: poses p[..] in m and rad, and joint lists, of the move commands."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinacc.deployment.programs.orientation import VECTOR, Convention
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
    blanked,
    numbers_in,
    values_at,
)
from kinacc.geometry import IDENTITY, Pose

CONVENTION = Convention(VECTOR, 1e3, 180.0 / np.pi)
_SIX = rf"\s*{NUMBER}\s*(?:,\s*{NUMBER}\s*){{5}}"
_LIST = re.compile(rf"(p?)\[{_SIX}\]")
_CALL = re.compile(r"\b(move[jlpc]|set_tcp)\s*\(")
_ASSIGNED = re.compile(rf"^[ \t]*(?:global\s+|local\s+)?(\w+)\s*=\s*(p?)\[{_SIX}\]", re.M)
_COMPUTED = re.compile(r"\b(?:pose_trans|pose_add|get_inverse_kin)\b")
_DECIMALS = (6,) * 6


def read(reading: Reading) -> Program:
    """Positions of a script: the targets of its moves, written there or in a variable."""
    (source,) = reading.sources
    text = blanked(source.text, r"#.*", r'"[^"\r\n]*"')
    assigned = {found[1]: found for found in _ASSIGNED.finditer(text)}
    frames: dict[tuple[str, str], Pose] = {(BASE, ""): IDENTITY}
    tool, places, left = None, {}, []
    for found in _CALL.finditer(text):
        arguments = list(_arguments(text, found.end()))
        line = source.line(found.start())
        if found[1] == "set_tcp":
            tool = _tool(text, arguments, assigned, frames, line)
            continue
        for start, end in arguments[: 2 if found[1] == "movec" else 1]:
            argument = text[start:end].strip()
            named = assigned.get(argument)
            listed = _LIST.fullmatch(argument)
            if named is None and listed is None:
                left.append(f"{source.path.name}:{line}: {found[1]}({argument}")
                continue
            at = named.start(2) if named else text.index(argument, start)
            is_pose = bool((named or listed)[2 if named else 1])
            places.setdefault((at, is_pose, argument if named else ""), set()).add(tool)
    left += [
        f"{source.path.name}:{source.line(found.start())}: {name} is set more than once"
        for name in assigned
        for found in list(_ASSIGNED.finditer(text))[:-1]
        if found[1] == name and found.start() != assigned[name].start()
    ]
    positions = []
    for (at, is_pose, name), tools in sorted(places.items()):
        numbers = tuple(numbers_in(text, at, text.index("]", at)))
        line = source.line(at)
        position = Position(
            name or f"line {line}",
            0,
            line,
            POSE if is_pose else JOINTS,
            numbers,
            values_at(text, numbers),
            _DECIMALS,
            next(iter(tools)),
            "",
            scale=np.pi / 180.0,
        )
        if len(tools) > 1:
            position = replace(position, refused="is used with different tools")
        positions.append(position)
    return Program(reading.sources, tuple(positions), frames, tuple(left))


def _tool(text: str, arguments: list, assigned: dict, frames: dict, line: int) -> str:
    """Enter the frame of a set_tcp; its name."""
    start, end = arguments[0] if arguments else (0, 0)
    argument = text[start:end].strip()
    found = assigned.get(argument) or _LIST.fullmatch(argument)
    if found is None:
        return argument
    at = start if found.re is _LIST else found.start(2)
    numbers = numbers_in(text, at, text.index("]", at))
    name = f"set_tcp in line {line}"
    frames[TOOL, name] = CONVENTION.pose(values_at(text, numbers))
    return name


def _arguments(text: str, start: int) -> Iterator[tuple[int, int]]:
    """Offsets of the arguments of a call, from behind its opening bracket."""
    depth, begin = 0, start
    for at in range(start, len(text)):
        sign = text[at]
        if sign in "([":
            depth += 1
        elif sign in ")]":
            if depth == 0:
                yield begin, at
                return
            depth -= 1
        elif sign == "," and depth == 0:
            yield begin, at
            begin = at + 1


LANGUAGE = Language("URScript", (".script", ".urscript"), CONVENTION, read)
