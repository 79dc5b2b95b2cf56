"""``kinacc campaign start``: candidates, instruments, assessor and budget of a campaign."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np
import pandas as pd

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.output import Output, answers

_SOURCES = {
    "measured": "drawn between neighbouring measured poses",
    "configured": "drawn evenly from the configured evaluation space",
    "fitted": "drawn evenly from the joints the calibration covers",
    "limits": "drawn evenly from the joint limits",
}
_MOST_DRAWS = 64  # joint values drawn per candidate before the region is called too wide
_MOST_CANDIDATES = 20_000


@click.command("start")
@click.argument("folder", type=click.Path(file_okay=False))
@option("--calibration", required=True, type=click.Path(), help="Results folder of the arm.")
@choice.SELECTED
@choice.ROBOT
@choice.NAMING
@choice.SESSION
@choice.POINT
@option("--candidates", default="200", help="File of joints, or number of joints to draw.")
@choice.joint_file_options
@option("--region", type=click.Choice([*_SOURCES]),
        help="Where joints are drawn. [configured if a space is configured, fitted with "
        "--joints-deg, else measured]")  # fmt: skip
@choice.JOINTS_DEG
@choice.INSIDE
@option("--instrument", multiple=True,
        help="NAME=noise: 1, 3 or 9 numbers, or laser:KEY=..; repeatable.")  # fmt: skip
@option("--frame", type=click.Choice(["instrument", "base"]), default="instrument",
        help="Frame of readings and covariances.")  # fmt: skip
@choice.campaign_options
@option("--budget", default=200, type=click.IntRange(1, 1_000_000), help="Readings in all.")
@option("--joint-tolerance-deg", default=0.02, type=choice.positive,
        help="Largest distance of reported joints from those of the pose.")  # fmt: skip
@option("--implausible-mm", type=choice.positive, help="Error beyond which a reading is refused.")
@choice.FROM_DEG
@option("--visit", type=click.Choice(["travel", "random"]), default="travel",
        help="Order of the first visit.")  # fmt: skip
@answers("JSON of the campaign.")
def start(out: Output, **options) -> None:
    """Start a campaign in FOLDER. Nothing of this can be changed once there are readings.

    Noise: instrument, target and how the arm repeats a pose. A laser tracker has range_mm,
    range_um_per_m, angle_mm, angle_um_per_m, repeat_mm (one standard deviation each).

    \b
    Example:
      kinacc campaign start check --calibration results/ur10_d --noise-mm 0.05 --budget 200
    """
    from kinacc.campaign import begin, doubts, folder, instrument, known_noise
    from kinacc.campaign.plan import Limits
    from kinacc.campaign.status import reason
    from kinacc.cli import campaign_options, rows
    from kinacc.errors import refuse

    refuse(folder.in_the_way(options["folder"]), "The campaign was not begun")
    results, point = Path(options["calibration"]), options["point"]
    used, tested = campaign_options.instruments(options, [results])
    names = ("model", "robot", "config", "session")
    arm = choice.calibration_of(results, *(options[name] for name in names))
    joints, labels, directions, source = _candidates(options, arm)
    points = begin.points_of(arm, joints, labels, directions, point)
    stand = rows.stand_of(arm.robot, options["from_deg"])
    limits = Limits(
        np.deg2rad(options["joint_tolerance_deg"]),
        options["implausible_mm"] or np.inf,
        _tolerance_mm(options["tolerance_mm"], results),
        options["width_mm"],
        options["target"],
    )
    plan = begin.plan_of(
        arm, points, campaign_options.assessor(options, options["budget"], len(points), tested),
        used, limits, options["seed"], stand, begin.about(arm, point, source),
        by_travel=options["visit"] == "travel",
    )  # fmt: skip
    plan = begin.start(
        options["folder"], arm, plan, doubts.noise_of(results), known_noise.doubts(tested),
        options["sure"],
    )  # fmt: skip
    answer = {
        "folder": options["folder"],
        **plan.about,
        "points": len(points),
        "first_visit": len(plan.route),
        "assessor": plan.assessor.name,
        "budget": plan.assessor.measurements,
        "references": getattr(plan.assessor, "references", 0),
        "noise": {device.name: instrument.noise(device) for device in plan.instruments},
        "tolerance_mm": plan.limits.tolerance_mm,
        "implausible_mm": plan.limits.implausible_mm,
        "far_from_data": int(np.sum(doubts.far_from_data(arm, points, point))),
        "shortfall": reason(plan.assessor.shortfall(*points.joints.shape)),
        "overruled": plan.overruled,
    }
    noise = "; ".join(f"{name}: {text}" for name, text in answer["noise"].items())
    lines = [
        "Campaign {folder}: largest error of {point} ({model} model of {calibration}) at {points} "
        "candidates, {candidates}; {tolerance}.",
        "{budget} readings by {assessor}: {first_visit} points first, {references} readings at "
        f"reference poses. Noise: {noise}.",
        "Note: {shortfall}." if answer["shortfall"] else "",
        *(f"Overruled: {text}." for text in plan.overruled),
        f"Next: kinacc campaign next {shlex.quote(options['folder'])}",
    ]
    limit = plan.limits.tolerance_mm
    shown = answer | {"tolerance": "no tolerance" if limit is None else f"tolerance {limit:g} mm"}
    out.show(answer, pd.DataFrame(), [line.format(**shown) for line in lines if line])


def _tolerance_mm(tolerance_mm: float | None, results: Path) -> float | None:
    """The tolerance of the option, or that of the calibration's configuration if of a bound."""
    from kinacc.report.summarise import tolerance_of
    from kinacc.tables import store

    path = results / "summary.parquet"
    if tolerance_mm is not None or not path.is_file():
        return tolerance_mm
    stated = tolerance_of({"summary": store.read(path)})
    return stated.mm if stated is not None and stated.of == "bound" else None


