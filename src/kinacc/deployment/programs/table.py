"""CSV: a line a position; joints q1_deg .. or poses x_mm .. with an orientation by its columns."""

from __future__ import annotations

import re

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
    JOINTS,
    NUMBER,
    POSE,
    Language,
    Place,
    Position,
    Program,
    Reading,
    Source,
)
from kinacc.errors import InputError, Problem
from kinacc.geometry import IDENTITY

_DECIMALS = 6
_DEGREES = {"deg": 1.0, "rad": 180.0 / np.pi, "": 1.0}
_LENGTHS = {"mm": 1.0, "m": 1e3, "": 1.0}
_TURNS = {
    QUATERNION: ("qw", "qx", "qy", "qz"),
    VECTOR: ("rvx", "rvy", "rvz"),
    INTRINSIC: ("rx", "ry", "rz"),
    KUKA: ("a", "b", "c"),
    FIXED: ("w", "p", "r"),
}


def read(reading: Reading) -> Program:
    """Positions of a CSV file: joints where it has them, else poses in the robot's base."""
    (source,) = reading.sources
    lines = source.text.splitlines(keepends=True)
    head = lines[0].removeprefix("\xef\xbb\xbf") if lines else ""
    delimiter = next((mark for mark in ";\t" if mark in head), ",")
    columns = [_named(cell) for cell in head.split(delimiter)]
    names = [name for name, _ in columns]
    joints = [name for name in names if re.fullmatch(r"q[1-9]", name)]
    if twice := {name for name in names if name and names.count(name) > 1}:
        raise InputError(Problem(f"{source.path}:1", f"has two columns of {', '.join(twice)}"))
    convention, keys = None, sorted(joints)
    units = dict(columns)
    if not joints:
        turn = next((key for key, own in _TURNS.items() if all(n in names for n in own)), None)
        if turn is None or not all(name in names for name in "xyz"):
            allowed = "q1_deg .., or x_mm .. with qw .., rvx_deg .., rx_deg .., a .. c or w, p, r"
            raise InputError(Problem(f"{source.path}:1", "names no columns of positions", allowed))
        keys = ["x", "y", "z", *_TURNS[turn]]
        degrees = 1.0 if turn == QUATERNION else _DEGREES[units[keys[-1]]]
        convention = Convention(turn, _LENGTHS[units["x"]], degrees)
    positions, offset = [], len(lines[0])
    for number, line in enumerate(lines[1:], 2):
        if line.strip():
            cells = _cells(source, number, line, offset, delimiter)
            positions.append(_position(source, number, cells, names, keys, units, bool(joints)))
        offset += len(line)
    return Program(reading.sources, tuple(positions), {(BASE, ""): IDENTITY}, convention=convention)


def _named(cell: str) -> tuple[str, str]:
    """Name and unit of a column."""
    text = cell.strip().strip('"').lower()
    found = re.fullmatch(r"(\w+?)(?:_|\s*[\[(])(mm|m|deg|rad)[\])]?", text)
    return (found[1], found[2]) if found else (text, "")


def _cells(source: Source, number: int, line: str, offset: int, delimiter: str) -> list[Place]:
    if '"' in line and delimiter in "".join(re.findall(r'"([^"]*)"', line)):
        raise InputError(Problem(f"{source.path}:{number}", "has a delimiter within quotes"))
    places = []
    for cell in line.rstrip("\r\n").split(delimiter):
        text = cell.strip().strip('"')
        start = offset + cell.find(text)
        places.append(Place(start, start + len(text)))
        offset += len(cell) + 1
    return places


def _position(
    source: Source,
    number: int,
    cells: list[Place],
    names: list[str],
    keys: list[str],
    units: dict[str, str],
    is_joints: bool,
) -> Position:
    where = f"{source.path}:{number}"
    if len(cells) < len(names):
        raise InputError(Problem(where, f"has {len(cells)} cells", f"{len(names)}, as the head"))
    places = tuple(cells[names.index(key)] for key in keys)
    texts = [source.text[slice(*place)].replace(",", ".") for place in places]
    for key, text in zip(keys, texts, strict=True):
        if not re.fullmatch(NUMBER, text):
            raise InputError(Problem(f"{where}, column {key}", f"{text!r} is no number"))
    label = source.text[slice(*cells[names.index("pose")])] if "pose" in names else f"line {number}"
    factors = {**_DEGREES, **_LENGTHS}
    scale = np.array([1.0 / factors[units[key]] for key in keys]) if is_joints else 1.0
    return Position(
        label,
        0,
        number,
        JOINTS if is_joints else POSE,
        places,
        np.array([float(text) for text in texts]),
        (_DECIMALS,) * len(keys),
        None if is_joints else "",
        "",
        scale=scale,
    )


LANGUAGE = Language("CSV", (".csv",), Convention(FIXED), read)
