"""Rows of joints, points or poses in a file that a command is given, in mm and rad."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kinacc.config.measured import POSITION
from kinacc.config.names import of_csv
from kinacc.errors import Problem, refuse
from kinacc.geometry import Pose
from kinacc.measurements import faults
from kinacc.measurements.intake import pairs
from kinacc.measurements.intake.choices import Answers
from kinacc.measurements.intake.columns import POSES
from kinacc.measurements.intake.guess import described
from kinacc.measurements.layout import (
    JOINTS,
    FileColumns,
    Layout,
    Place,
    find,
)
from kinacc.measurements.orientation import rotations
from kinacc.measurements.reader import payload, stacked, travel
from kinacc.measurements.table import RawTable


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
        How the file was read, and rows that are left out.
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
    answers: Answers | None = None,
    spoilt: list[Problem] | None = None,
) -> Rows:
    """Rows of a file that must hold ``need``: joints, points or poses.

    A file is read as ``kinacc init`` reads it.

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
    table, layout, notes = _open(path, need, answers)
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
            lines = table.rows_in_words(none)
            notes = (*notes, f"left out, without {need} by their status: {lines}")
            table = table.select(~none)
    cells = problems if spoilt is None else spoilt

    def values(places: Sequence[Place]) -> np.ndarray | None:
        return stacked(table, places, cells, gaps=False) if places else None

    joints, position = values(columns.joints), values(target.position if target else ())
    directions = travel(table, columns, problems) if columns.directions else None
    load = payload(table, columns, cells, gaps=False) if columns.payload else None
    pose = None
    if need == POSES and target and position is not None:
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
    std = values(target.std if target else ())
    return Rows(label, joints, directions, position, pose, std, load, unused, notes, table, columns)


def _label(table: RawTable, columns: FileColumns) -> str | None:
    """The column that names the rows: that of poses, or of texts of which none is there twice."""
    if "pose" in columns.single:
        return columns.single["pose"].column
    for column in columns.unused(table):
        texts = table.texts(column)
        is_text = not np.isfinite(table.values(column)).any() and not table.gaps(column).any()
        if column != "status" and is_text and len({*texts}) == len(texts) and ":" not in texts[0]:
            return column
    return None


def joint_columns(prismatic: np.ndarray, joints: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of reported joints (n, k): q1_deg .., q1_mm where a joint slides (k,)."""
    return {
        f"q{joint + 1}_{'mm' if slides else 'deg'}": values if slides else np.rad2deg(values)
        for joint, (slides, values) in enumerate(zip(prismatic, joints.T, strict=True))
    }


def _open(
    path: str | Path, need: str, answers: Answers | None
) -> tuple[RawTable, Layout, tuple[str, ...]]:
    """A file of ``need``, the meaning of its columns, and notes on how it was understood."""
    answers = {key: value for key, value in (answers or {}).items() if value}
    looked = pairs.look(path, answers, need)
    # Texts of a CSV have an apostrophe that keeps them from being a formula.
    cells = looked.table.columns.map(lambda c: of_csv(c) if isinstance(c, str) else c)
    looked = replace(looked, table=replace(looked.table, columns=cells))
    guess = described(looked, answers, need)
    named = [f"{ours} is {name}" for ours, name in guess.section["columns"].items()
             if name.removeprefix(ours)[:1] not in ("", "_")]  # fmt: skip
    notes = (*guess.notes, *guess.assumed.values(), *filter(None, [", ".join(named)]))
    return guess.table, Layout.of(guess.section), notes
