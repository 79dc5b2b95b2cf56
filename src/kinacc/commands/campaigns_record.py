"""Readings from the command line and from files, on their way into the journal."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np

from kinacc.campaign import folder, reading, words
from kinacc.campaign.folder import Opened
from kinacc.campaign.reading import Reading
from kinacc.campaign.state import State
from kinacc.commands.campaigns import say_doubts
from kinacc.commands.campaigns_answers import as_facts
from kinacc.commands.rows import ANGLE, LENGTH, Reader, open_table
from kinacc.data.table import RawTable
from kinacc.data.written_numbers import numbers_of
from kinacc.errors import InputError, Problem

_COMPUTED = {"predict": "unexplained_mm", "compensate": "position_error_mm"}  # columns of theirs


def record(given: Mapping) -> None:
    """Take what the options give, or nothing."""
    one = given["position_mm"] is not None
    if one == (given["file"] is not None):
        what = "is given twice" if one else "is not given"
        raise InputError(Problem("the reading", what, "--position-mm, or a FILE"))
    with folder.writing(given["folder"]) as opened:
        before = opened.state()
        say_doubts(opened)
        if one:
            taken, skipped, mark = [_single(given, before)], [], None
        else:
            taken, skipped, mark = _of_file(given, before)
        if taken:
            opened.write(folder.readings_entry(taken, mark))
        after = folder.open_(given["folder"]).state()
    _say_taken(given, taken, skipped, before, after)


def leave_out(path: str, name: str, reason: str, as_json: bool) -> None:
    """Leave a point without readings out of the campaign."""
    with folder.writing(path) as opened:
        before = opened.state()
        point = _point_named(opened, name)
        have = [each for each in (*before.told, *before.in_hand) if each.reading.point == point]
        problems = []
        if have:
            what = f"has {len(have)} readings: leaving it out now could hide a large error"
            problems.append(Problem(f"point {name}", what))
        if point in before.left_out:
            problems.append(Problem(f"point {name}", "was left out before"))
        if not reason.strip():
            problems.append(Problem("--reason", "is empty", "why it cannot be measured"))
        if len(opened.plan.points) - len(before.left_out) <= 2:
            problems.append(Problem(f"point {name}", "only 2 candidates are left"))
        if problems:
            raise InputError(problems, "Nothing was left out")
        opened.write(folder.leave_out_entry(point, reason.strip()))
        after = folder.open_(path).state()
    _say_standing(after, as_json)


def strike(path: str, number: int, reason: str, as_json: bool) -> None:
    """Declare a reading void."""
    with folder.writing(path) as opened:
        before = opened.state()
        there = {each.number for each in (*before.told, *before.in_hand)}
        problems = []
        if number in {each.number for each, _ in before.struck}:
            problems.append(Problem(f"reading {number}", "was struck before"))
        elif number not in there:
            allowed = f"1 to {before.numbered}" if before.numbered else "none was taken yet"
            problems.append(Problem(f"reading {number}", "is not there", allowed))
        if not reason.strip():
            problems.append(Problem("--reason", "is empty", "what went wrong"))
        if problems:
            raise InputError(problems, "Nothing was struck")
        opened.write(folder.strike_entry(number, reason.strip()))
        after = folder.open_(path).state()
    _say_standing(after, as_json)


def _say_standing(after: State, as_json: bool) -> None:
    if as_json:
        click.echo(json.dumps(as_facts(after, after.plan.limits.tolerance_mm), indent=1))
        return
    click.echo("\n".join(words.standing(after)))


def _single(given: Mapping, before: State) -> Reading:
    plan = before.plan
    problems: list[Problem] = []
    position = _three(given["position_mm"], problems)
    joints = None
    for option, unit in (("joints_deg", "deg"), ("joints_rad", "rad")):
        if given[option] is not None:
            joints = _joints(given[option], unit, plan.slides, f"--{option[:6]}-{unit}", problems)
    instrument = given["instrument"] or plan.instruments[0].name
    if instrument not in {each.name for each in plan.instruments}:
        known = ", ".join(each.name for each in plan.instruments)
        problems.append(Problem("--instrument", f"{instrument!r}", known))
    point = before.asked
    if given["point"] is not None:
        point = (
            plan.points.label.index(given["point"]) if given["point"] in plan.points.label else None
        )
        if point is None:
            problems.append(Problem("--point", f"{given['point']!r} is no candidate"))
    elif point is None:
        problems.append(Problem("the reading", words.standing(before)[-1], fix="give --point"))
    if problems:
        raise InputError(problems, "Nothing was recorded")
    found = Reading(point, position, instrument, joints, given["std_mm"])
    left_out = frozenset(before.left_out)
    problems = reading.problems_of(
        plan, found, "the reading", left_out, given["accept_implausible"]
    )
    if not given["again"]:
        problems += _repeated(found, "the reading", _recorded(before))
    if problems:
        raise InputError(problems, "Nothing was recorded")
    return found


def _digits(found: Reading) -> tuple:
    return found.point, *found.position_mm.tolist()


def _recorded(before: State) -> dict[tuple, str]:
    """What readings there are, by their digits."""
    there = (*before.told, *before.in_hand)
    return {_digits(each.reading): f"reading {each.number}" for each in there}


def _repeated(found: Reading, where: str, earlier: Mapping[tuple, str]) -> list[Problem]:
    """The problem with a reading that is an earlier one to the last digit: it tells nothing new."""
    same = earlier.get(_digits(found))
    if same is None:
        return []
    what = f"is {same}, to the last digit: it was recorded before"
    return [Problem(where, what, fix="give --again if it is a new one")]


def _of_file(given: Mapping, before: State) -> tuple[list[Reading], list[Problem], str]:
    """Readings of a file that are taken, what is wrong with the others, digest of the file."""
    path = given["file"]
    for option in ("point", "joints_deg", "joints_rad", "std_mm"):
        if given[option] is not None:
            option = option.replace("_", "-")
            raise InputError(Problem(f"--{option}", "is given with a file", "a column of the file"))
    table = open_table(path)
    mark = hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]
    if mark in before.files and not given["again"]:
        fix = "give --again if these are new readings"
        raise InputError(Problem(path, "was recorded before", fix=fix), "Nothing was recorded")
    rows, problems = _rows(table, given["instrument"], before)
    left_out = frozenset(before.left_out)
    earlier = _recorded(before)
    good = []
    for number, row in enumerate(rows):
        if isinstance(row, Problem):
            problems.append(row)
            continue
        where = f"{table.path}, line {table.line[number]}"
        wrong = reading.problems_of(before.plan, row, where, left_out, given["accept_implausible"])
        if not given["again"]:
            wrong += _repeated(row, where, earlier)
            earlier.setdefault(_digits(row), f"line {table.line[number]}")
        problems += wrong
        good += [] if wrong else [row]
    if problems and not given["skip_bad"]:
        raise InputError(problems, "Nothing was recorded")
    return good, problems, mark


def _rows(table: RawTable, instrument: str | None, before: State):
    """A Reading, or the Problem with it, of every row; and problems of the file as a whole."""
    plan = before.plan
    # A cell that is no number spoils its row, not the file: it is found again row by row.
    reader = Reader(table, cells=[])
    problems = reader.problems
    position = reader.group(["x", "y", "z"], [LENGTH] * 3, True)
    kinds = [LENGTH if slides else ANGLE for slides in plan.slides]
    names = [f"q{joint + 1}" for joint in range(len(plan.slides))]
    for command, own in _COMPUTED.items():
        if own in table.columns:
            what = f"was written by kinacc {command}: its positions are computed, not measured"
            problems.append(Problem(table.path, what, "positions as the instrument read them"))
    joints = reader.group(names, kinds, False)
    std = reader.group(["std_x", "std_y", "std_z"], [LENGTH] * 3, False)
    if "pose" not in table.columns and joints is None and not problems:
        what = "does not say which point a row was measured at"
        problems.append(Problem(table.path, what, f"a column pose, or {names[0]}_deg .."))
    known = {each.name for each in plan.instruments}
    if instrument is not None and instrument not in known:
        problems.append(Problem("--instrument", f"{instrument!r}", ", ".join(known)))
    if problems:
        raise InputError(problems, "Nothing was recorded")
    place = {name.strip(): number for number, name in enumerate(plan.points.label)}
    rows: list[Reading | Problem] = []
    for i in range(len(table)):
        where = f"{table.path}, line {table.line[i]}"
        at = None if joints is None or not np.isfinite(joints[i]).all() else joints[i]
        if "pose" in table.columns:
            name = str(table.columns["pose"][i]).strip()
            point = place.get(name)
            wrong = f"{name!r} is no candidate"
        else:
            point = None if at is None else reading.point_at(plan, at)
            wrong = "its joints are those of no candidate"
        own = instrument or plan.instruments[0].name
        if "instrument" in table.columns and not table.is_gap(table.columns["instrument"][i]):
            own = str(table.columns["instrument"][i]).strip()
        if point is None or own not in known:
            what = wrong if point is None else f"instrument {own!r} is not there"
            rows.append(Problem(where, what))
            continue
        noise = None if std is None else ",".join(repr(float(each)) for each in std[i])
        rows.append(Reading(point, position[i], own, at, noise))
    return rows, problems


def _point_named(opened: Opened, name: str) -> int:
    label = opened.plan.points.label
    if name not in label:
        raise InputError(
            Problem("point", f"{name!r} is no candidate", f"{label[0]} .. {label[-1]}")
        )
    return label.index(name)


def _three(text: str, problems: list[Problem]) -> np.ndarray:
    values = numbers_of(text)
    if values.shape != (3,):
        problems.append(Problem("--position-mm", repr(text), "three numbers x,y,z"))
        return np.zeros(3)
    return values


def _joints(
    text: str, unit: str, slides, option: str, problems: list[Problem]
) -> np.ndarray | None:
    values = numbers_of(text)
    if values.shape != (len(slides),):
        problems.append(Problem(option, repr(text), f"{len(slides)} numbers, one per joint"))
        return None
    return values * np.where(slides, 1.0, ANGLE[unit])


def _say_taken(given, taken, skipped, before: State, after: State) -> None:
    label = after.plan.points.label
    if given["as_json"]:
        content = {
            "taken": len(taken),
            "skipped": [str(each) for each in skipped],
            "next": None if after.asked is None else label[after.asked],
            "readings": after.taken,
            "last_reading": after.numbered,
        }
        click.echo(json.dumps(content, indent=1))
        return
    for each in skipped:
        click.echo(f"not taken: {each}", err=True)
    if given["file"] is None:
        found = taken[0]
        size = float(np.linalg.norm(reading.error_mm(after.plan, found)))
        click.echo(
            f"recorded: reading {after.numbered}, point {label[found.point]}, {size:.3f} mm from "
            "the model"
        )
        if before.asked is not None and found.point != before.asked:
            click.echo(f"point {label[before.asked]} was asked for: this reading is kept in hand")
    else:
        click.echo(f"recorded: {len(taken)} readings of {given['file']}")
    click.echo("\n".join(words.standing(after)))
