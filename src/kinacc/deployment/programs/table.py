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
    Orientation,
)
from kinacc.deployment.programs.record import (
    ROBOT,
    Language,
    Position,
    Program,
    Source,
)
from kinacc.errors import input_error

_UNITS = {"rad": 180.0 / np.pi, "m": 1e3}  # deg and mm where not stated
_KEYS: dict[Orientation, str] = {
    QUATERNION: "x y z qw qx qy qz",
    VECTOR: "x y z rvx rvy rvz",
    INTRINSIC: "x y z rx ry rz",
    KUKA: "x y z a b c",
    FIXED: "x y z w p r",
}
_COLUMN = re.compile(r"(\w+?)(?:(?:_|\s*[\[(])(mm|m|deg|rad)[\])]?)?")


def read(sources: Sequence[Source], _: np.ndarray | None) -> Program:
    """Positions of a CSV file: joints where it has them, else poses in the robot's base."""
    (source,) = sources
    lines = [*re.finditer(r"[^\r\n]*\S[^\r\n]*", source.text)]
    head = lines[0][0] if lines else ""
    separator = next((sign for sign in ";\t" if sign in head), ",")
    names, units = [], {}
    for cell in head.split(separator):
        column = _COLUMN.fullmatch(cell.strip('\xef\xbb\xbf" ').lower())
        names.append(column[1] if column else cell)
        units[names[-1]] = _UNITS.get(column[2] if column else "", 1.0)
    convention, scale = Convention(FIXED), None
    if keys := sorted(name for name in units if re.fullmatch(r"q[1-9]", name)):
        scale = np.array([1.0 / units[key] for key in keys])
    elif kind := next((kind for kind in _KEYS if {*_KEYS[kind].split()} <= {*units}), None):
        keys = _KEYS[kind].split()
        convention = Convention(kind, units["x"], units[keys[-1]])
    else:
        allowed = "q1_deg .., or x_mm .. with qw .., rvx_deg .., rx_deg .., a .. c or w, p, r"
        raise input_error(f"{source.path}:1", "names no columns of positions", allowed)
    positions = []
    cells = re.compile(rf'[ \t]*"?([^{separator}"\r\n]*?)"?[ \t]*(?:{separator}|$)', re.M)
    for line in lines[1:]:
        spans = [cell.span(1) for cell in cells.finditer(source.text, *line.span())]
        row = dict(zip(names, spans, strict=False))
        try:
            places = [row[key] for key in keys]
            source.values(places)
        except (KeyError, ValueError):
            message = f"has no number in a column of {', '.join(keys)}"
            where = source.path.parent / source.where(line.start())
            raise input_error(str(where), message) from None
        label = source.text[slice(*row["pose"])] if "pose" in row else source.line(line.start())
        positions.append(Position(label, source, places, 6, scale, "", ROBOT))
    return Program(sources, positions, convention)


LANGUAGE = Language("CSV", (".csv",), Convention(FIXED), read)
