"""Universal Robots scripts: poses p[..] in m and rad, and joint lists, of the move commands."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from kinacc.deployment.programs.orientation import VECTOR, Convention
from kinacc.deployment.programs.record import (
    NUMBER,
    ROBOT,
    TOOL,
    Language,
    Moves,
    Place,
    Position,
    Program,
    Source,
    blanked,
)

CONVENTION = Convention(VECTOR, 1e3, 180.0 / np.pi)
_SIX = rf"(?:p?)\[\s*{NUMBER}\s*(?:,\s*{NUMBER}\s*){{5}}\]"
_ASSIGNED = re.compile(rf"^[ \t]*(?:global\s+|local\s+)?(\w+)\s*=\s*({_SIX})", re.M)
_CALL = re.compile(r"\b(move[jlpc]|set_tcp)\s*\(")
_ARGUMENT = re.compile(
    rf"\s*(get_inverse_kin\s*\(\s*)?(?:({_SIX})|(\w+))\s*(?:,\s*(?:qnear\s*=\s*)?(\w+)\s*)?[,)]"
)


def read(sources: Sequence[Source], _: np.ndarray | None) -> Program:
    """Positions of a script: the targets of its moves, written there or in a variable."""
    (source,) = sources
    text = blanked(source.text, r"#.*", r'"[^"\r\n]*"')
    names = {item.span(2): item[1] for item in _ASSIGNED.finditer(text)}
    named: dict[str, list[Place]] = defaultdict(list)
    for place, name in names.items():
        named[name].append(place)
    moves, tool = Moves(), None
    for call in _CALL.finditer(text):
        start = call.end()
        for _number in range(2 if call[1] == "movec" else 1):
            argument = _ARGUMENT.match(text, start)
            spans = []
            if argument:
                start = argument.end()
                spans = [argument.span(2)] if argument[2] else named.get(argument[3], [])
            if call[1] == "set_tcp":
                tool = f"set_tcp in {source.line(call.start())}" if spans else "set_tcp"
                if len(spans) == 1:
                    frame = CONVENTION.pose(source.values(source.numbers(*spans[0])))
                    moves.frames[TOOL, tool] = frame
            elif not spans:
                line = text[call.start() :].splitlines()[0]
                moves.not_corrected.append(source.statement(call.start(), line))
                break
            for span in spans if call[1] != "set_tcp" else ():
                if span not in moves.uses:
                    near = named.get(argument[4]) if argument and argument[1] else None
                    moves.positions.append((span, _position(source, span, names.get(span), near)))
                moves.use(span, tool, ROBOT)
    return moves.program(sources, CONVENTION)


def _position(
    source: Source, span: Place, name: str | None, near: Sequence[Place] | None
) -> Position:
    """The position written at ``span``; ``near``: where joints near to it are written."""
    near_rad = source.values(source.numbers(*near[-1])) if near else None
    scale = None if source.text[span[0]] == "p" else np.pi / 180.0
    places = source.numbers(*span)
    return Position(name or source.line(span[0]), source, places, 6, scale, near_rad=near_rad)


LANGUAGE = Language("URScript", (".script", ".urscript"), CONVENTION, read)
