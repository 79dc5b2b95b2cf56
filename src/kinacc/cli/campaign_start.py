"""``kinacc campaign start``: candidates, instruments, assessor and budget of a campaign."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pandas as pd

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.file_options import joint_file_options
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
@joint_file_options
@option("--region", type=click.Choice([*_SOURCES]),
        help="Where joints are drawn. [configured if a space is configured, fitted with "
        "--joints-deg, else measured]")  # fmt: skip
@option("--joints-deg", help='Ranges to draw from, e.g. "-90:90,-60:60,...".')
@option("--inside-mm", help='Box of the tool in the base: "x0:x1,y0:y1,z0:z1".')
@option("--instrument", multiple=True,
        help="NAME=noise: 1, 3 or 9 numbers, or laser:KEY=..; repeatable.")  # fmt: skip
@option("--frame", type=click.Choice(["instrument", "base"]), default="instrument",
        help="Frame of readings and covariances.")  # fmt: skip
@choice.campaign_options
@option("--budget", default=200, type=click.IntRange(1, 1_000_000), help="Readings in all.")
@option("--joint-tolerance-deg", default=0.02, type=float,
        help="Largest distance of reported joints from those of the pose.")  # fmt: skip
@option("--implausible-mm", type=float, help="Error beyond which a reading is refused.")
@option("--from-deg", help="Joints the arm starts at. [zero]")
@option("--visit", type=click.Choice(["travel", "random"]), default="travel",
        help="Order of the first visit.")  # fmt: skip
@answers("JSON of the campaign.")
def start(out: Output, **given) -> None:
    """Start a campaign in FOLDER. Nothing of this can be changed once there are readings.

    Noise: instrument, target and how the arm repeats a pose. A laser tracker has range_mm,
    range_um_per_m, angle_mm, angle_um_per_m, repeat_mm (one standard deviation each).

    \b
    Example:
      kinacc campaign start check --calibration results/ur10_d --noise-mm 0.05 --budget 200
    """
    from kinacc.assess.adaptive import AdaptiveAssessor
    from kinacc.campaign import begin, folder, instrument, known_noise, slips
    from kinacc.campaign.plan import Limits, with_references
    from kinacc.campaign.reasons import reason
    from kinacc.cli import campaign_options, rows
    from kinacc.errors import Problem, gathered, refuse

    problems: list[Problem] = folder.in_the_way(given["folder"])
    results = Path(given["calibration"])
    tested, instruments, assessors = None, (), list[AdaptiveAssessor]()
    with gathered(problems):
        tested = campaign_options.tested_noise(given["repeatability"])
    with gathered(problems):
        instruments = campaign_options.instruments(given, tested, [results])
    with gathered(problems):
        assessors.append(campaign_options.assessor(given, given["budget"], tested))
    lengths = ("tolerance_mm", "width_mm", "joint_tolerance_deg", "implausible_mm")
    problems += campaign_options.not_positive(**{name: given[name] for name in lengths})
    refuse(problems, "The campaign was not begun")
    arm = choice.calibration_of(
        results, given["model"], given["robot"], given["config"], given["session"]
    )
    joints, labels, directions, source = _candidates(given, arm)
    points = begin.points_of(arm, joints, labels, directions, given["point"])
    at = np.zeros(arm.robot.dh.joints)
    if given["from_deg"] is not None:
        at = rows.of_arguments((given["from_deg"],), "deg", arm.robot, "--from-deg")[0]
    tolerance_mm = _tolerance_mm(given["tolerance_mm"], results)
    limits = Limits(
        np.deg2rad(given["joint_tolerance_deg"]),
        given["implausible_mm"] or begin.plausible_mm(arm, instruments, points),
        tolerance_mm,
        given["width_mm"],
        given["target"],
    )
    plan = begin.plan_of(
        arm, points, with_references(assessors[0], len(points), given["references"]), instruments,
        limits, given["seed"], at, begin.about(arm, given["point"], source),
        by_travel=given["visit"] == "travel",
    )  # fmt: skip
    doubts = [
        *slips.of_noise(plan.instruments, begin.unexplained_mm(arm)),
        *known_noise.doubts(tested),
        *slips.of_little_noise(plan.instruments, slips.noise_of(results)),
        *slips.of_candidates(arm, points, given["point"]),
    ]
    if not given["sure"]:
        refuse(doubts, "The campaign was not begun")
    plan = replace(plan, overruled=tuple(f"{each.where}: {each.what}" for each in doubts))
    folder.start(given["folder"], plan)
    noise = {each.name: instrument.noise(each) for each in plan.instruments}
    answer = {
        "folder": given["folder"],
        **plan.about,
        "points": len(points),
        "first_visit": len(plan.route),
        "assessor": plan.assessor.name,
        "budget": plan.assessor.measurements,
        "references": getattr(plan.assessor, "references", 0),
        "noise": noise,
        "tolerance_mm": tolerance_mm,
        "implausible_mm": plan.limits.implausible_mm,
        "far_from_data": int(np.sum(slips.far_from_data(arm, points, given["point"]))),
        "shortfall": reason(plan.assessor.shortfall(*points.joints.shape)),
        "overruled": plan.overruled,
    }
    tolerance = "none" if tolerance_mm is None else f"{tolerance_mm:g} mm"
    lines = [
        f"Campaign {given['folder']}: largest error of {plan.about['point']} "
        f"({plan.about['model']} model of {plan.about['calibration']}) at {len(points)} "
        f"candidates, {source}; tolerance: {tolerance}.",
        f"{answer['budget']} readings by {answer['assessor']}: {len(plan.route)} points first, "
        f"{answer['references']} readings at reference poses.",
        f"Noise: {'; '.join(f'{name}: {each}' for name, each in noise.items())}.",
        *(f"Note: {answer[name]}." for name in ("shortfall",) if answer[name]),
        *(f"Overruled: {each}." for each in plan.overruled),
        f"Next: kinacc campaign next {shlex.quote(given['folder'])}",
    ]
    out.show(answer, pd.DataFrame(), lines)


def _tolerance_mm(tolerance_mm: float | None, results: Path) -> float | None:
    """The tolerance given, or that of the calibration's configuration where it is of a bound."""
    from kinacc.report.summarise import tolerance_of
    from kinacc.tables import store

    path = results / "summary.parquet"
    if tolerance_mm is not None or not path.is_file():
        return tolerance_mm
    stated = tolerance_of({"summary": store.read(path)})
    return stated.mm if stated is not None and stated.of == "bound" else None


