"""Universal Robots scripts: poses p[..] in m and rad, and joint lists, of the move commands."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kinacc.deployment.programs.orientation import VECTOR, Convention
from kinacc.deployment.programs.record import (
    BASE,
    NUMBER,
    SEVERAL,
    TOOL,
    Frames,
    Language,
    Position,
    Program,
    Source,
    blanked,
)
from kinacc.geometry import IDENTITY

CONVENTION = Convention(VECTOR, 1e3, 180.0 / np.pi)
_SIX = rf"(p?)\[\s*{NUMBER}\s*(?:,\s*{NUMBER}\s*){{5}}\]"
_ASSIGNED = re.compile(rf"^[ \t]*(?:global\s+|local\s+)?(\w+)\s*=\s*({_SIX})", re.M)
_CALL = re.compile(r"\b(move[jlpc]|set_tcp)\s*\(")
_ARGUMENT = re.compile(
    rf"\s*(get_inverse_kin\s*\(\s*)?(?:({_SIX})|(\w+))\s*(?:,\s*(?:qnear\s*=\s*)?(\w+)\s*)?[,)]"
)


def read(sources: Sequence[Source], frames: Frames, _: np.ndarray | None) -> Program:
    """Positions of a script: the targets of its moves, written there or in a variable."""
    (source,) = sources
    text = blanked(source.text, r"#.*", r'"[^"\r\n]*"')
    named: dict[str, list[tuple[int, int]]] = {}
    for item in _ASSIGNED.finditer(text):
        named.setdefault(item[1], []).append(item.span(2))
    frames = {**frames, (BASE, ""): IDENTITY}
    tool, uses, near, computed = None, {}, {}, []
    for call in _CALL.finditer(text):
        state, where = call.end(), source.where(call.start())
        for _number in range(2 if call[1] == "movec" else 1):
            result = _ARGUMENT.match(text, state)
            spans = (
                [result.span(2)]
                if result and result[2]
                else named.get(result[4], [])
                if result
                else []
            )
            if call[1] == "set_tcp":
                tool = f"set_tcp in line {where.split(':')[1]}" if spans else "set_tcp"
                if len(spans) == 1:
                    frames[TOOL, tool] = CONVENTION.pose(source.values(source.numbers(*spans[0])))
            elif not spans:
                computed.append(f"{where}: {text[call.start() :].splitlines()[0]}")
                break
            for span in spans if call[1] != "set_tcp" else ():
                uses.setdefault(span, set()).add(tool)
                if result[1] and result[5] in named:
                    near[span] = source.values(source.numbers(*named[result[5]][-1]))
            state = result.end() if result else state
    names = {span: name for name, spans in named.items() for span in spans}
    return Program(
        sources,
        [
            Position(
                names.get(span, f"line {source.where(span[0]).split(':')[1]}"),
                source,
                source.numbers(*span),
                6,
                None if text[span[0]] == "p" else np.pi / 180.0,
                next(iter(tools)),
                "",
                near_rad=near.get(span),
                refused=SEVERAL if len(tools) > 1 else "",
            )
            for span, tools in sorted(uses.items())
        ],
        frames,
        computed,
    )


LANGUAGE = Language("URScript", (".script", ".urscript"), CONVENTION, read)
