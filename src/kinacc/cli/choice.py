"""Options the commands share: which calibration, which robot, and where the answer goes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.artifacts.allowed import SELECTABLE
from kinacc.config import schema
from kinacc.errors import InputError, Problem

if TYPE_CHECKING:
    from kinacc.cli.sheet import Sheet
    from kinacc.deployment.record import Calibration
    from kinacc.kinematics.robot import Robot

CONFIG = "config.yaml"
MODEL = click.Choice([*SELECTABLE, "nominal"])


def values_of(path: str) -> click.ParamType:
    """What an option takes that stands for a key of the configuration, such as study.alpha."""
    key = schema.key(path)
    if key.kind == "text":
        return click.Choice(key.choices)
    if key.kind == "int":
        return click.IntRange(key.low, key.high)
    return click.FloatRange(key.low, key.high, min_open=key.open_ends, max_open=key.open_ends)


def calibration_options(command: Callable) -> Callable:
    """Which calibration: its folder, the model, and the robot or the configuration naming it."""
    for option in (
        click.option(
            "--robot", help="Robot of the results: a shipped name or file. [as the results say]"
        ),
        click.option("--config", multiple=True, help="Configuration naming the robot."),
        click.option(
            "--model",
            type=MODEL,
            help="Model to use. [the one selected; else the better on held-out poses]",
        ),
        click.argument("folder", type=click.Path()),
    ):
        command = option(command)
    return command


def output_options(command: Callable) -> Callable:
    """Where the answer goes."""
    for option in (
        click.option("--force", is_flag=True, help="Replace a file that is there."),
        click.option("--json", "as_json", is_flag=True, help="Print the answer as JSON."),
        click.option(
            "--output", "-o", type=click.Path(), help="Write to a .csv, .json or .parquet file."
        ),
    ):
        command = option(command)
    return command


def point_options(command: Callable) -> Callable:
    """Which point in which frame."""
    for option in (
        click.option("--session", help="Session whose instrument is meant. [the first]"),
        click.option("--point", help="Target, or flange. [the tool]"),
        click.option(
            "--frame",
            type=click.Choice(["base", "instrument"]),
            default="base",
            show_default=True,
            help="The robot's own base, or the instrument that measured it.",
        ),
    ):
        command = option(command)
    return command


def robot_of(folder: str | Path, robot: str | None, config: tuple[str, ...]) -> Robot:
    """The robot a results folder belongs to: as given, as it says itself, or as configured.

    Raises InputError for a robot given that is not the one the results were made with.
    """
    from kinacc.deployment import folder as results
    from kinacc.kinematics import robot as robots

    recorded = results.recorded_robot(folder)
    if robot is None and not config and recorded is not None:
        return recorded
    given = robots.load(robot if robot is not None else _configured(folder, config))
    if recorded is not None:
        results.require_same_robot(recorded, given, str(folder))
    return given


def _configured(folder: str | Path, config: tuple[str, ...]) -> str:
    """What the configuration calls the robot of a results folder."""
    from kinacc.workflow.plan import planned

    if not config and not Path(CONFIG).is_file():
        what = f"is not given, and there is no {CONFIG} here"
        raise InputError(Problem("--robot", what, "a shipped name, a robot file"))
    plan = planned(config or (CONFIG,))
    name = Path(folder).resolve().name
    if name not in plan.datasets:
        what = f"data set {name} is not in the configuration"
        allowed = ", ".join(plan.datasets)
        raise InputError(Problem(str(folder), what, allowed, "give --config or --robot"))
    return plan.datasets[name]["robot"]


def calibration_of(
    folder: str | Path,
    model: str | None,
    robot: str | None,
    config: tuple[str, ...],
    session: str | None = None,
) -> Calibration:
    """The calibration of a results folder."""
    from kinacc.deployment import folder as results

    tables = results.read_tables(folder)
    name = Path(folder).resolve().name
    return results.calibration(tables, robot_of(folder, robot, config), model, name, session)


def deliver(sheet: Sheet, output: str | None, as_json: bool, force: bool) -> None:
    """Write, and print for a machine or for a person."""
    if output is not None:
        sheet.write(output, force)
    if as_json:
        click.echo(sheet.as_json())
    elif output is None:
        click.echo(sheet.as_text())
    else:
        click.echo(f"{sheet.title}\n{len(sheet)} rows: {output}" if sheet.title else output)