def _candidates(given: Mapping, arm):
    """Joints (m, k), labels, directions (m, k) or None, and the source of the candidates."""
    from kinacc.cli import rows, spaces
    from kinacc.cli.file_options import joint_answers
    from kinacc.deployment.applicability import is_measured_there
    from kinacc.errors import InputError, Problem
    from kinacc.kinematics.model import JointState

    try:
        count = int(given["candidates"])
    except ValueError:
        path, answers = given["candidates"], joint_answers(given)
        file = rows.candidates(path, arm.robot, _MOST_CANDIDATES, answers)
        return (
            file.joints,
            list(map(str, file.label)),
            file.directions,
            f"rows of {Path(path).name}",
        )
    if not 2 <= count <= _MOST_CANDIDATES:
        raise InputError(Problem("--candidates", str(count), f"2 to {_MOST_CANDIDATES}, or a file"))
    problems: list[Problem] = []
    box = spaces.joint_ranges(given["joints_deg"], arm.robot, problems)
    space = spaces.ranges("--inside-mm", given["inside_mm"], 3, problems)
    if problems:
        raise InputError(problems)
    usual = given["region"] is None and given["joints_deg"] is None
    region, settings = _region(given, arm)
    if region == "configured":
        box = settings.box if box is None else box
    inside = spaces.inside_box(space) if space is not None else settings and settings.inside
    draw = _draws(given, arm, region, box, inside)
    drawn = count
    while True:
        joints = draw(drawn)
        at = JointState(arm.robot.dh_joints(joints))
        if region == "measured" or usual:
            joints = joints[is_measured_there(arm, at, given["point"])]
        elif arm.model.domain is not None:  # coupled joints have no box of their own
            joints = joints[~arm.outside_range(at.q_rad).any(axis=1)]
        if len(joints) >= count:
            labels = [str(number) for number in range(1, count + 1)]
            return joints[:count], labels, None, _SOURCES[region]
        if drawn >= _MOST_DRAWS * count:
            what = f"only {len(joints)} of {drawn} joint values drawn are near measured poses"
            raise InputError(Problem("candidates", what, f"{count}", "narrow the region"))
        drawn *= 4


def _region(given: Mapping, arm):
    """The region, and the settings of a configured space."""
    from kinacc.cli import spaces
    from kinacc.errors import InputError, Problem

    region = given["region"]
    usual = "measured" if arm.fitted is not None else "fitted"
    if region == "measured" and usual != region:
        what = "the results do not hold the poses that were fitted"
        raise InputError(Problem("--region measured", what, "fitted, limits, configured"))
    if region is None and given["joints_deg"] is not None:
        region = "fitted"
    if region is None:
        region = "configured" if _is_configured(given, arm) else usual
    if region == "limits" and arm.model.domain is not None and given["joints_deg"] is None:
        what = f"the {arm.choice.upper()} model ends at the joints the data cover"
        raise InputError(Problem("--region limits", what, "measured, fitted"))
    if region != "configured":
        return region, None
    settings = spaces.settings_of(arm.name, given["config"])
    if settings.inside is None and settings.box is None:
        return usual, None
    return region, settings


def _draws(given: Mapping, arm, region: str, box, inside) -> Callable[[int], np.ndarray]:
    """A function that draws so many reported joints (at most n, k)."""
    from kinacc.deployment.planning import between, spread, tool_positions
    from kinacc.kinematics.inverse import limits

    robot, target = arm.robot, arm.point(given["point"])
    low, high = robot.q_min_rad, robot.q_max_rad
    if region != "measured":
        if region != "limits" and arm.fitted_range_rad is not None:
            low, high = limits.cut_to_range(robot, low, high, arm.fitted_range_rad)
        if box is not None:
            low, high = np.maximum(low, box[0]), np.minimum(high, box[1])
        return lambda count: spread(robot, count, (low, high), inside, target)

    def draw(count: int) -> np.ndarray:
        poses = limits.reported_joints(robot, arm.fitted.q_rad)
        drawn = between(poses, limits.travel_unit(robot), count, given["seed"])
        usable = limits.within(drawn, low, high)
        if box is not None:
            usable &= limits.within(drawn, *box)
        if inside is not None:
            usable &= inside(tool_positions(robot, drawn, target))
        return drawn[usable]

    return draw


def _is_configured(given: Mapping, arm) -> bool:
    """Whether the configuration given, or one in this folder, has the calibration's data set."""
    from kinacc.errors import InputError
    from kinacc.workflow.data_sets import read_data_sets

    if given["config"]:
        return arm.name in read_data_sets(given["config"]).settings
    try:
        path = Path(choice.CONFIG)
        return path.is_file() and arm.name in read_data_sets((choice.CONFIG,)).settings
    except InputError:
        return False
