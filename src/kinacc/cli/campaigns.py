"""What the commands of ``kinacc campaign`` do with their options."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

import click
import numpy as np

from kinacc import __version__
from kinacc.campaign import folder as folders
from kinacc.campaign import instrument
from kinacc.campaign.plan import Limits, Plan
from kinacc.campaign.reasons import reason
from kinacc.cli import choice
from kinacc.cli.output import Output
from kinacc.errors import gathered, refuse
from kinacc.tables import store


def start(given: Mapping, out: Output) -> None:
    """Begin a campaign and say what was begun."""
    from kinacc.campaign import begin, known_noise, prediction_check, slips
    from kinacc.cli import campaign_candidates, campaign_options, rows
    from kinacc.cli.file_options import joint_answers

    problems = folders.in_the_way(given["folder"])
    names = ("noise_mm", "covariance_mm2", "instrument", "frame", "resolution_mm")
    noise = (given[each] for each in names)
    method = (given[each] for each in ("assessor", "budget", "confidence", "settings"))
    tested = None
    with gathered(problems):
        tested = campaign_options.tested_noise(given["repeatability"])
    with gathered(problems):
        instruments = campaign_options.instruments(
            *noise, calibrations=[Path(given["calibration"])], tested=tested
        )
    with gathered(problems):
        asked = campaign_options.workshop(given)
        assessor = campaign_options.assessor(*method, asked=asked, tested=tested)
    lengths = ("tolerance_mm", "width_mm", "joint_tolerance_deg", "implausible_mm")
    problems += campaign_options.not_positive(**{name: given[name] for name in lengths})
    refuse(problems, "The campaign was not begun")
    calibration = choice.calibration_of(
        given["calibration"], given["model"], given["robot"], given["config"], given["session"]
    )
    region = choice.record_of(campaign_candidates.Region, given)
    found = campaign_candidates.candidates(region, calibration, joint_answers(given))
    points = begin.points_of(
        calibration, found.joints, found.label, found.directions, given["point"]
    )
    instruments = begin.placed(calibration, instruments, points)
    count = len(points.labels) if hasattr(points, "labels") else len(found.joints)
    assessor = campaign_options.with_references(assessor, count, given["references"])
    joints_now = np.zeros(calibration.robot.dh.joints)
    if given["from_deg"] is not None:
        joints_now = rows.of_arguments(
            (given["from_deg"],), "deg", calibration.robot, "--from-deg"
        )[0]
    tolerance_mm, whose = _tolerance_mm(given["tolerance_mm"], Path(given["calibration"]))
    limits = Limits(
        math.radians(given["joint_tolerance_deg"]),
        given["implausible_mm"] or begin.plausible_mm(calibration, instruments),
        tolerance_mm,
        given["width_mm"],
        given["target"],
    )
    about = {
        "robot": calibration.robot.name,
        "calibration": calibration.name,
        "model": calibration.choice,
        "point": given["point"] or calibration.default_point,
        "candidates": found.source,
        "kinacc_version": __version__,
    }
    begun = begin.plan_of(
        calibration, points, assessor, instruments, limits, given["seed"], joints_now, about,
        by_travel=given["visit"] == "travel",
    )  # fmt: skip
    unsure = prediction_check.unsure(calibration, points, given["point"])
    left_mm = calibration.residual.position_mm if calibration.residual else math.nan
    problems = slips.of_noise(instruments, left_mm)
    problems += [*slips.of_distance(begun), *known_noise.doubts(tested)]
    problems += slips.of_repeats(instruments, Path(given["calibration"]))
    problems += [] if unsure is None else unsure.asked()
    if not given["sure"]:
        refuse(problems, "The campaign was not begun")
    begun = replace(begun, overruled=tuple(f"{each.where}: {each.what}" for each in problems))
    for line in whose:
        click.echo(line, err=True)
    if unsure and unsure.not_measured:
        click.echo(f"warning: {unsure.in_words()}", err=True)
    folders.start(given["folder"], begun)
    _say_begun(given["folder"], begun, len(found.joints) - len(points), unsure, out)


def _say_begun(folder: str, begun: Plan, merged: int, unsure, out: Output) -> None:
    """Print what was begun; ``merged`` candidates repeat the joints of others."""
    noise = {each.name: instrument.noise(each) for each in begun.instruments}
    shortfall = reason(begun.assessor.shortfall(*begun.points.joints.shape))
    facts = {
        "folder": folder,
        **begun.about,
        "points": len(begun.points),
        "first_visit": len(begun.route),
        "assessor": begun.assessor.name,
        "budget": begun.assessor.measurements,
        "noise": noise,
        "implausible_mm": begun.limits.implausible_mm,
        "joint_tolerance_deg": math.degrees(begun.limits.joint_rad),
        "prediction": None if unsure is None else asdict(unsure),
        "shortfall": shortfall,
        "begun_against": list(begun.overruled),
    }
    references = getattr(begun.assessor, "references", 0)
    lines = [
        f"Campaign {folder}: largest error of {begun.about['point']} ({begun.about['model']} model "
        f"of {begun.about['calibration']}) at {len(begun.points)} candidates, "
        f"{begun.about['candidates']}" + (f"; {merged} repeated" if merged else "") + ".",
        f"{begun.assessor.measurements} readings by {begun.assessor.name}: {len(begun.route)} "
        f"points first, {references} readings at reference poses.",
        "Noise: " + "; ".join(f"{name}: {each}" for name, each in noise.items()) + ".",
        f"Note: {shortfall}." if shortfall else "",
        *(f"Overruled: {each}." for each in begun.overruled),
        f"Next: kinacc campaign next {shlex.quote(folder)}",
    ]
    out.say(facts, "\n".join(filter(None, lines)))


def _tolerance_mm(given: float | None, results: Path) -> tuple[float | None, list[str]]:
    """The tolerance given, or the one of the calibration's configuration; what to say of that."""
    path = results / "summary.parquet"
    if given is not None or not path.is_file():
        return given, []
    from kinacc.report.summary import tolerance_of

    stated = tolerance_of({"summary": store.read(path)})
    if stated is None or stated.of != "bound":
        return None, []
    words = f"tolerance {stated.mm:g} mm: that of the configuration of {results}"
    return stated.mm, [f"{words}; --tolerance-mm names another"]
