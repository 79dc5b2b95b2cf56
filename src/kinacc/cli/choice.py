"""Options the commands share: which calibration, robot, point and campaign; forms of a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click

from kinacc.assess.statement import CONFIDENCE
from kinacc.config import schema
from kinacc.deployment import folder as results
from kinacc.deployment.record import Calibration
from kinacc.tables.allowed import SELECTABLE
from kinacc.workflow.described import outdated_reason

CONFIG = "config.yaml"
Command = Callable[..., Any]
Decorator = Callable[[Command], Command]
Options = Mapping[str, Any]  # of a command, by name
option = partial(click.option, show_default=True)
MODEL = click.Choice([*SELECTABLE, "nominal"])


def setting(name: str, key: str, text: str) -> Decorator:
    """An option with the values of a key of ``measurements.file``."""
    values = click.Choice(schema.key(f"measurements.file.{key}")["enum"])
    return option(name, type=values, help=text)


def positive(text: str) -> float:
    """A length or an angle of an option."""
    if not 0.0 < float(text) <= 1e6:
        raise click.BadParameter(f"{text}; allowed: above 0, to 1e+06")
    return float(text)


def share(text: str) -> float:
    """A share of an option, as 1% or 0.01."""
    return float(text.strip().removesuffix("%")) * (0.01 if "%" in text else 1.0)


PATH = click.Path()
FOLDER = click.argument("folder", type=PATH)
SELECTED = option(
    "--model",
    type=MODEL,
    help="Error model. [the selected one]",
)
DATASET = option("--dataset", help="Data set; needed where the configuration has several.")
REASON = option("--reason", help="Reason of the decision, kept with it.")
SESSION = option("--session", help="Session of the instrument. [the first]")
INSIDE = option("--inside-mm", help='Box of the tool in the base: "x0:x1,y0:y1,z0:z1".')
POINT = option("--point", help="Target, or flange. [the tool]")


def together(*options: Decorator) -> Decorator:
    """Several options as one decorator, in their order."""

    def decorate(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


# Which point in which frame.
point_options = together(
    option(
        "--frame",
        type=click.Choice(["base", "instrument"]),
        default="base",
        help="Base of the robot, or the instrument that measured it.",
    ),
    POINT,
    SESSION,
)
# How a measured file is written, where the file itself leaves it open.
_text = (
    setting("--encoding", "encoding", "Characters of a text file."),
    option("--sheet", help="Sheet of an Excel workbook."),
    setting("--decimal", "decimal", "Decimal mark."),
    option(
        "--thousands",
        type=click.Choice([".", ",", " ", "'", "none"]),
        help="Mark between thousands.",
    ),
    option("--names", metavar="A,B,..", help="Names of the columns of a file without any."),
)
_joints = (
    option("--take", multiple=True, metavar="COLUMN",
           help="Column to read, with those that go with it; repeatable."),
    setting("--joint-unit", "joint_unit", "Unit of the joints."),
    option("--pulses-per-deg", metavar="A,B,..", help="Pulses of each joint in a degree."),
)  # fmt: skip
file_options = together(
    *_joints,
    *_text,
    option(
        "--no-reading",
        metavar="NUMBER",
        help="Number for a missing reading, such as 0 (all of x, y, z) or 9999; or none.",
    ),
    option(
        "--sigma",
        type=click.Choice(["1", "2", "3", "none"]),
        help="Standard deviations in an uncertainty of the file; none leaves it out.",
    ),
    setting(
        "--direction-unit",
        "directions.unit",
        "Unit of an instrument's horizontal and vertical angles.",
    ),
    setting("--vertical", "directions.vertical", "Zero of vertical angles."),
    setting(
        "--horizontal", "directions.horizontal", "Sense of horizontal angles, seen from above."
    ),
)

# What a file of joints alone may leave open.
joint_file_options = together(*_text, *_joints)
_JOINT_ANSWERS = ("encoding", "sheet", "decimal", "thousands", "names", "take", "joint_unit",
                  "pulses_per_deg")  # fmt: skip
# Noise, assessor and aims of a campaign that is begun or planned.
campaign_options = together(
    option(
        "--noise-mm",
        help="Standard deviation per axis: one number, three, or nine of a covariance (mm^2).",
    ),
    option(
        "--repeatability",
        type=PATH,
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
        "wrong_rate",
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
        "error_of",
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
    option("--seed", default=0, type=click.IntRange(0), help="Decides every random draw."),
    option("--sure", is_flag=True, help="Take values that look like slips as they are."),
)


def joint_answers(options: Options) -> dict[str, Any]:
    """Answers of a command's options to what a file of joints leaves open."""
    return {name: options[name] for name in _JOINT_ANSWERS if options.get(name)}


def calibration_of(
    folder: str | Path, model: str | None = None, session: str | None = None
) -> Calibration:
    """The calibration of a results folder."""
    tables = results.read_tables(folder)
    calibration = results.calibration(tables, model, Path(folder).resolve().name, session)
    return replace(calibration, outdated=print_outdated(folder))


def print_outdated(folder: str | Path) -> str:
    """Print why results are outdated, if they are; returns the reason, empty where they are not."""
    reason = outdated_reason(folder)
    if reason:
        click.echo(f"{folder} is outdated: {reason}", err=True)
    return reason
