"""Joints out of robots' own programs and records: ABB, KUKA, FANUC, Yaskawa.

A program says where an arm was sent. Its cartesian positions are what the controller was told and
no measurement; its joint positions are those of a pose, which a tracker's file may name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.errors import first_few, input_error
from kinacc.measurements.table import RawTable, frame

_SUFFIXES = (".mod", ".sys", ".prg", ".dat", ".src", ".ls", ".jbi", ".txt", "")
_MOST_BYTES = 20_000_000
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_ABB = re.compile(r"\b(jointtarget|robtarget)\s+(\w+)\s*:=\s*\[\s*\[([^\]]*)\]", re.IGNORECASE)
_KUKA = re.compile(
    r"(?:\b(?:E6AXIS|AXIS|E6POS|POS|FRAME)\s+(\w+)\s*=|\b(?:PTP|LIN|SPTP|SLIN)\b)\s*"
    r"(\{[^}]*\})", re.IGNORECASE
)  # fmt: skip
_FANUC = re.compile(r"^\s*P\[\s*(\d+)[^\]]*\]\s*\{(.*?)\}\s*;", re.DOTALL | re.MULTILINE)
_YASKAWA = re.compile(r"^\s*(B?C\d+|P\d+)\s*=\s*([-+\d.,\s]+)$", re.MULTILINE)
_KUKA_PARTS = re.compile(rf"\b([A-Z]\d?)\s+({_NUMBER})", re.IGNORECASE)
_FANUC_JOINT = re.compile(rf"\bJ(\d)\s*=\s*({_NUMBER})\s*(?:deg|mm)?", re.IGNORECASE)
_FLAT = re.compile(rf"p?\[\s*{_NUMBER}(?:\s*,\s*{_NUMBER})+\s*\]")
_KIND = re.compile(r"\{\s*(\w+)\s*:")
_LIST = re.compile(r"(?:p?\[.*\]|\{.*\})", re.DOTALL)
_INNERMOST = re.compile(r"\[([^\[\]]*)\]")
_POSE_PARTS = ("trans x", "trans y", "trans z", "rot q1", "rot q2", "rot q3", "rot q4")
_UNUSED = 9e8  # ABB writes 9E9 for an axis that is not there
_TARGETS = "cartesian positions, which say where the arm was sent: they are no joints, and not read"
_HORIZONTAL = (
    "FANUC counts joint 3 from the horizontal: the arm's own is J3 plus J2, as joint_map of its "
    "robot file says; check-data holds that to the points"
)
Position = tuple[str, int, list[float]]  # name, place in the text, joints (none of a pose)


def read(path: Path) -> RawTable | None:
    """The joints of a program, one row per position; None where the file is none.

    Raises InputError where its positions are cartesian only.
    """
    if path.suffix.lower() not in _SUFFIXES or path.stat().st_size > _MOST_BYTES:
        return None
    text = path.read_bytes().decode("utf-8", errors="replace")
    for maker in (_of_abb, _of_kuka, _of_fanuc, _of_yaskawa):
        if positions := maker(text):
            break
    else:
        return None
    rows = [position for position in positions if position[2]]
    cartesian = [name for name, _, joints in positions if not joints]
    if not rows:
        allowed = "joint positions: jointtarget, E6AXIS, J1 .. J6 of P[n], pulses of a job"
        fix = "record the joints at each pose, or give the points alone with a file of joints"
        message = f"holds {len(cartesian)} {_TARGETS}"
        raise input_error(str(path), message, allowed, fix)
    names = _NAMES.get(maker, [f"J{number} [deg]" for number in range(1, 8)])
    notes = [_HORIZONTAL] if maker is _of_fanuc else []
    notes += [f"{path}: {first_few(cartesian)}: {_TARGETS}"] if cartesian else []
    lines = np.array([text.count("\n", 0, place) + 1 for _, place, _ in rows])
    widths = np.array([len(joints) for _, _, joints in rows])
    odd = (widths != widths.min()) | (widths < 4) | (widths > 7)
    if odd.any():
        where = f"{path}: lines {first_few([*lines[odd]])}"
        raise input_error(where, "another number of joints", "4 to 7, the same in all")
    columns = {"name": [name for name, _, _ in rows]}
    columns |= {names[n]: [repr(joints[n]) for _, _, joints in rows] for n in range(widths[0])}
    return RawTable(str(path), frame(columns), lines, notes=tuple(notes))


def _of_abb(text: str) -> list[Position]:
    return [
        (m[2], m.start(),
         [n for n in _floats(m[3]) if abs(n) < _UNUSED] if m[1][0] in "jJ" else [])
        for m in _ABB.finditer(text)
    ]  # fmt: skip


def _of_kuka(text: str) -> list[Position]:
    matches = [(m, parts) for m in _KUKA.finditer(text) if (parts := _parts(m[2]))]
    return [
        (re.sub("^[xX]", "", m[1] or f"P{count}"), m.start(),
         [parts[f"A{n}"] for n in range(1, 8) if f"A{n}" in parts])
        for count, (m, parts) in enumerate(matches, 1)
    ]  # fmt: skip


def _of_fanuc(text: str) -> list[Position]:
    positions = []
    for match in _FANUC.finditer(text):
        first_group = re.split(r"GP[2-9]\s*:", match[2])[0]
        row = [float(value) for _, value in sorted(_FANUC_JOINT.findall(first_group))]
        positions.append((f"P[{match[1]}]", match.start(1), row))
    return positions


def _of_yaskawa(text: str) -> list[Position]:
    if "/JOB" not in text or "///PULSE" not in text:
        return []
    return [(match[1], match.start(1), _floats(match[2])) for match in _YASKAWA.finditer(text)]


def _floats(text: str) -> list[float]:
    return [float(number) for number in re.findall(_NUMBER, text)]


def _parts(text: str) -> dict[str, float]:
    return {name.upper(): float(value) for name, value in _KUKA_PARTS.findall(text)}


def expanded(table: RawTable) -> RawTable:
    """The table with cells such as {A1 10, A2 -90 ..} and [[10,-90,..],[9E9,..]] as columns."""
    columns: dict[str, Iterable[Any]] = {}
    for name, cells in table.columns.items():
        first = parts_of(cells[0])
        rows = [parts_of(cell) for cell in cells] if first else []
        if rows and all(row.keys() == first.keys() for row in rows):
            columns |= {f"{name} {part}": [repr(row[part]) for row in rows] for part in first}
        else:
            columns[str(name)] = cells
    return replace(table, columns=frame(columns))


def parts_of(cell: object) -> dict[str, float]:
    """Numbers of a cell such as {A1 10, A2 -90}, [[10,-90],[9E9]] or p[0.1,0.2], by their names.

    Those of a list are x, y, z where there are three, else called by their place. An ABB target has
    joints, [[6],[6]], or a pose, [[3],[4],..]; axes that are not there are left out. Empty for any
    other cell.
    """
    text = cell.strip() if isinstance(cell, str) else ""
    if not _LIST.fullmatch(text):
        return {}
    if text.startswith("{"):
        return _parts(text)
    values, *groups = [_floats(group) for group in _INNERMOST.findall(text)] or [[]]
    if not text.startswith("[["):
        values = values if _FLAT.fullmatch(text) else []
        names = [*"xyz"] if len(values) == 3 else [str(n) for n in range(1, len(values) + 1)]
        return dict(zip(names, values, strict=True))
    if groups and len(values) == 3 and len(groups[0]) == 4:
        return dict(zip(_POSE_PARTS, values + groups[0], strict=True))
    return {f"rax_{n}": value for n, value in enumerate(values, 1) if value < _UNUSED}


def names_of_rows(rows: Sequence[Sequence[Any]]) -> tuple[str, ...]:
    """Names of columns whose cells name their parts, as {E6AXIS: A1 10, ..}: by the word before.

    A first column of texts names the poses; a frame that no word calls measured is one of the
    controller's. Nothing where a column of numbers has no name.
    """
    names, word = list[str](), ""
    for place, column in enumerate(zip(*rows, strict=True)):
        matches = [_KIND.match(str(cell).strip()) for cell in column]
        kinds = {match[1].upper() if match else "" for match in matches}
        if kinds <= {"E6AXIS", "AXIS"}:
            name, word = f"{word} joints".strip(), ""
        elif kinds <= {"E6POS", "POS", "FRAME"}:
            name, word = f"{word} position" if word else "TCP position", ""
        elif any(re.fullmatch(_NUMBER, str(cell).strip()) for cell in column):
            return ()
        else:
            name = "Point" if place == 0 else f"word {place + 1}"
            word = str(column[0]) if len({*column}) == 1 else ""
        names.append(name)
    return tuple(names) if len({*names}) == len(names) else ()


_NAMES = {
    _of_kuka: [f"A{number} [deg]" for number in range(1, 8)],
    _of_yaskawa: [f"{letter} [pulse]" for letter in "SLURBTE"],
}
