"""A file in any form as a table under our names: q1_deg, x_mm, qw, pose."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.errors import Problem, refuse
from kinacc.measurements.column_names import NOMINAL, OPEN
from kinacc.measurements.intake import columns, groups, text
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.decimals import shaped_as_number
from kinacc.measurements.intake.groups import listed
from kinacc.measurements.intake.guess import Units, pulses
from kinacc.measurements.layout import ANGLE, LENGTH, Layout, in_order_of
from kinacc.measurements.orientation import rotations
from kinacc.measurements.table import RawTable, frame

JOINTS, POINTS, POSES = "joints", "points", "poses"


def read(path: str | Path, answers: Mapping, need: str) -> tuple[RawTable, tuple[str, ...]]:
    """The table of a file with what was recognised under our names, and words on how it was read.

    ``need``: joints, points (that were measured) or poses (that are wanted); joints beside points
    and poses come along. ``answers`` to choices by key (``joint_unit`` and ``take`` among them).
    Raises Undecided where the file can be read in more than one way, InputError where what is
    needed cannot be found.
    """
    looked = text.look(path, answers)
    table, take = looked.table, [*answers.get("take", ())]
    if need == POSES:  # those that are wanted, where the names say so
        every = groups.found(columns.names_in(table), lambda n: table.values(n.column))
        take += [g.names[0] for g in every if g.kind in (groups.POINT, groups.TURN)
                 and g.role in (NOMINAL, OPEN)]  # fmt: skip
    found = columns.of_table(table, take, need == POSES)
    take += [q.readings[0].names[0] for q in found.questions if len(q.readings) == 1]
    found = columns.of_table(table, take, need == POSES)
    problems = []
    for question in found.questions:
        if (question.about == "the joints") == (need == JOINTS):
            ways = " or ".join(f"--take {shlex.quote(g.names[0])}" for g in question.readings)
            what = f"the names do not tell {question.about}: {question.why}"
            problems.append(Problem(table.path, what, fix=f"give {ways}"))
    if need != JOINTS and len(found.targets) > 1:
        ways = " or ".join(f"--take {shlex.quote(t['x'].column)}" for t in found.targets.values())
        what = f"several points: {', '.join(found.targets)}"
        problems.append(Problem(table.path, what, "one point in a row", f"give {ways}"))
    target = {} if need == JOINTS or not found.targets else next(iter(found.targets.values()))
    joints = () if any(q.about == "the joints" for q in found.questions) else found.joints
    if not problems and not (joints if need == JOINTS else target):
        what = "no columns of 4 to 7 joints" if need == JOINTS else "no columns of a point"
        fix = "name them q1_deg, q2_deg .., x_mm, y_mm, z_mm in the file, or by --names"
        told = f"{what} were found in {', '.join(table.columns)}"
        problems.append(Problem(table.path, told, fix=fix))
    refuse(problems, f"{path} cannot be used")
    given = {"joint_unit": answers.get("joint_unit", "")}
    units = Units(
        table.path, lambda n: table.values(n.column), problems, {}, {}, looked.stated, given
    )
    per_deg, told = pulses(found, table, answers) if joints else ((), ())
    turning = [name for name in joints if name.unit not in LENGTH and not per_deg]
    unit = units.of(turning, "joint_unit")
    if unit == "rad" and "joint_unit" in units.assumed:
        meant = {"rad": "radians", "deg": "degrees, of an arm that hardly moves"}
        raise Undecided(table.path, [Choice("--joint-unit", units.assumed["joint_unit"], meant)])
    named: dict[str, Sequence] = {}
    for number, name in enumerate(joints, 1):
        own = name.unit if name.unit in LENGTH else unit
        cells = table.values(name.column) / per_deg[number - 1] if per_deg else None
        named[f"q{number}_{own}"] = table.columns[name.column] if cells is None else cells
    points = {axis: target[axis] for axis in "xyz"} if target else {}
    unit = units.of([*points.values()], "length_unit")
    named |= {f"{axis}_{unit}": table.columns[n.column] for axis, n in points.items()}
    turn = {q: n for q, n in target.items() if q[0] in "qr"}
    if turn and found.turn[0] == "quaternion":
        for ours, name in zip(("qw", "qx", "qy", "qz"), turn.values(), strict=True):
            named[ours] = table.columns[name.column]
        told += (f"{', '.join(n.column for n in turn.values())} are w, x, y, z of a quaternion",)
    elif turn:
        kind, convention = found.turn
        order = in_order_of(convention) if kind == "euler" else turn
        values = np.stack([table.values(turn[q].column) for q in order], axis=1)
        values = values * ANGLE[units.of([*turn.values()], "angle_unit")]
        turned = rotations(values, Layout(orientation=kind, convention=convention))
        vectors = Rotation.from_matrix(turned).as_rotvec()
        named |= {f"rv{axis}_rad": each for axis, each in zip("xyz", vectors.T, strict=True)}
        told += (f"{listed([n.column for n in turn.values()])}: {kind} {convention}",)
    refuse(problems, f"{path} cannot be used")
    named |= {n: table.columns[each.column] for n, each in found.single.items()}
    used = {name.column for name in (*joints, *target.values(), *found.single.values())}
    spare = [n for n in table.columns if n not in used and n not in named]
    label = next((n for n in spare if _names_rows(table, n)), None)
    if "pose" not in named and label:
        named["pose"] = table.columns[label]
    named |= {name: table.columns[name] for name in spare}
    read_ = [listed([n.column for n in each]) for each in (joints, [*points.values()]) if each]
    read_ = [f"read as joints or points: {'; '.join(read_)}"]
    told = (*looked.told, *table.notes, *told, *units.assumed.values(), *read_)
    return replace(table, columns=frame(named)), tuple(dict.fromkeys(told))


def _names_rows(table: RawTable, name: str) -> bool:
    """Whether a column calls every row by another text."""
    label = table.texts(name)
    texts = not any(":" in each or shaped_as_number(each) for each in label)
    return texts and not table.gaps(name).any() and len({*label}) == len(label)
