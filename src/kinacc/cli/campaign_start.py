"""``kinacc campaign start``: candidates, instruments, assessor and budget of a campaign."""

from __future__ import annotations

import json
import shlex
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from kinacc.assess.adaptive import AdaptiveAssessor
from kinacc.assess.noise import ESTIMATED
from kinacc.assess.registry import RECOMMENDED
from kinacc.campaign import begin
from kinacc.campaign import plan as plans
from kinacc.campaign.instrument import BASE, Instrument, floored, instruments, read_repeatability
from kinacc.campaign.plan import Limits
from kinacc.campaign.status import reason
from kinacc.cli import choice, rows, spaces
from kinacc.cli.choice import Options, option
from kinacc.cli.output import Output, answers
from kinacc.deployment.applicability import is_measured_there
from kinacc.deployment.planning import between, spread, tool_positions
from kinacc.deployment.record import Calibration
from kinacc.errors import Problem, input_error
from kinacc.kinematics.inverse import limits as ends
from kinacc.kinematics.model import JointState
from kinacc.report.rendering import lines
from kinacc.report.summarise import tolerance_of
from kinacc.tables import store

# Settings of assessors that have an option.
_SETTINGS = ("wrong_rate", "references", "error_of", "arm_mm", "allowance_mm", "confidence")
_MOST_DRAWS = 64  # joint values drawn per candidate before the region is called too wide
_MOST_CANDIDATES = 20_000


@click.command("start")
@click.argument("folder", type=click.Path(file_okay=False))
@option("--calibration", required=True, type=choice.PATH, help="Results folder of the arm.")
@choice.SELECTED
@choice.SESSION
@choice.POINT
@option("--candidates", default="200", help="File of joints, or number of joints to draw.")
@choice.joint_file_options
@option(
    "--joints-deg",
    help='Ranges of joints to draw, e.g. "-90:90,-60:60,...". [between measured poses]',
)
@choice.INSIDE
@option("--instrument", multiple=True,
        help="NAME=noise: 1, 3 or 9 numbers, or laser:KEY=..; repeatable.")  # fmt: skip
@option("--frame", type=click.Choice(["instrument", "base"]), default="instrument",
        help="Frame of readings and covariances.")  # fmt: skip
@choice.campaign_options
@option("--budget", default=200, type=click.IntRange(1, 1_000_000), help="Readings in all.")
@option("--joint-tolerance-deg", default=0.02, type=choice.positive,
        help="Largest distance of reported joints from those of the pose.")  # fmt: skip
@answers()
def start(out: Output, **options: Any) -> None:
    """Start a campaign in FOLDER. Nothing of this can be changed once there are readings.

    Noise: instrument, target and how the arm repeats a pose. A laser tracker has range_mm,
    range_um_per_m, angle_mm, angle_um_per_m, repeat_mm (one standard deviation each).

    \b
    Example:
      kinacc campaign start check --calibration results/ur10_d --noise-mm 0.05 --budget 200
    """
    results, point = Path(options["calibration"]), options["point"]
    used, freedom, doubts = instruments_of(options)
    arm = choice.calibration_of(results, options["model"], options["session"])
    draw = partial(_drawn, options, arm)
    inputs, joints = rows.candidates(options, arm.robot, _MOST_CANDIDATES, draw)
    points = begin.points_of(arm, joints, inputs.label, inputs.directions, point)
    source = "drawn between neighbouring measured poses"
    if inputs.table is not None:
        source = f"rows of {Path(inputs.table.path).name}"
    elif options["joints_deg"] is not None:
        source = "drawn evenly from the joints the calibration covers"
    tolerance_mm = _tolerance_mm(options["tolerance_mm"], results)
    apart_rad = np.deg2rad(options["joint_tolerance_deg"])
    limits = Limits(apart_rad, tolerance_mm=tolerance_mm)
    assessor = assessor_of(options, options["budget"], len(points), freedom)
    plan = begin.plan_of(arm, points, assessor, used, limits, point, source, options["seed"])
    known = begin.noise_of(results)
    plan = begin.start(options["folder"], arm, plan, doubts, known, options["sure"])
    answer = {
        "folder": options["folder"],
        **plan.about,
        "points": len(points),
        "first_visit": len(plan.route),
        "assessor": assessor.name,
        "budget": assessor.measurements,
        "references": getattr(assessor, "references", 0),
        "noise": {device.name: device.noise for device in plan.instruments},
        "tolerance_mm": limits.tolerance_mm,
        "implausible_mm": plan.limits.implausible_mm,
        "shortfall": reason(assessor.shortfall(len(points))),
        "overruled": plan.overruled,
    }
    command = f"kinacc campaign next {shlex.quote(options['folder'])}"
    out.show(answer, lines=lines("campaign_start.txt", **answer, next_command=command))


