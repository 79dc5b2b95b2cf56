"""Joints alone, in whatever form a file of poses to measure has: a table or a robot's program."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.column_names import Name, name_of
from kinacc.measurements.intake import columns, motor_pulses, text
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import NamedColumns
from kinacc.measurements.intake.decimals import shaped_as_number
from kinacc.measurements.layout import ANGLE, LENGTH
from kinacc.measurements.table import RawTable, numbers

_NAMING = "name them q1_deg, q2_deg .. in the file, or by --names where it has no names"
_FULL_TURN_RAD = 2.0 * np.pi * 1.05


class JointFile(NamedTuple):
    """``joints`` (n, k) in rad (mm where a joint slides), ``label`` (n,) of the rows, and ``told``,
    words on how they were read."""

    joints: np.ndarray
    label: np.ndarray
    told: tuple[str, ...]


def read(path: str | Path, prismatic: np.ndarray, answers: Mapping) -> JointFile:
    """The joints of a file; ``prismatic`` (k,): which of the robot's slide.

    ``answers`` to choices by key (``joint_unit`` and ``take`` among them). Raises Undecided where
    the file can be read in more than one way, InputError where its joints cannot be found or are
    no numbers.
    """
    looked = text.look(path, answers)
    table = looked.table
    units = table.under or ("",) * len(table.columns)
    names = [name_of(c, u) for c, u in zip(table.columns, units, strict=False)]
    take: Sequence[str] = tuple(answers.get("take", ()))

    def values(name: Name) -> np.ndarray:
        return numbers(table, name.column, [], gaps=True)

    found = _found(table, columns.recognise(names, values, take, False), names, values)
    pulses = motor_pulses.pulses(found, values, answers, table.path)
    joints = pulses.found.joints
    if len(joints) != len(prismatic):
        what = f"{len(joints)} joints: {', '.join(each.column for each in joints)}"
        raise InputError(Problem(table.path, what, f"{len(prismatic)}, as the robot has"))
    empty = np.all([table.gaps(each.column) for each in joints], axis=0)
    told = [*looked.told, *table.notes, *pulses.told]
    if empty.any() and not empty.all():
        told.append(f"left out, without joints: {table.rows_in_words(np.flatnonzero(empty))}")
        table = table.select(np.flatnonzero(~empty))
    if pulses.per_deg:
        factors = ANGLE["deg"] / np.array(pulses.per_deg)
    else:
        factors = _factors(table, joints, prismatic, answers, told)
    problems: list[Problem] = []
    read_ = np.stack([numbers(table, each.column, problems) for each in joints], axis=1) * factors
    refuse(problems, f"{table.path} cannot be used")
    told.insert(0, f"joints are {', '.join(each.column for each in joints)}")
    return JointFile(read_, _labels(table, found), tuple(dict.fromkeys(told)))


def _found(table: RawTable, found: NamedColumns, names: Sequence[Name], values) -> NamedColumns:
    """The columns with joints chosen: the only ones that may be meant, commanded ones included."""
    open_ = [each for each in found.questions if each.about == "the joints"]
    if open_ and len(open_[0].readings) == 1:
        return columns.recognise(names, values, (open_[0].readings[0].names[0],), False)
    if open_:
        readings = "; or ".join(each.in_words() for each in open_[0].readings)
        ways = [f"--take {shlex.quote(each.names[0])}" for each in open_[0].readings]
        what = f"the names do not tell the joints: {open_[0].why}: {readings}"
        raise InputError(Problem(table.path, what, fix=f"give {' or '.join(ways)}"))
    if not found.joints:
        there = f"the file has {', '.join(table.columns)}"
        what = "no columns of 4 to 7 joints were found"
        raise InputError(Problem(table.path, what, fix=f"{there}; {_NAMING}"))
    return NamedColumns(found.joints, single=found.single)


def _factors(
    table: RawTable, joints: Sequence[Name], prismatic: np.ndarray, answers: Mapping, told: list
) -> np.ndarray:
    """Factors (k,) to rad and mm by the units stated, answered, or left by the size of numbers."""
    stated = {each.unit for each in joints if each.unit in ANGLE}
    given = answers.get("joint_unit")
    listed = f"{joints[0].column} .. {joints[-1].column}"
    if len(stated) > 1 or (given and stated - {given}):
        said = " and ".join(sorted(stated))
        where = f"--joint-unit {given}" if given else table.path
        raise InputError(Problem(where, f"columns {listed} are in {said}", "one unit for all"))
    turning = [
        float(np.nanmax(np.abs(numbers(table, each.column, [], gaps=True)), initial=0.0))
        for each, slides in zip(joints, prismatic, strict=True)
        if not slides
    ]
    unit = given or next(iter(stated), "")
    if not unit and max(turning, default=0.0) > _FULL_TURN_RAD:
        unit = "deg"
        told.append(f"{listed} are in deg: the largest number is {max(turning):.4g}")
    if not unit and turning:
        about = f"{listed} do not tell their unit, and the largest number is {max(turning):.4g}"
        meant = {"rad": "radians", "deg": "degrees, of an arm that hardly moves"}
        raise Undecided(table.path, [Choice("--joint-unit", about, meant)])
    return np.array(
        [
            LENGTH[each.unit if each.unit in LENGTH else "mm"] if slides else ANGLE[unit]
            for each, slides in zip(joints, prismatic, strict=True)
        ]
    )


def _labels(table: RawTable, found: NamedColumns) -> np.ndarray:
    """Names of the rows where a column has another for each, else their lines."""
    named = [found.single["pose"].column] if "pose" in found.single else []
    for column in (*named, *table.columns):
        label = [str(cell).strip() for cell in table.columns[column]]
        texts = column in named or not any(map(_is_number_or_time, label))
        if texts and not table.gaps(column).any() and len({*label}) == len(label):
            return np.array([each.removesuffix(".0") for each in label], dtype=object)
    return table.line


def _is_number_or_time(cell: str) -> bool:
    return ":" in cell or shaped_as_number(cell)
