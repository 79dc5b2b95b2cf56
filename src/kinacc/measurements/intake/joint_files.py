"""Joints alone, in whatever form a file of poses to measure has: a table or a robot's program."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.column_names import Name
from kinacc.measurements.intake import columns, text
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import NamedColumns
from kinacc.measurements.intake.decimals import shaped_as_number
from kinacc.measurements.intake.groups import listed
from kinacc.measurements.intake.guess import FULL_TURN_RAD, pulses
from kinacc.measurements.layout import ANGLE, LENGTH
from kinacc.measurements.table import RawTable, numbers


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
    found = _found(table, tuple(answers.get("take", ())))
    per_deg, told_ = pulses(found, table, answers)
    joints = found.joints
    words = ", ".join(each.column for each in joints)
    if len(joints) != len(prismatic):
        allowed = f"{len(prismatic)}, as the robot has"
        raise InputError(Problem(table.path, f"{len(joints)} joints: {words}", allowed))
    told = [f"joints are {words}", *looked.told, *table.notes, *told_]
    empty = np.all([table.gaps(each.column) for each in joints], axis=0)
    if empty.any() and not empty.all():
        told.append(f"left out, without joints: {table.rows_in_words(np.flatnonzero(empty))}")
        table = table.select(np.flatnonzero(~empty))
    factors = ANGLE["deg"] / np.array(per_deg) if per_deg else _factors(
        table, joints, prismatic, answers, told)  # fmt: skip
    problems: list[Problem] = []
    values = np.stack([numbers(table, each.column, problems) for each in joints], axis=1)
    refuse(problems, f"{table.path} cannot be used")
    return JointFile(values * factors, _labels(table, found), tuple(dict.fromkeys(told)))


def _found(table: RawTable, take: Sequence[str]) -> NamedColumns:
    """The columns with joints chosen: the only ones that may be meant, commanded ones included."""
    found = columns.of_table(table, take, False)
    question = next((each for each in found.questions if each.about == "the joints"), None)
    if question and len(question.readings) == 1:
        found = columns.of_table(table, question.readings[0].names[:1], False)
    elif question:
        readings = "; or ".join(each.in_words() for each in question.readings)
        ways = [f"--take {shlex.quote(each.names[0])}" for each in question.readings]
        what = f"the names do not tell the joints: {question.why}: {readings}"
        raise InputError(Problem(table.path, what, fix=f"give {' or '.join(ways)}"))
    if not found.joints:
        fix = f"the file has {', '.join(table.columns)}; name them q1_deg, q2_deg .. in the file, "
        fix += "or by --names where it has no names"
        raise InputError(Problem(table.path, "no columns of 4 to 7 joints were found", fix=fix))
    return NamedColumns(found.joints, single=found.single)


def _factors(
    table: RawTable, joints: Sequence[Name], prismatic: np.ndarray, answers: Mapping, told: list
) -> np.ndarray:
    """Factors (k,) to rad and mm by the units stated, answered, or left by the size of numbers."""
    stated = {each.unit for each in joints if each.unit in ANGLE}
    given, words = answers.get("joint_unit"), listed([each.column for each in joints])
    if len(stated) > 1 or (given and stated - {given}):
        where = f"--joint-unit {given}" if given else table.path
        what = f"columns {words} are in {' and '.join(sorted(stated))}"
        raise InputError(Problem(where, what, "one unit for all"))
    turning = [n.column for n, slides in zip(joints, prismatic, strict=True) if not slides]
    most = max((np.nanmax(np.abs(table.values(n)), initial=0.0) for n in turning), default=0.0)
    unit = given or next(iter(stated), "")
    if not unit and most > FULL_TURN_RAD:
        unit = "deg"
        told.append(f"{words} are in deg: the largest number is {most:.4g}")
    if not unit and turning:
        about = f"{words} do not tell their unit, and the largest number is {most:.4g}"
        meant = {"rad": "radians", "deg": "degrees, of an arm that hardly moves"}
        raise Undecided(table.path, [Choice("--joint-unit", about, meant)])
    pairs = zip(joints, prismatic, strict=True)
    return np.array(
        [LENGTH.get(each.unit, 1.0) if slides else ANGLE[unit] for each, slides in pairs]
    )


def _labels(table: RawTable, found: NamedColumns) -> np.ndarray:
    """Names of the rows where a column has another for each, else their lines."""
    named = [found.single["pose"].column] if "pose" in found.single else []
    for column in (*named, *table.columns):
        label = table.texts(column)
        texts = column in named or not any(":" in each or shaped_as_number(each) for each in label)
        if texts and not table.gaps(column).any() and len({*label}) == len(label):
            return np.array([each.removesuffix(".0") for each in label], dtype=object)
    return table.line
