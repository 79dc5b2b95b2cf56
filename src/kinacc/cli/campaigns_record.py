"""Readings from the command line and from files, on their way into the journal."""

from __future__ import annotations

import hashlib
import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from kinacc.campaign import folder, imports, reading, slips, words
from kinacc.campaign.folder import Opened
from kinacc.campaign.reading import Reading
from kinacc.campaign.state import State
from kinacc.cli.campaigns import say_doubts
from kinacc.cli.campaigns_answers import as_facts
from kinacc.cli.output import Output
from kinacc.cli.rows import ANGLE, LENGTH, Quantities, open_table
from kinacc.errors import InputError, Problem, refuse
from kinacc.measurements.table import RawTable, numbers_of

_COMPUTED = {"predict": "unexplained_mm", "compensate": "solver_residual_mm"}  # columns of theirs


@dataclass(frozen=True)
class Asked:
    """The options of ``record``: one reading, or a file of them, as they were written."""

    folder: str
    file: str | None
    position_mm: str | None
    point: str | None
    joints_deg: str | None
    joints_rad: str | None
    instrument: str | None
    std_mm: str | None
    accept_implausible: bool
    skip_bad: bool
    again: bool


def record(given: Asked, out: Output) -> None:
    """Take what the options give, or nothing."""
    one = given.position_mm is not None
    if one == (given.file is not None):
        what = "is given twice" if one else "is not given"
        raise InputError(Problem("the reading", what, "--position-mm, or a FILE"))
    with folder.writing(given.folder) as opened:
        refuse([] if given.accept_implausible else opened.clock_went_back(), "Nothing was recorded")
        before = opened.state()
        say_doubts(opened)
        made = _Made([_single(given, before)]) if one else _of_file(given, before)
        if made.taken:
            opened.write(folder.readings_entry(made.taken, *made.source))
        after = folder.open_(given.folder).state()
    _say_taken(given, made, before, after, out)


@dataclass(frozen=True)
class _Made:
    """Readings that are taken, problems of rows that are not, numbers of readings known before.

    ``source``: digest and path of the file.
    """

    taken: list[Reading]
    skipped: Sequence[Problem] = ()
    known: tuple[int, ...] = ()
    source: tuple = ()


def leave_out(path: str, name: str, reason: str, out: Output) -> None:
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
        refuse(problems, "Nothing was left out")
        opened.write(folder.leave_out_entry(point, reason.strip()))
        after = folder.open_(path).state()
    _say_standing(after, out)


def strike(path: str, number: int, reason: str, out: Output) -> None:
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
        refuse(problems, "Nothing was struck")
        opened.write(folder.strike_entry(number, reason.strip()))
        after = folder.open_(path).state()
    _say_standing(after, out)


def _say_standing(after: State, out: Output) -> None:
    out.say(as_facts(after, after.plan.limits.tolerance_mm), "\n".join(words.standing(after)))


def _single(given: Asked, before: State) -> Reading:
    plan = before.plan
    problems: list[Problem] = []
    position = _three(given.position_mm, problems)
    joints = None
    for option, unit in (("joints_deg", "deg"), ("joints_rad", "rad")):
        if getattr(given, option) is not None:
            joints = _joints(
                getattr(given, option), unit, plan.slides, f"--{option[:6]}-{unit}", problems
            )
    instrument = given.instrument or plan.instruments[0].name
    if instrument not in {each.name for each in plan.instruments}:
        known = ", ".join(each.name for each in plan.instruments)
        problems.append(Problem("--instrument", f"{instrument!r}", known))
    point = before.asked
    if given.point is not None:
        point = plan.points.number(given.point)
        if point is None:
            problems.append(Problem("--point", f"{given.point!r} is no candidate"))
    elif point is None:
        problems.append(Problem("the reading", words.standing(before)[-1], fix="give --point"))
    refuse(problems, "Nothing was recorded")
    found = Reading(point, position, instrument, joints, given.std_mm)
    left_out = frozenset(before.left_out)
    problems = reading.problems_of(
        plan, found, "the reading", left_out, given.accept_implausible, _unusual_mm(before)
    )
    if not given.again:
        problems += _repeated(found, "the reading", _recorded(before))
    refuse(problems, "Nothing was recorded")
    return found


def _unusual_mm(before: State, more: Iterable[Reading] = ()) -> float:
    """Size of an error that is unlike those of the readings taken, and of ``more`` of a file."""
    sizes = [float(np.linalg.norm(each.error_mm)) for each in (*before.told, *before.in_hand)]
    with np.errstate(over="ignore"):  # what lies that far away is refused on its own
        sizes += [float(np.linalg.norm(reading.error_mm(before.plan, each))) for each in more]
    usable = [size for size in sizes if np.isfinite(size)]
    squares = np.trace(before.plan.covariance_mm2, axis1=1, axis2=2)
    return slips.unusual_mm(usable, float(np.sqrt(squares.max())))


def _recorded(before: State) -> dict[tuple, str]:
    """What readings there are, by their digits."""
    there = (*before.told, *before.in_hand)
    return {imports.digits(each.reading): f"reading {each.number}" for each in there}


