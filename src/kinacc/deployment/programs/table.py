"""CSV: a line a position; joints q1_deg .. or poses x_mm .. with an orientation by its columns."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from kinacc.deployment.programs.orientation import (
    FIXED,
    INTRINSIC,
    KUKA,
    QUATERNION,
    VECTOR,
    Convention,
)
from kinacc.deployment.programs.record import (
    BASE,
    Frames,
    Language,
    Position,
    Program,
    Source,
)
from kinacc.errors import InputError, Problem
from kinacc.geometry import IDENTITY

_UNITS = {"deg": 1.0, "rad": 180.0 / np.pi, "mm": 1.0, "m": 1e3, "": 1.0}
_TURNS = {
    QUATERNION: ["qw", "qx", "qy", "qz"],
    VECTOR: ["rvx", "rvy", "rvz"],
    INTRINSIC: ["rx", "ry", "rz"],
    KUKA: ["a", "b", "c"],
    FIXED: ["w", "p", "r"],
}
_COLUMN = re.compile(r"(\w+?)(?:_|\s*[\[(])(mm|m|deg|rad)[\])]?")


def read(sources: Sequence[Source], frames: Frames, _: np.ndarray | None) -> Program:
    """Positions of a CSV file: joints where it has them, else poses in the robot's base."""
    (source,) = sources
    head, *lines = source.text.splitlines(keepends=True) or [""]
    mark = next((mark for mark in ";\t" if mark in head), ",")
    cells = [cell.strip('\xef\xbb\xbf" \r\n').lower() for cell in head.split(mark)]
    columns = [_COLUMN.fullmatch(cell) for cell in cells]
    names = [result[1] if result else cell for result, cell in zip(columns, cells, strict=True)]
    unit = {result[1]: _UNITS[result[2]] for result in columns if result}
    keys = sorted(name for name in names if re.fullmatch(r"q[1-9]", name))
    convention = scale = None
    if keys:
        scale = np.array([1.0 / unit.get(key, 1.0) for key in keys])
    else:
        kinds = [kind for kind, turn in _TURNS.items() if {*"xyz", *turn} <= set(names)]
        if not kinds:
            allowed = "q1_deg .., or x_mm .. with qw .., rvx_deg .., rx_deg .., a .. c or w, p, r"
            raise InputError(Problem(f"{source.path}:1", "names no columns of positions", allowed))
        keys = [*"xyz", *_TURNS[kinds[0]]]
        convention = Convention(kinds[0], unit.get("x", 1.0), unit.get(keys[-1], 1.0))
    positions, state = [], len(head)
    for number, line in enumerate(lines, 2):
        row = dict(zip(names, _places(line, mark, state), strict=False))
        state += len(line)
        if not line.strip():
            continue
        try:
            label = source.text[slice(*row["pose"])] if "pose" in names else f"line {number}"
            places = [row[key] for key in keys]
            source.values(places)
        except (KeyError, ValueError):
            message = f"has no number in a column of {', '.join(keys)}"
            raise InputError(Problem(f"{source.path}:{number}", message)) from None
        positions.append(Position(label, source, places, 6, scale, tool="", base=""))
    return Program(sources, positions, {**frames, (BASE, ""): IDENTITY}, convention=convention)


def _places(line: str, mark: str, at: int) -> list[tuple[int, int]]:
    """Where the cells of a line are, without spaces and quotes around them."""
    result = re.finditer(rf'[ \t]*"?([^{mark}"\r\n]*?)"?\s*(?:{mark}|$)', line.rstrip("\r\n"))
    return [(at + cell.start(1), at + cell.end(1)) for cell in result][: line.count(mark) + 1]


LANGUAGE = Language("CSV", (".csv",), Convention(FIXED), read)
