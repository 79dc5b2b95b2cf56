"""``kinacc compare``: two calibrations of one arm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.output import answers

if TYPE_CHECKING:
    import numpy as np

    from kinacc.deployment.record import Calibration


@click.command("compare")
@click.argument("first", type=click.Path())
@click.argument("second", type=click.Path())
@option("--joints", type=click.Path(), help="File of joints to compare poses at. [as measured]")
@option("--poses", "count", default=500, type=click.IntRange(10, 100_000), help="At most.")
@option("--model", type=choice.MODEL, default="dh", help="Error model.")
@choice.ROBOT
@choice.NAMING
@answers(table=True, picture="Picture as .svg, .png or .pdf.", page="Page as .html.", verbose=True)
def compare(first, second, joints, count, model, robot, config, out) -> None:
    """Compare two calibrations of one arm: whether it changed, and how far its poses moved.

    FIRST and SECOND are results folders or robot files. Poses are those of both data sets; "by
    chance" is the change that two calibrations of an unchanged arm show. --verbose prints every
    parameter.

    \b
    Example:
      kinacc compare results/ur10_b results/ur10_d --page moved.html --picture moved.svg
      kinacc compare before.yaml after.yaml --json
    """
    from kinacc.config import schema
    from kinacc.deployment import compare as comparison
    from kinacc.deployment.shared_readings import shared
    from kinacc.progress import reporting
    from kinacc.report.comparison import comparison_page, lines
    from kinacc.tables import store

    with reporting("compare", bar=True):
        both = [_calibration(place, model, robot, config) for place in (first, second)]
        comparison.require_alike(*both)
        q_rad = _joints(both, (first, second), joints, count)
        weight = schema.key("calibration.rotation_weight_mm_per_rad")["default"]
        tables = [store.read(file) if file.is_file() else None for file in _files((first, second))]
        result = comparison.compare(*both, q_rad, weight, shared(*tables))
    if out.picture is not None:
        from kinacc.figures.comparison import draw

        out.draw(draw(result))
    if out.page is not None:
        out.write_page(comparison_page(result, both[0], q_rad))
    table = result.shifts if result.parameters is None else result.parameters
    out.show(result, table, lines(result), table if out.verbose else result.shifts)


def _calibration(place: str, model: str, robot: str | None, config: tuple[str, ...]) -> Calibration:
    """The calibration of a results folder, or the robot of a file."""
    from kinacc.calibration.misfit import misfit
    from kinacc.deployment.folder import read_tables
    from kinacc.deployment.record import nominal
    from kinacc.errors import InputError, Problem
    from kinacc.kinematics import robot as robots

    path = Path(place)
    if path.is_dir():
        calibration = choice.calibration_of(path, model, robot, config)
        tables = read_tables(path)
        return replace(
            calibration, name=place, misfit=misfit(tables, calibration.robot, calibration.choice)
        )
    if path.is_file() or place in robots.shipped():
        return replace(nominal(robots.load(place), place), choice="dh")
    raise InputError(Problem(place, "no such file or folder", "a results folder, a robot file"))


def _joints(both, places: tuple[str, str], path: str | None, count: int) -> np.ndarray:
    """Reported joints (n, k) to compare at: of a file, as measured, or all over the limits."""
    import numpy as np

    from kinacc.cli import rows
    from kinacc.kinematics.region import points
    from kinacc.study.operating_points import spread_rows
    from kinacc.tables import store

    robots = [item.robot for item in both]
    if path is not None:
        return rows.read(path, robots[0]).joints
    names = [f"q{joint + 1}" for joint in range(robots[0].dh.joints)]
    tables = [
        store.read_table(file)[names].to_numpy(float) for file in _files(places) if file.is_file()
    ]
    if tables:
        share = max(1, count // len(tables))
        return np.concatenate([q[np.sort(spread_rows(len(q), share))] for q in tables])
    low = np.max([robot.q_min_rad for robot in robots], axis=0)
    high = np.min([robot.q_max_rad for robot in robots], axis=0)
    return low + points("sobol", count, len(low)) * (high - low)


def _files(places: tuple[str, str]) -> list[Path]:
    return [Path(place) / "measurements.parquet" for place in places]
