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
    moves, tool, near = Moves(), None, {}
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
                moves.use(span, tool, ROBOT)
                if argument and argument[1] and argument[4] in named:
                    near[span] = source.values(source.numbers(*named[argument[4]][-1]))
    for span in moves.uses:
        scale = None if text[span[0]] == "p" else np.pi / 180.0
        name, places = names.get(span, source.line(span[0])), source.numbers(*span)
        position = Position(name, source, places, 6, scale, near_rad=near.get(span))
        moves.positions.append((span, position))
    return moves.program(sources, CONVENTION)


LANGUAGE = Language("URScript", (".script", ".urscript"), CONVENTION, read)