def _repeated(found: Reading, where: str, earlier: Mapping[tuple, str]) -> list[Problem]:
    """The problem with a reading that is an earlier one to the last digit: it tells nothing new."""
    same = earlier.get(imports.digits(found))
    if same is None:
        return []
    fix = "give --again if it is a reading of its own"
    return [Problem(where, f"is {same}, to the last digit", fix=fix)]


def _of_file(given: Asked, before: State) -> _Made:
    """What is taken of a file, and what is not. InputError where nothing may be."""
    path = given.file
    for option in ("point", "joints_deg", "joints_rad", "std_mm"):
        if getattr(given, option) is not None:
            option = option.replace("_", "-")
            raise InputError(Problem(f"--{option}", "is given with a file", "a column of the file"))
    table = open_table(path)
    if "pose" in table.columns:
        table = table.with_pose_names("pose")
    mark = hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]
    place = Path(os.path.relpath(Path(path).resolve(), Path(given.folder).resolve())).as_posix()
    rows, problems = _rows(table, given.instrument, before)
    read = {number: row for number, row in enumerate(rows) if isinstance(row, Reading)}
    compared = imports.compare(read, before, place, given.again)
    left_out = frozenset(before.left_out)
    unusual_mm = _unusual_mm(before, read.values())
    good, earlier = [], {}
    for number, row in enumerate(rows):
        called = table.row_names.one(table.line[number])
        where = f"{table.path}, {called}"
        if isinstance(row, Problem):
            problems.append(row)
        elif number not in compared.known:
            wrong = reading.problems_of(
                before.plan, row, where, left_out, given.accept_implausible, unusual_mm
            )
            if not given.again:
                wrong += _repeated(row, where, earlier)
            good += [] if wrong else [row]
            problems += wrong
        if isinstance(row, Reading):
            earlier.setdefault(imports.digits(row), called)
    if compared.missing:
        what = f"does not hold {_listed(compared.missing)} any more, which was recorded from it"
        strike = shlex.join(["kinacc", "campaign", "strike", given.folder, "NUMBER"])
        fix = (
            f"bring the rows back; or strike wrong readings ({strike} --reason ..) and record the "
            "file again; --again where all its rows are new readings"
        )
        problems.append(Problem(table.path, what, fix=fix))
    if not good and not problems:
        what = f"was recorded before: {_listed(compared.known.values())}, no row is new"
        fix = "a reading that is equal to another to the last digit is a further row of the file"
        raise InputError(Problem(path, what, fix=fix), "Nothing was recorded")
    if problems and not given.skip_bad:
        raise InputError(problems, "Nothing was recorded")
    return _Made(good, problems, tuple(sorted(compared.known.values())), (mark, place))


def _listed(numbers: Iterable[int]) -> str:
    """Numbers of readings in words: readings 1 to 4, 7."""
    spans: list[list[int]] = []
    for number in sorted(numbers):
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    shown = ", ".join(f"{low} to {high}" if high > low else f"{low}" for low, high in spans)
    return f"reading{'' if shown.isdigit() else 's'} {shown}"


def _rows(table: RawTable, instrument: str | None, before: State):
    """A Reading, or the Problem with it, of every row; and problems of the file as a whole."""
    plan = before.plan
    # A cell that is no number spoils its row, not the file: it is found again row by row.
    reader = Quantities(table, cells=[])
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
    refuse(problems, "Nothing was recorded")
    rows: list[Reading | Problem] = []
    for i in range(len(table)):
        where = f"{table.path}, line {table.line[i]}"
        at = None if joints is None or not np.isfinite(joints[i]).all() else joints[i]
        if "pose" in table.columns:
            name = str(table.columns["pose"][i]).strip()
            point = plan.points.number(name)
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
    points = opened.plan.points
    point = points.number(name)
    if point is None:
        allowed = f"{points.label[0]} .. {points.label[-1]}"
        raise InputError(Problem("point", f"{name!r} is no candidate", allowed))
    return point


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


def _say_taken(given: Asked, made: _Made, before: State, after: State, out: Output) -> None:
    label = after.plan.points.label
    facts = {
        "taken": len(made.taken),
        "skipped": [str(each) for each in made.skipped],
        "known": list(made.known),
        "next": None if after.asked is None else label[after.asked],
        "readings": after.taken,
        "last_reading": after.numbered,
    }
    lines = []
    if not out.as_json:
        for each in made.skipped:
            click.echo(f"not taken: {each}", err=True)
    if given.file is None:
        found = made.taken[0]
        size = float(np.linalg.norm(reading.error_mm(after.plan, found)))
        lines.append(
            f"recorded: reading {after.numbered}, point {label[found.point]}, {size:.3f} mm from "
            "the model"
        )
        if before.asked is not None and found.point != before.asked:
            lines.append(f"point {label[before.asked]} was asked for: this reading is kept in hand")
    else:
        if made.known:
            rows = f"{len(made.known)} row{'s' if len(made.known) > 1 else ''}"
            lines.append(f"known: {rows} recorded before, as {_listed(made.known)}")
        lines.append(f"recorded: {len(made.taken)} readings of {given.file}")
    out.say(facts, "\n".join([*lines, *words.standing(after)]))
