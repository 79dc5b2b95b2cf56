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
def record(out, folder, file, **given) -> None:
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

    if (given["position_mm"] is None) == (file is None):
        what = "is given twice" if file else "is not given"
        raise InputError(Problem("the reading", what, "--position-mm, or a FILE"))
    campaign = Campaign(folder)
    flags = {name: given[name] for name in ("accept_implausible", "again")}
    asked = campaign.state.asked
    if file is None:
        taken = campaign.add_reading(**_single(given, campaign.plan.slides), **flags)
    else:
        rows = _of_file(file, given, campaign)
        taken = campaign.add_readings(rows, **flags, skip_bad=given["skip_bad"])
    found = campaign.status()
    for each in taken.skipped:
        click.echo(f"not taken: {each}", err=True)
    if file is not None:
        known = f"; {len(taken.known)} rows were recorded before" if taken.known else ""
        first = f"Recorded {len(taken.numbers)} readings of {file}{known}."
    else:
        point, label = taken.points[0], campaign.plan.points.label
        first = f"Recorded reading {taken.numbers[0]} at point {point}: {taken.error_mm[0]:.3f} mm"
        first += " from the model."
        if asked is not None and point != label[asked]:
            first += f" It is used when its point is requested; {label[asked]} is next."
    answer = {**vars(taken), "status": found}
    out.show(answer, pd.DataFrame(), [first, *status_lines(found)])


def _single(given: Mapping, slides: np.ndarray) -> dict[str, object]:
    """Arguments of ``Campaign.add_reading``."""
    from kinacc.errors import Problem, refuse
    from kinacc.measurements.table import numbers_of

    problems: list[Problem] = []
    values: dict[str, np.ndarray] = {}
    for name, count in (
        ("position_mm", 3),
        ("joints_deg", len(slides)),
        ("joints_rad", len(slides)),
    ):
        if (text := given[name]) is None:
            continue
        values[name] = numbers_of(text)
        if values[name].shape != (count,):
            place = f"--{name.replace('_', '-')}"
            problems.append(Problem(place, repr(text), f"{count} numbers"))
    refuse(problems, "Nothing was recorded")
    joints = values.get("joints_rad")
    if joints is None and "joints_deg" in values:
        joints = values["joints_deg"] * np.where(slides, 1.0, np.pi / 180.0)
    return {
        "position_mm": values["position_mm"],
        "joints": joints,
        **{name: given[name] for name in ("point", "instrument", "std_mm")},
    }


def _of_file(path: str, given: Mapping, campaign):
    """The rows of a file as readings, or what is wrong with them."""
    from kinacc.campaign.campaign import RowsOfFile
    from kinacc.campaign.reading import Reading, point_at
    from kinacc.errors import Problem, refuse
    from kinacc.measurements.rows import POINTS, read_rows

    plan = campaign.plan
    # A cell that is no number spoils its row, not the file: it is named row by row.
    rows_of_file = read_rows(path, plan.slides, POINTS, spoilt=[])
    table, joints, std = rows_of_file.table, rows_of_file.joints, rows_of_file.std_mm
    names = rows_of_file.columns.single.get("pose")
    if names:
        table = table.with_pose_names(names.column)
    problems = [
        Problem(f"--{name.replace('_', '-')}", "is given with a file", "a column of the file")
        for name in _OF_ONE
        if given[name] is not None
    ]
    problems += [
        Problem(path, f"holds positions that kinacc {command} computed", "measured positions")
        for command, column in _COMPUTED.items()
        if column in table.columns
    ]
    known = {instrument.name for instrument in plan.instruments}
    if not names and joints is None and not problems:
        problems.append(Problem(path, "has no column pose and no joints", "pose, q1_deg"))
    if given["instrument"] not in (None, *known):
        problems.append(Problem("--instrument", f"{given['instrument']!r}", ", ".join(known)))
    refuse(problems, "Nothing was recorded")
    rows: list[Reading | Problem] = []
    places = [f"{path}, {table.row_names.one(line)}" for line in table.line]
    for i, place in enumerate(places):
        at = None if joints is None or not np.isfinite(joints[i]).all() else joints[i]
        name = str(table.columns[names.column][i]).strip() if names else None
        if name is not None:
            point = plan.points.number(name)
        else:
            point = None if at is None else point_at(plan, at)
        instrument = given["instrument"] or plan.instruments[0].name
        if "instrument" in table.columns and not table.is_gap(table.columns["instrument"][i]):
            instrument = str(table.columns["instrument"][i]).strip()
        if point is None:
            what = "its joints are" if name is None else f"{name!r} is"
            rows.append(Problem(place, f"{what} no candidate"))
        elif instrument not in known:
            rows.append(Problem(place, f"instrument {instrument!r} is unknown", ", ".join(known)))
        else:
            noise = None if std is None else ",".join(repr(float(value)) for value in std[i])
            rows.append(Reading(point, rows_of_file.position_mm[i], instrument, at, noise))
    return RowsOfFile(
        rows,
        places,
        hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16],
        Path(os.path.relpath(Path(path).resolve(), campaign.folder.resolve())).as_posix(),
    )