def instruments_of(options: Options) -> tuple[tuple[Instrument, ...], int, list[Problem]]:
    """Return the instruments of the options of ``start`` and ``plan``.

    Also degrees of freedom (0 without ``--repeatability``) and doubts of the test of their noise.
    Raises InputError without any noise.
    """
    frame, resolution_mm = options.get("frame", BASE), options["resolution_mm"] or 0.0
    noise_mm = options["noise_mm"]
    texts = [] if noise_mm is None else [f"instrument={noise_mm}"]
    texts += options.get("instrument", ())
    if options["repeatability"] is not None:
        if texts:
            raise input_error("--repeatability", f"is given beside {', '.join(texts)}")
        covariance, freedom, doubts = read_repeatability(options["repeatability"])
        covariance = floored(covariance, resolution_mm)
        used = Instrument("instrument", covariance, frame, None, resolution_mm)
        return (used,), freedom, doubts
    if not texts:
        raise input_error("noise", "is not given", fix=begin.WAYS_TO_NOISE)
    return instruments(texts, frame, resolution_mm), 0, []


def assessor_of(options: Options, budget: int, points: int, freedom: int) -> AdaptiveAssessor:
    """Return the assessor of the options of ``start`` and ``plan`` for so many candidates.

    ``freedom``: degrees of freedom of the test of the noise, 0 without one. Raises InputError for
    settings that the assessor does not have.
    """
    settings: dict[str, object] = {
        name: options[name] for name in _SETTINGS if options[name] is not None
    }
    settings["measurements"] = budget
    if options["noise"] == "estimate" or freedom:
        settings |= {"noise": ESTIMATED, "noise_freedom": freedom}
    for text in options["settings"]:
        key, equals, value = text.partition("=")
        if not equals:
            raise input_error("--set", repr(text), "NAME=VALUE")
        try:
            settings[key.strip()] = json.loads(value)
        except (ValueError, RecursionError):
            settings[key.strip()] = value.strip()
    return plans.assessor_of(options["assessor"] or RECOMMENDED, settings, points)


def _tolerance_mm(tolerance_mm: float | None, results: Path) -> float | None:
    """The tolerance of the option, or that of the calibration's configuration if of a bound."""
    path = results / "summary.parquet"
    if tolerance_mm is not None or not path.is_file():
        return tolerance_mm
    stated = tolerance_of({"summary": store.read(path)})
    return stated.mm if stated is not None and stated.of == "bound" else None


def _drawn(options: Options, arm: Calibration, count: int) -> np.ndarray:
    """Reported joints (count, k) that the calibration covers, by the options of the command."""
    if arm.fitted is None or arm.fitted_range_rad is None:
        raise input_error("candidates", "the results hold no measurements", "a file of joints")
    robot, target = arm.robot, arm.point(options["point"])
    box, inside = spaces.of_options(options, robot)
    poses = ends.reported_joints(robot, arm.fitted.q_rad)
    for times in (1, 4, 16, _MOST_DRAWS):
        if box is not None:
            cut = ends.cut_to_range(robot, *box, arm.fitted_range_rad)
            joints = spread(robot, times * count, cut, inside, target)
            # Coupled joints have no box of their own.
            joints = joints[~arm.outside_range(robot.dh_joints(joints)).any(axis=1)]
        else:
            joints = between(poses, robot.dh.travel_unit, times * count, options["seed"])
            joints = joints[ends.within(joints, robot.q_min_rad, robot.q_max_rad)]
            if inside is not None:
                joints = joints[inside(tool_positions(robot, joints, target))]
            state = JointState(robot.dh_joints(joints))
            joints = joints[is_measured_there(arm, state, options["point"])]
        if len(joints) >= count:
            return joints[:count]
    message = (
        f"only {len(joints)} of {_MOST_DRAWS * count} joint values drawn are near measured poses"
    )
    raise input_error("candidates", message, f"{count}", "narrow the region")
