"""A file in any form as a table under our names: q1_deg, x_mm, qw, pose."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.column_names import NOMINAL, OPEN, Name
from kinacc.measurements.intake import columns, groups, text
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.decimals import shaped_as_number
from kinacc.measurements.intake.groups import listed
from kinacc.measurements.intake.guess import FULL_TURN_RAD, pulses
from kinacc.measurements.layout import ANGLE, LENGTH
from kinacc.measurements.table import RawTable, numbers

JOINTS, POINTS, POSES = "joints", "points", "poses"


def read(path: str | Path, answers: Mapping, need: str) -> tuple[RawTable, tuple[str, ...]]:
    """The table of a file with what was recognised under our names, and words on how it was read.

    ``need``: joints, points (that were measured) or poses (that are wanted); joints beside points
    and poses come along. ``answers`` to choices by key (``joint_unit`` and ``take`` among them).
    Raises Undecided where the file can be read in more than one way, InputError where what is
    needed cannot be found.
    """
    looked = text.look(path, answers)
    table, told, problems = looked.table, [*looked.told, *looked.table.notes], []
    take = [*answers.get("take", ()), *_wanted(table, need)]
    found = columns.of_table(table, take, need == POSES)
    only = [q.readings[0].names[0] for q in found.questions if len(q.readings) == 1]
    found = columns.of_table(table, [*take, *only], need == POSES) if only else found
    for question in found.questions:
        if (question.about == "the joints") == (need == JOINTS):
            readings = "; or ".join(each.in_words() for each in question.readings)
            ways = [f"--take {shlex.quote(each.names[0])}" for each in question.readings]
            what = f"the names do not tell {question.about}: {question.why}: {readings}"
            problems.append(Problem(table.path, what, fix=f"give {' or '.join(ways)}"))
    target = next(iter(found.targets.values()), {}) if need != JOINTS else {}
    what = "no columns of 4 to 7 joints" if need == JOINTS else "no columns of a point"
    if not problems and not (found.joints if need == JOINTS else target):
        fix = "name them q1_deg, q2_deg .., x_mm, y_mm, z_mm in the file, or by --names"
        problems.append(
            Problem(table.path, f"{what} were found in {listed([*table.columns])}", fix=fix)
        )
    refuse(problems, f"{path} cannot be used")
    asked = any(question.about == "the joints" for question in found.questions)
    joints = () if asked else found.joints
    columns_: dict[str, Sequence] = {}
    if joints:
        per_deg, words = pulses(found, table, answers)
        unit = "deg" if per_deg else _unit(table, joints, ANGLE, answers.get("joint_unit"), told)
        told += [f"joints are {', '.join(each.column for each in joints)}", *words]
        for number, name in enumerate(joints, 1):
            cells: Sequence = table.columns[name.column]
            if per_deg:
                cells = numbers(table, name.column, problems) / per_deg[number - 1]
            own = name.unit if name.unit in LENGTH else unit
            columns_[f"q{number}_{own}"] = cells
    if target:
        points = [target[axis] for axis in "xyz"]
        unit = _unit(table, points, LENGTH, looked.stated.get("length"), told)
        columns_ |= {
            f"{n}_{unit}": table.columns[p.column] for n, p in zip("xyz", points, strict=True)
        }
        told.append(f"points are {', '.join(each.column for each in points)}")
    if target and found.turn[0] != "none":
        columns_ |= _turned(table, found, target, told)
    columns_ |= {n: table.columns[each.column] for n, each in found.single.items()}
    refuse(problems, f"{path} cannot be used")
    used = {name.column for name in (*joints, *target.values(), *found.single.values())}
    spare = [n for n in table.columns if n not in used and n not in columns_]
    if "pose" not in columns_ and (label := _label(table, spare)):
        columns_["pose"] = table.columns[label]
    columns_ |= {name: table.columns[name] for name in spare}
    named = RawTable.of(table.path, columns_, table.line, decimal=table.decimal)
    more = (table.thousands, table.letters)
    return replace(named, thousands=more[0], letters=more[1]), tuple(dict.fromkeys(told))


def _wanted(table: RawTable, need: str) -> list[str]:
    """Columns of poses that are wanted: the nominal ones, where no others are there."""
    if need != POSES:
        return []
    every = groups.found(columns.names_in(table), lambda n: table.values(n.column))
    return [g.names[0] for kind in (groups.POINT, groups.TURN) for g in every
            if g.kind == kind and g.role in (NOMINAL, OPEN)]  # fmt: skip


def _unit(table: RawTable, names: Sequence[Name], known: Mapping, given: str | None, told) -> str:
    """The unit that names state, that was given, or that the size of the numbers leaves."""
    stated = {each.unit for each in names if each.unit in known}
    words, angles = listed([each.column for each in names]), known is ANGLE
    if len(stated | ({given} if given else set())) > 1 or any(
        n.unit not in ("", *LENGTH, *ANGLE) for n in names
    ):
        units = " and ".join(sorted({given or "", *(each.unit for each in names)} - {""}))
        raise InputError(Problem(table.path, f"columns {words} are in {units}", "one unit for all"))
    most = max(np.nanmax(np.abs(table.values(n.column)), initial=0.0) for n in names
               if not angles or n.unit not in LENGTH)  # fmt: skip
    unit = given or next(iter(stated), "")
    if unit:
        return unit
    if angles and most <= FULL_TURN_RAD:
        about = f"{words} do not tell their unit, and the largest number is {most:.4g}"
        meant = {"rad": "radians", "deg": "degrees, of an arm that hardly moves"}
        raise Undecided(table.path, [Choice("--joint-unit", about, meant)])
    unit = "deg" if angles else "mm" if most > 50.0 else "m"
    told.append(f"{words} are in {unit}: the largest number is {most:.4g}")
    return unit


def _turned(table: RawTable, found: columns.NamedColumns, target: Mapping[str, Name], told) -> dict:
    """Columns of the orientation of a target: a quaternion, or a rotation vector in rad."""
    kind, convention = found.turn
    parts = [q for q in ("qw", "qx", "qy", "qz", "quat1", "quat2", "quat3", "quat4") if q in target]
    if kind == "quaternion":
        if "quat1" in parts:
            told.append(f"{', '.join(target[p].column for p in parts)} are w, x, y, z")
        ours = ("qw", "qx", "qy", "qz")
        return {o: table.columns[target[p].column] for o, p in zip(ours, parts, strict=True)}
    names = [target[f"r{axis}"] for axis in "xyz"]
    values = np.stack([table.values(name.column) for name in names], axis=1)
    unit = names[0].unit or (
        "rad" if np.nanmax(np.abs(values), initial=0.0) < FULL_TURN_RAD else "deg"
    )
    values = values * ANGLE[unit]
    if kind == "euler":
        axes = convention.lower()
        order = ["xyz".index(axis) for axis in axes] if len({*axes}) == 3 else [0, 1, 2]
        values = Rotation.from_euler(convention, values[:, order]).as_rotvec()
    told.append(f"{', '.join(n.column for n in names)} are {kind} {convention} in {unit}")
    return {f"rv{axis}_rad": column for axis, column in zip("xyz", values.T, strict=True)}


def _label(table: RawTable, names: Sequence[str]) -> str:
    """The column that calls every row by another text; empty where none does."""
    for name in names:
        label = table.texts(name)
        texts = not any(":" in each or shaped_as_number(each) for each in label)
        if texts and not table.gaps(name).any() and len({*label}) == len(label):
            return name
    return ""
