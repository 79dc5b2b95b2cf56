"""``kinacc campaign record``: a reading of the command line, or the readings of a file."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np
import pandas as pd

from kinacc.cli.choice import option
from kinacc.cli.output import answers

_COMPUTED = {"predict": "unexplained_mm", "compensate": "solver_residual_mm"}  # columns of theirs
_OF_ONE = ("point", "joints_deg", "joints_rad", "std_mm")


@click.command("record")
@click.argument("folder", type=click.Path())
@click.argument("file", type=click.Path(), required=False)
@option("--position-mm", help='Measured position "x,y,z".')
@option("--point", help="Measured candidate. [the next one]")
@option("--joints-deg", help="Joints of the controller (mm where a joint slides).")
@option("--joints-rad", help="Joints of the controller in radians.")
@option("--instrument", help="Instrument. [the first]")
@option("--std-mm", help="Noise of this reading where it is not the instrument's.")
@option("--accept-implausible", is_flag=True, help="Acceptance of an error of any size.")
@option("--skip-bad", is_flag=True, help="Good rows of a file without the bad ones.")
@option("--again", is_flag=True, help="Acceptance of readings that repeat or replace others.")
@answers("JSON of the readings taken and the status.")
def record(out, folder, file, **options) -> None:
    """Record a reading, or all new readings of a CSV, Excel, Parquet or JSON FILE.

    FILE has x_mm, y_mm, z_mm (or _m) and a column pose or joints q1_deg ..; optional: instrument,
    std_x_mm .. std_z_mm. Nothing is taken where a row is wrong. Readings taken are on disk.

    \b
    Example:
      kinacc campaign record check --position-mm "812.31,-40.02,655.90"
      kinacc campaign record check readings.csv
    """
    from kinacc.campaign.campaign import Campaign
    from kinacc.cli.campaign import status_lines
    from kinacc.errors import InputError, Problem

    if (options["position_mm"] is None) == (file is None):
        what = "is given twice" if file else "is not given"
        raise InputError(Problem("the reading", what, "--position-mm, or a FILE"))
    campaign = Campaign(folder)
    flags = {name: options[name] for name in ("accept_implausible", "again")}
    requested, plan = campaign.state.asked, campaign.plan
    if file is None:
        taken = campaign.add_reading(**_single(options, plan.slides), **flags)
        point = taken.points[0]
        first = f"Recorded reading {taken.numbers[0]} at point {point}: {taken.error_mm[0]:.3f} mm"
        first += " from the model."
        if requested is not None and point != (following := plan.points.label[requested]):
            first += f" It is used when its point is requested; {following} is next."
    else:
        rows = _of_file(file, options, campaign)
        taken = campaign.add_readings(rows, **flags, skip_bad=options["skip_bad"])
        known = f"; {len(taken.known)} rows were recorded before" if taken.known else ""
        first = f"Recorded {len(taken.numbers)} readings of {file}{known}."
    for problem in taken.skipped:
        click.echo(f"not taken: {problem}", err=True)
    found = campaign.status()
    answer = {**vars(taken), "status": found}
    out.show(answer, pd.DataFrame(), [first, *status_lines(found)])


def _single(options: Mapping, slides: np.ndarray) -> dict[str, object]:
    """Arguments of ``Campaign.add_reading``."""
    from kinacc.errors import Problem, refuse
    from kinacc.measurements.table import numbers_of

    sizes = {"position_mm": 3, "joints_deg": len(slides), "joints_rad": len(slides)}
    values = {name: numbers_of(options[name]) for name in sizes if options[name] is not None}
    refuse(
        (
            Problem(_flag(name), repr(options[name]), f"{sizes[name]} numbers")
            for name, value in values.items()
            if value.shape != (sizes[name],)
        ),
        "Nothing was recorded",
    )
    joints = values.get("joints_rad")
    if joints is None and "joints_deg" in values:
        joints = values["joints_deg"] * np.where(slides, 1.0, np.pi / 180.0)
    others = {name: options[name] for name in ("point", "instrument", "std_mm")}
    return {"position_mm": values["position_mm"], "joints": joints, **others}


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _of_file(path: str, options: Mapping, campaign):
    """The rows of a file as readings, or what is wrong with them."""
    from kinacc.campaign.campaign import RowsOfFile
    from kinacc.campaign.reading import Reading, point_at
    from kinacc.errors import Problem, refuse
    from kinacc.measurements.rows import POINTS, read_rows

    plan = campaign.plan
    # A cell that is no number spoils its row, not the file: it is named row by row.
    read = read_rows(path, plan.slides, POINTS, spoilt=[])
    table, joints, pose = read.table, read.joints, read.columns.single.get("pose")
    if pose:
        table = table.with_pose_names(pose.column)
    known = [instrument.name for instrument in plan.instruments]
    problems = [
        Problem(_flag(name), "is given with a file", "a column of the file")
        for name in _OF_ONE
        if options[name] is not None
    ]
    problems += [
        Problem(path, f"holds positions that kinacc {command} computed", "measured positions")
        for command, column in _COMPUTED.items()
        if column in table.columns
    ]
    if not pose and joints is None and not problems:
        problems.append(Problem(path, "has no column pose and no joints", "pose, q1_deg"))
    if options["instrument"] not in (None, *known):
        problems.append(Problem("--instrument", repr(options["instrument"]), ", ".join(known)))
    refuse(problems, "Nothing was recorded")
    usual = options["instrument"] or known[0]
    count = len(table.line)
    names = [name.strip() for name in map(str, table.columns[pose.column])] if pose else []
    devices = [usual] * count
    if "instrument" in table.columns:
        gap, column = table.gaps("instrument"), table.columns["instrument"]
        devices = [usual if gap[i] else str(column[i]).strip() for i in range(count)]
    places = [f"{path}, {table.row_names.one(line)}" for line in table.line]
    rows: list[Reading | Problem] = []
    for i, (place, device) in enumerate(zip(places, devices, strict=True)):
        at_rad = joints[i] if joints is not None and np.isfinite(joints[i]).all() else None
        if pose:
            point, subject = plan.points.number(names[i]), f"{names[i]!r} is"
        else:
            point = None if at_rad is None else point_at(plan, at_rad)
            subject = "its joints are"
        if point is None:
            rows.append(Problem(place, f"{subject} no candidate"))
        elif device not in known:
            rows.append(Problem(place, f"instrument {device!r} is unknown", ", ".join(known)))
        else:
            std = read.std_mm
            noise = None if std is None else ",".join(map(repr, map(float, std[i])))
            rows.append(Reading(point, read.position_mm[i], device, at_rad, noise))
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]
    relative = os.path.relpath(Path(path).resolve(), campaign.folder.resolve())
    return RowsOfFile(rows, places, digest, Path(relative).as_posix())
