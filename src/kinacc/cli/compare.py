"""``kinacc compare``: two calibrations of one arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click
import numpy as np

from kinacc.calibration.summary import reported_joints
from kinacc.cli import choice, rows
from kinacc.cli.choice import option
from kinacc.cli.output import Output, answers
from kinacc.config import schema
from kinacc.deployment import compare as comparison
from kinacc.deployment.planning import spread
from kinacc.deployment.record import Calibration, nominal
from kinacc.deployment.shared_readings import shared
from kinacc.errors import input_error
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import Robot
from kinacc.progress import reporting
from kinacc.report.rendering import lines
from kinacc.study.operating_points import spread_rows
from kinacc.tables import store
from kinacc.tables.columns import Columns

_POSES = 500  # at most, of measured ones


@click.command("compare")
@click.argument("first", type=choice.PATH)
@click.argument("second", type=choice.PATH)
@option("--joints", type=choice.PATH, help="File of joints to compare poses at. [as measured]")
@option("--model", type=choice.MODEL, default="dh", help="Error model.")
@answers(table=True, picture="Picture: .svg, .png or .pdf.", verbose=True)
def compare(
    first: str,
    second: str,
    joints: str | None,
    model: str,
    out: Output,
) -> None:
    """Compare two calibrations of one arm: whether it changed, and how far its poses moved.

    FIRST and SECOND are results folders or robot files. "By chance" is the change that two
    calibrations of an unchanged arm show.

    \b
    Example:
      kinacc compare results/ur10_b results/ur10_d --picture moved.svg
    """
    with reporting("compare"):
        both = [_calibration(place, model) for place in (first, second)]
        comparison.require_alike(*both)
        files = [Path(place) / "measurements.parquet" for place in (first, second)]
        tables = [store.read(file) if file.is_file() else None for file in files]
        if joints is not None:
            q_rad = rows.read_joints(joints, both[0].robot)[1]
        else:
            q_rad = _joints([item.robot for item in both], tables)
        weight = schema.key("calibration.rotation_weight_mm_per_rad")["default"]
        result = comparison.compare(both[0], both[1], q_rad, weight, shared(*tables))
    if out.picture is not None:
        from kinacc.figures.calibration import draw_comparison

        out.draw(draw_comparison(result))
    table = result.shifts if result.parameters is None else result.parameters
    text = lines("comparison.txt", found=result, compare=comparison)
    out.show(result, table, text, table if out.verbose else result.shifts)


def _calibration(place: str, model: str) -> Calibration:
    """The calibration of a results folder, or the robot of a file."""
    path = Path(place)
    if path.is_dir():
        return replace(choice.calibration_of(path, model), name=place)
    if path.is_file() or place in robots.shipped():
        return replace(nominal(robots.load(place), place), choice="dh")
    raise input_error(place, "no such file or folder", "a results folder, a robot file")


def _joints(arms: Sequence[Robot], measured: Sequence[Columns | None]) -> np.ndarray:
    """Reported joints (n, k) to compare at: as measured, or all over the limits."""
    joints = arms[0].dh.joints
    tables = [reported_joints(table, joints) for table in measured if table]
    if tables:
        measured_rad = np.concatenate(tables)
        return measured_rad[np.sort(spread_rows(len(measured_rad), _POSES))]
    return spread(arms[0], _POSES, (arms[1].q_min_rad, arms[1].q_max_rad))