def _candidates(options: Mapping, arm):
    """Joints (m, k), labels, directions (m, k) or None, and the source of the candidates."""
    from kinacc.cli import rows
    from kinacc.deployment.applicability import is_measured_there
    from kinacc.errors import InputError, Problem
    from kinacc.kinematics.model import JointState

    path = options["candidates"]
    if not path.lstrip("-").isdecimal():
        answered = choice.joint_answers(options)
        file, joints = rows.candidates(path, arm.robot, _MOST_CANDIDATES, answered)
        label = list(map(str, file.label))
        return joints, label, file.directions, f"rows of {Path(path).name}"
    count = int(path)
    if not 2 <= count <= _MOST_CANDIDATES:
        raise InputError(Problem("--candidates", path, f"2 to {_MOST_CANDIDATES}, or a file"))
    region, draw = _region(options, arm)
    only_measured = region == "measured" or not (options["region"] or options["joints_deg"])
    for times in (1, 4, 16, _MOST_DRAWS):
        joints = draw(times * count)
        state = JointState(arm.robot.dh_joints(joints))
        if only_measured:
            joints = joints[is_measured_there(arm, state, options["point"])]
        elif arm.model.domain is not None:  # coupled joints have no box of their own
            joints = joints[~arm.outside_range(state.q_rad).any(axis=1)]
        if len(joints) >= count:
            labels = [str(number) for number in range(1, count + 1)]
            return joints[:count], labels, None, _SOURCES[region]
    message = (
        f"only {len(joints)} of {_MOST_DRAWS * count} joint values drawn are near measured poses"
    )
    raise InputError(Problem("candidates", message, f"{count}", "narrow the region"))


def _region(options: Mapping, arm):
    """The region's name, and a function that draws so many reported joints (at most n, k)."""
    from kinacc.cli import spaces
    from kinacc.deployment.planning import between, spread, tool_positions
    from kinacc.errors import InputError, Problem, refuse
    from kinacc.kinematics.inverse import limits

    robot, target, problems = arm.robot, arm.point(options["point"]), list[Problem]()
    box = spaces.joint_ranges(options["joints_deg"], robot, problems)
    space = spaces.ranges("--inside-mm", options["inside_mm"], 3, problems)
    refuse(problems)
    inside = None if space is None else spaces.inside_box(space)
    usual = "measured" if arm.fitted is not None else "fitted"
    region = options["region"] or ("fitted" if box is not None else None)
    if region in (None, "configured"):
        configured = _configured(options, arm, wanted=region is not None)
        region = usual if configured is None else "configured"
        if configured is not None:
            box = configured.box if box is None else box
            inside = inside or configured.inside
    if region == "measured" and usual != region:
        message = "the results do not hold the poses that were fitted"
        raise InputError(Problem("--region measured", message, "fitted, limits, configured"))
    if region == "limits" and arm.model.domain is not None and box is None:
        message = f"the {arm.choice.upper()} model ends at the joints the data cover"
        raise InputError(Problem("--region limits", message, "measured, fitted"))
    low, high = robot.q_min_rad, robot.q_max_rad
    if region not in ("measured", "limits") and arm.fitted_range_rad is not None:
        low, high = limits.cut_to_range(robot, low, high, arm.fitted_range_rad)
    if box is not None:
        low, high = np.maximum(low, box[0]), np.minimum(high, box[1])
    if region != "measured":
        return region, lambda count: spread(robot, count, (low, high), inside, target)

    def draw(count: int) -> np.ndarray:
        poses = limits.reported_joints(robot, arm.fitted.q_rad)
        drawn = between(poses, limits.travel_unit(robot), count, options["seed"])
        usable = limits.within(drawn, low, high)
        if inside is not None:
            usable &= inside(tool_positions(robot, drawn, target))
        return drawn[usable]

    return region, draw


def _configured(options: Mapping, arm, wanted: bool):
    """The space of the calibration's data set in the configuration; None where there is none."""
    from kinacc.cli import spaces
    from kinacc.errors import InputError

    try:
        if not wanted and not options["config"] and not Path(choice.CONFIG).is_file():
            return None
        settings = spaces.settings_of(arm.name, options["config"])
    except InputError:
        if wanted:
            raise
        return None
    return None if settings.inside is None and settings.box is None else settings
