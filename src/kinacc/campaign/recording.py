"""Readings on their way into a campaign: rows of a file, and what is taken of them."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.campaign.folder import Opened
from kinacc.campaign.plan import Plan
from kinacc.campaign.state import (
    Reading,
    Readings,
    error_mm,
    most_plausible_mm,
    point_at,
    problems_of,
)
from kinacc.errors import Problem, refuse
from kinacc.measurements.intake.columns import POINTS
from kinacc.measurements.row_names import RowNames
from kinacc.measurements.rows import read_rows

NOTHING = "Nothing was recorded"
_NAMES = RowNames(word="reading")
_AGAIN = "--again takes it as a reading of its own"


@dataclass(frozen=True)
class Recorded:
    """Readings taken: their ``numbers``, ``points`` and sizes ``error_mm`` of their errors.

    ``known``: numbers of readings that rows of the file repeat.
    """

    numbers: tuple[int, ...]
    points: tuple[str, ...]
    error_mm: tuple[float, ...]
    known: tuple[int, ...]


def read_readings(
    path: str | Path, plan: Plan, instrument: str | None = None
) -> tuple[dict[str, Reading], list[Problem]]:
    """Return the readings of a file by their places, and what is wrong with its other rows.

    ``instrument`` of rows that name none, by default the first. Raises InputError where the file
    cannot be read.
    """
    # A cell that is no number spoils its row, not the file: it is named row by row.
    read = read_rows(path, plan.slides, POINTS, spoilt=[])
    table, columns, position_mm = read.table, read.columns, read.position_mm
    assert table is not None  # a file has them all, or read_rows refuses it
    assert columns is not None
    assert position_mm is not None
    pose, usual = columns.single.get("pose"), plan.instrument(instrument).name
    if pose is not None:
        table = table.with_pose_names(pose.column)
    elif read.joints is None:
        refuse([Problem(str(path), "has no column pose and no joints", "pose, q1_deg")], NOTHING)
    devices = np.full(len(table), usual, dtype=object)
    if "instrument" in table.columns:
        devices = np.where(table.gaps("instrument"), usual, table.texts("instrument"))
    known = [device.name for device in plan.instruments]
    rows, problems = dict[str, Reading](), list[Problem]()
    for i, line in enumerate(table.line):
        place = f"{path}, {table.row_names.one(line)}"
        joints = None
        if read.joints is not None and np.isfinite(read.joints[i]).all():
            joints = read.joints[i]
        if pose is not None:
            point, name = plan.points.number(str(read.label[i])), repr(read.label[i])
        else:
            point, name = None if joints is None else point_at(plan, joints), "pose of its joints"
        if point is None:
            problems.append(Problem(place, f"{name} is no candidate"))
        elif devices[i] not in known:
            text = f"instrument {devices[i]!r} is unknown"
            problems.append(Problem(place, text, ", ".join(known)))
        else:
            std = None if read.std_mm is None else ",".join(map(repr, read.std_mm[i].tolist()))
            rows[place] = Reading(point, position_mm[i], devices[i], joints, std)
    return rows, problems


def record(
    opened: Opened,
    rows: Mapping[str, Reading],
    problems: list[Problem],
    path: str | None,
    accept_implausible: bool,
    again: bool,
) -> Recorded:
    """Write readings to the journal of an ``opened`` campaign, all of them or none.

    ``path`` of their file from the campaign's folder, None of a single reading.
    """
    plan, state = opened.plan, opened.state
    most_mm = math.inf if accept_implausible else most_plausible_mm(state, rows.values())
    good, known = list[Reading](), list[int]()
    of_file = [item for item in state.taken if path is not None and item.path == path]
    # A row that equals a reading is known, each reading once; ``again``: of the same file alone.
    recorded, digits = defaultdict[object, list[int]](list), set[object]()
    for item in of_file if again else state.taken:
        recorded[item.reading.digits].append(item.number)
    for place, row in rows.items():
        if numbers := recorded[row.digits]:
            known.append(numbers.pop(0))
        elif wrong := problems_of(state, row, place, most_mm):
            problems += wrong
        elif row.digits in digits and not again:
            message = "equals an earlier row to the last digit"
            problems.append(Problem(place, message, fix=_AGAIN))
        else:
            good.append(row)
        digits.add(row.digits)
    missing = {item.number for item in of_file if item.struck is None}.difference(known)
    if missing and not again:
        message = f"does not hold {_NAMES.spans(missing)} any more, recorded from it before"
        fix = "bring the rows back, strike the readings, or give --again"
        problems.append(Problem(str(path), message, fix=fix))
    if not good and not problems:
        message = f"no new reading: {_NAMES.spans(known)} recorded before"
        problems.append(
            Problem(path or "the reading", message, fix="" if again or path else _AGAIN)
        )
    refuse(problems, NOTHING)
    opened.write(Readings(readings=good, path=path))
    first = len(state.taken) + 1
    return Recorded(
        tuple(range(first, first + len(good))),
        tuple(plan.points.label[row.point] for row in good),
        tuple(float(np.linalg.norm(error_mm(plan, row))) for row in good),
        tuple(sorted(known)),
    )
