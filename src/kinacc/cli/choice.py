"""Options the commands share: which calibration, which robot, which point."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import click

from kinacc.assess.statement import CONFIDENCE
from kinacc.config import schema
from kinacc.deployment import folder as results
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import Robot
from kinacc.tables.allowed import SELECTABLE
from kinacc.workflow.data_sets import read_data_sets
from kinacc.workflow.outdated import outdated_reason

Record = TypeVar("Record")
CONFIG = "config.yaml"


option = partial(click.option, show_default=True)
MODEL = click.Choice([*SELECTABLE, "nominal"])


def values_of(path: str) -> click.ParamType:
    """Values of an option for a key of the configuration, such as measurements.file.decimal."""
    key = schema.key(path)
    if "enum" in key:
        return click.Choice(key["enum"])
    ends = key["exclusiveMinimum"], key["exclusiveMaximum"]
    return click.FloatRange(*ends, min_open=True, max_open=True)


def positive(text: str) -> float:
    """A length or an angle of an option."""
    if not 0.0 < float(text) <= 1e6:
        raise click.BadParameter(f"{text}; allowed: above 0, to 1e+06")
    return float(text)


def share(text: str) -> float:
    """A share of an option, as 1% or 0.01."""
    return float(text.strip().removesuffix("%")) * (0.01 if "%" in text else 1.0)


ROBOT = option("--robot", help="Robot of the results: a shipped name or file. [as the results say]")
NAMING = option("--config", multiple=True, help="Configuration naming the robot.")
SELECTED = option(
    "--model",
    type=MODEL,
    help="Model to use. [the one selected; else the better on held-out poses]",
)
SESSION = option("--session", help="Session whose instrument is meant. [the first]")
POINT = option("--point", help="Target, or flange. [the tool]")


def together(*options: Callable[[Callable], Callable]) -> Callable[[Callable], Callable]:
    """Several options as one decorator, in their order."""

    def decorate(command: Callable) -> Callable:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


# Which calibration: its folder, the model, and the robot or the configuration naming it.
calibration_options = together(click.argument("folder", type=click.Path()), SELECTED, NAMING, ROBOT)
# Which point in which frame.
point_options = together(
    option(
        "--frame",
        type=click.Choice(["base", "instrument"]),
        default="base",
        help="The robot's own base, or the instrument that measured it.",
    ),
    POINT,
    SESSION,
)
# Noise, assessor and aims of a campaign that is begun or planned.
campaign_options = together(
    option("--noise-mm", help="Standard deviation per axis: one number, or three."),
    option("--covariance-mm2", help="Covariance of a reading: nine numbers, row by row."),
    option(
        "--repeatability",
        type=click.Path(),
        help="Noise that a repeatability test told, instead of --noise-mm: a .json file of `kinacc "
        "repeatability`.",
    ),
    option(
        "--resolution-mm",
        type=positive,
        help="Step in which positions are read off: no axis has less noise than its rounding.",
    ),
    option(
        "--noise",
        type=click.Choice(["known", "estimate"]),
        help="Whether --noise-mm is known, or what readings are planned with: it is then estimated "
        "from repeats within the campaign. [known]",
    ),
    option(
        "--wrong-readings",
        type=share,
        help="Largest share of readings that go wrong, e.g. 1%.  [none]",
    ),
    option(
        "--references",
        default=None,
        type=click.IntRange(0, 10_000),
        help="Readings at reference poses, to find drifts and steps.  [20 where the budget is at "
        "least 1.4 times the candidates, else 0]",
    ),
    option(
        "--error",
        type=click.Choice(["mean", "visit"]),
        help="The error that stays when a pose is measured again, or what 95 % of future visits to "
        "the worst pose keep. [mean]",
    ),
    option("--arm-mm", type=float, help="The arm's own repeatability, for --error visit. [noise]"),
    option("--allowance-mm", type=float, help="What no repeat sees, added to the bounds. [0]"),
    option("--assessor", help="How points are chosen and bounds made. [search_and_confirm]"),
    option("--set", "settings", multiple=True, help="Setting of the assessor: NAME=VALUE."),
    option("--confidence", type=float, help=f"How surely each bound is to hold. [{CONFIDENCE}]"),
    option("--tolerance-mm", type=positive, help="Largest error the arm is allowed to have."),
    option("--width-mm", type=positive, help="Wanted distance of upper from lower bound."),
    option(
        "--target",
        type=click.Choice(["candidates", "measured"]),
        default="candidates",
        help="Which largest error the aims are about.",
    ),
    option("--seed", default=0, type=click.IntRange(0), help="Decides every random draw."),
    option("--sure", is_flag=True, help="Take values that look like slips as they are."),
)


def robot_of(folder: str | Path, robot: str | None, config: tuple[str, ...]) -> Robot:
    """The robot a results folder belongs to: as given, as it says itself, or as configured.

    Raises InputError for a robot given that is not the one the results were made with.
    """
    recorded = results.recorded_robot(folder)
    if robot is None and not config and recorded is not None:
        return recorded
    if robot is None:
        if not config and not Path(CONFIG).is_file():
            message = f"is not given, and there is no {CONFIG} here"
            raise InputError(Problem("--robot", message, "a shipped name, a robot file"))
        datasets = read_data_sets(config or (CONFIG,)).settings
        name = Path(folder).resolve().name
        if name not in datasets:
            message = f"data set {name} is not in the configuration"
            raise InputError(Problem(str(folder), message, ", ".join(datasets), "give --robot"))
        robot = datasets[name]["robot"]
    arm = robots.load(robot)
    if recorded is not None:
        results.require_same_robot(recorded, arm, str(folder))
    return arm


def calibration_of(
    folder: str | Path,
    model: str | None,
    robot: str | None,
    config: tuple[str, ...],
    session: str | None = None,
) -> Calibration:
    """The calibration of a results folder."""
    tables = results.read_tables(folder)
    arm = robot_of(folder, robot, config)
    calibration = results.calibration(tables, arm, model, Path(folder).resolve().name, session)
    return replace(calibration, outdated=say_outdated(folder))


def say_outdated(folder: str | Path) -> str:
    """Print why results are outdated, if they are; returns the reason, empty where they are not."""
    reason = outdated_reason(folder)
    if reason:
        click.echo(f"{folder} is outdated: {reason}; run kinacc calibrate again", err=True)
    return reason
