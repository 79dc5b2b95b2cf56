"""Rows of joints, points or poses in a file that a command is given, in mm and rad."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kinacc.config import json_files
from kinacc.config.measured import Orientation
from kinacc.config.names import of_csv
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose
from kinacc.measurements import faults
from kinacc.measurements.files import EXCEL, PARQUET, load, opened, refuse_other_files
from kinacc.measurements.layout import (
    ANGLE,
    JOINTS,
    LENGTH,
    POSITION,
    TOOL,
    FileColumns,
    Layout,
    find,
)
from kinacc.measurements.orientation import rotations
from kinacc.measurements.reader import payload, stacked, travel
from kinacc.measurements.table import RawTable, frame

POINTS, POSES = "points", "poses"
_FIRST_NAMES = {  # of a file under our names
    JOINTS: r"q1_(?:deg|rad|mm|m)",
    POINTS: r"e?x_(?:mm|m)",
    POSES: r"(?:qw|rv?x_(?:deg|rad))",
}
_TURNS = {"quaternion": "qw", "rotation_vector": "rvx", "euler": "rx"}
_HEAD = 1_000_000  # characters of a line looked at


@dataclass(frozen=True)
class Rows:
    """Quantities of the n rows of a file; None where the file has no such columns.

    Attributes
    ----------
    label
        The file's names of poses, or the line of each row, shape (n,).
    joints
        Reported joints, shape (n, k), rad or mm.
    directions
        Directions of travel of the joints, shape (n, k).
    position_mm, std_mm
        Points and their standard deviations, shape (n, 3).
    pose
        Poses; only where poses were asked for.
    payload
        Mass and centre, shape (n, 4), kg and mm.
    unused
        Columns that are not used.
    notes
        How a file under other names than ours was read, and rows that are left out.
    table, columns
        The file, and its columns.
    """

    label: np.ndarray
    joints: np.ndarray | None = None
    directions: np.ndarray | None = None
    position_mm: np.ndarray | None = None
    pose: Pose | None = None
    std_mm: np.ndarray | None = None
    payload: np.ndarray | None = None
    unused: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    table: RawTable | None = None
    columns: FileColumns | None = None


def read_rows(
    path: str | Path,
    prismatic: np.ndarray,
    need: str = JOINTS,
    answers: Mapping | None = None,
    spoilt: list[Problem] | None = None,
) -> Rows:
    """Rows of a file that must hold ``need``: joints, points or poses.

    A file under our names (``q1_deg``, ``x_mm``, ``qw``, ``rvx_deg``, ``rx_deg`` ..) is read by
    them, any other as ``kinacc init`` reads it.

    Parameters
    ----------
    prismatic
        Whether each joint slides, shape (k,).
    answers
        What the file leaves open, by option of ``kinacc init``.
    spoilt
        Receives the cells that are no numbers, which then are NaN; by default they are an error.

    Raises
    ------
    InputError
        Listing every problem, or the questions that the file leaves open.
    """
    table, layout, notes = open_table(path, need, answers)
    problems: list[Problem] = []
    columns = find(table, layout, prismatic, problems, (JOINTS if need == JOINTS else POSITION,))
    target = next(iter(columns.targets), None) if need != JOINTS else None
    if need == POSES and target and not target.turn and not problems:
        allowed = "qw .. qz, or rvx_deg .. rvz_deg, or rx_deg .. rz_deg (or rad)"
        problems.append(Problem(f"{table.path}: orientation", "is missing", allowed))
    refuse(problems, f"{table.path} cannot be used")
    measured = columns.joints if target is None else (*target.position, *target.turn)
    if "status" in table.columns:  # of a command's answer: why a row has none
        none = np.all([table.gaps(place.column) for place in measured], axis=0)
        none &= ~table.gaps("status")
        if none.any() and not none.all():
            lines = table.rows_in_words(np.flatnonzero(none))
            notes = (*notes, f"left out, without {need} by their status: {lines}")
            table = table.select(np.flatnonzero(~none))
    cells = problems if spoilt is None else spoilt

    def values(places) -> np.ndarray | None:
        return stacked(table, places, cells, gaps=False) if places else None

    joints, position = values(columns.joints), values(target and target.position)
    directions = travel(table, columns, problems) if columns.directions else None
    load = values(columns.payload) if columns.payload else None
    load = payload(table, columns, problems) if load is not None else None
    pose = None
    if need == POSES and target:
        turn = stacked(table, target.turn, cells, gaps=False)
        if layout.orientation.kind == "quaternion":
            problems += faults.quaternion_problems(table, turn, target.turn)
        with np.errstate(invalid="ignore"):
            pose = Pose(rotations(np.nan_to_num(turn, nan=0.5), layout.orientation), position)
    refuse(problems, f"{table.path} cannot be used")
    label, name = table.line, _label(table, columns)
    if name is not None:
        label = np.array([text.removesuffix(".0") for text in table.texts(name)], dtype=object)
    unused = tuple(column for column in columns.unused(table) if column != name)
    std = values(target and target.std)
    return Rows(label, joints, directions, position, pose, std, load, unused, notes, table, columns)


def _label(table: RawTable, columns: FileColumns) -> str | None:
    """The column that names the rows: that of poses, or of texts of which none is there twice."""
    if "pose" in columns.single:
        return columns.single["pose"].column
    for column in columns.unused(table):
        texts = table.texts(column)
        is_text = not table.is_numbered(column) and not table.gaps(column).any()
        if column != "status" and is_text and len({*texts}) == len(texts) and ":" not in texts[0]:
            return column
    return None


def open_table(
    path: str | Path, need: str = POINTS, answers: Mapping | None = None
) -> tuple[RawTable, Layout, tuple[str, ...]]:
    """A file of ``need``, the meaning of its columns, and notes on how it was understood.

    Files that commands write are read as well: JSON, and text of a CSV with the apostrophe that
    keeps it from being a formula.
    """
    path = Path(path)
    refuse_other_files(path)
    kind = path.suffix.lower()
    if kind == ".json":
        table = _of_json(path)
        return table, _plain_layout(table, need), ()
    if kind in PARQUET:
        table = load(path)
        names = {name: f"{name}_{unit}" for name, unit in table.units.items()
                 if re.fullmatch(r"q\d+", name) and unit in (*ANGLE, *LENGTH)}  # fmt: skip
        names = {name: whole for name, whole in names.items() if whole not in table.columns}
        table = replace(table, columns=table.columns.rename(columns=names))
        return table, _plain_layout(table, need), ()
    if kind in EXCEL:
        if re.search(rf"^{_FIRST_NAMES[need]}$", "\n".join((table := load(path)).columns), re.M):
            return table, _plain_layout(table, need), ()
    else:
        with opened(path, "utf-8") as file:
            head, first = file.readline(_HEAD), file.readline(_HEAD)
        if re.search(rf"(?<![^\s,;\"']){_FIRST_NAMES[need]}(?![^\s,;\"'])", head):
            delimiter = next((sign for sign in ";\t" if sign in head), ",")
            comma = delimiter == ";" and "," in first and "." not in first
            table = load(path, Layout(delimiter=delimiter, decimal="," if comma else "."))
            table = replace(table, columns=table.columns.map(of_csv))
            return table, _plain_layout(table, need), ()
    from kinacc.measurements.intake import guess as guesses

    answers = {key: value for key, value in (answers or {}).items() if value}
    guess = guesses.look(path, answers, need)
    notes = (*guess.notes, *guess.assumed.values(), *guess.columns.lines())
    return guess.table, Layout.of(guess.section), notes


def _plain_layout(table: RawTable, need: str) -> Layout:
    """The layout of a table under our names, by the kind of its orientations."""
    names = set(table.columns)
    kinds = [kind for kind, name in _TURNS.items()
             if need == POSES and names & {name, f"{name}_deg", f"{name}_rad"}]  # fmt: skip
    if len(kinds) > 1:
        message = "is given in more than one form"
        raise InputError(Problem(f"{table.path}: orientation", message, "one form"))
    kind = next(iter(kinds), "none")
    unit = next((unit for unit in ANGLE if f"rvx_{unit}" in names), "deg")
    vector = {f"r{axis}": f"rv{axis}_{unit}" for axis in "xyz"}
    columns = vector if kind == "rotation_vector" else {}
    turn = Orientation(kind=kind, unit=unit)
    return Layout().but(columns=columns, orientation=turn, targets=[TOOL])


def _of_json(path: Path) -> RawTable:
    """The rows of an answer that a command gave as JSON."""
    try:
        content = json_files.bytes_of(path)
        rows = json_files.values_of(content, str(path))["rows"]
        columns = {name: [row.get(name) for row in rows] for name in rows[0]}
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError):
        allowed = "a table of rows, as commands write with -o NAME.json"
        raise InputError(Problem(str(path), "holds no rows", allowed)) from None
    return RawTable(str(path), frame(columns), np.arange(1, len(rows) + 1))
