"""Universal Robots scripts: poses p[..] in m and rad, and joint lists, of the move commands."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kinacc.deployment.programs.orientation import VECTOR, Convention
from kinacc.deployment.programs.record import (
    FIXED_BASE,
    NUMBER,
    TOOL,
    Frames,
    Language,
    Place,
    Position,
    Program,
    Source,
    Use,
    blanked,
    in_use,
)

CONVENTION = Convention(VECTOR, 1e3, 180.0 / np.pi)
_SIX = rf"(?:p?)\[\s*{NUMBER}\s*(?:,\s*{NUMBER}\s*){{5}}\]"
_ASSIGNED = re.compile(rf"^[ \t]*(?:global\s+|local\s+)?(\w+)\s*=\s*({_SIX})", re.M)
_CALL = re.compile(r"\b(move[jlpc]|set_tcp)\s*\(")
_ARGUMENT = re.compile(
    rf"\s*(get_inverse_kin\s*\(\s*)?(?:({_SIX})|(\w+))\s*(?:,\s*(?:qnear\s*=\s*)?(\w+)\s*)?[,)]"
)


def read(sources: Sequence[Source], frames: Frames, _: np.ndarray | None) -> Program:
    """Positions of a script: the targets of its moves, written there or in a variable."""
    (source,) = sources
    text = blanked(source.text, r"#.*", r'"[^"\r\n]*"')
    named: dict[str, list[Place]] = {}
    for item in _ASSIGNED.finditer(text):
        named.setdefault(item[1], []).append(item.span(2))
    names = {span: name for name, spans in named.items() for span in spans}
    frames, tool = {**frames, **FIXED_BASE}, None
    uses: dict[Place, set[Use]] = {}
    near, computed = {}, []
    for call in _CALL.finditer(text):
        start, where = call.end(), source.where(call.start())
        for _number in range(2 if call[1] == "movec" else 1):
            argument = _ARGUMENT.match(text, start)
            if argument is None:
                spans = []
            else:
                start = argument.end()
                spans = [argument.span(2)] if argument[2] else named.get(argument[3], [])
            if call[1] == "set_tcp":
                tool = f"set_tcp in line {where.split(':')[1]}" if spans else "set_tcp"
                if len(spans) == 1:
                    frames[TOOL, tool] = CONVENTION.pose(source.values(source.numbers(*spans[0])))
                break
            if not spans:
                line = text[call.start() :].splitlines()[0]
                computed.append(source.statement(call.start(), line))
                break
            for span in spans:
                uses.setdefault(span, set()).add((tool, "", ""))
                if argument and argument[1] and argument[4] in named:
                    near[span] = source.values(source.numbers(*named[argument[4]][-1]))
    positions = []
    for span in sorted(uses):
        scale = None if text[span[0]] == "p" else np.pi / 180.0
        position = Position("", source, source.numbers(*span), 6, scale, near_rad=near.get(span))
        name = names.get(span, f"line {position.where.split(':')[1]}")
        positions.append(in_use(position, name, uses[span]))
    return Program(sources, positions, frames, computed)


LANGUAGE = Language("URScript", (".script", ".urscript"), CONVENTION, read, robots=("ur",))
