"""What the commands of ``kinacc campaign`` do with their options."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path

import click
import numpy as np

from kinacc import __version__
from kinacc.assess.conformity import decide
from kinacc.campaign import folder, marks, words
from kinacc.campaign.plan import Limits
from kinacc.cli import campaigns_answers as answers
from kinacc.cli import choice
from kinacc.errors import InputError, Problem, gathered, refuse


def start(given: Mapping) -> None:
    """Begin a campaign and say what was begun."""
    from kinacc.campaign import begin, prediction_check
    from kinacc.cli import campaign_candidates, campaign_options, rows

    problems = folder.in_the_way(given["folder"])
    with gathered(problems):
        instruments = campaign_options.instruments(given)
    with gathered(problems):
        assessor = campaign_options.assessor(given)
    for name in ("tolerance_mm", "width_mm", "joint_tolerance_deg", "implausible_mm"):
        problems += campaign_options.not_positive(given, name)
    refuse(problems, "The campaign was not begun")
    arm = choice.calibration_of(
        given["calibration"], given["model"], given["robot"], given["config"], given["session"]
    )
    found = campaign_candidates.candidates(given, arm)
    points = begin.points_of(arm, found.joints, found.label, found.directions, given["point"])
    joints_now = np.zeros(arm.robot.dh.joints)
    if given["from_deg"] is not None:
        joints_now = rows.of_arguments((given["from_deg"],), "deg", arm.robot, "--from-deg")[0]
    limits = Limits(
        math.radians(given["joint_tolerance_deg"]),
        given["implausible_mm"] or begin.plausible_mm(arm, instruments),
        given["tolerance_mm"],
        given["width_mm"],
        given["target"],
    )
    about = {
        "robot": arm.robot.name,
        "calibration": arm.name,
        "model": arm.choice,
        "point": given["point"] or arm.default_point,
        "candidates": found.source,
        "kinacc_version": __version__,
        "assessor_code": marks.assessor_code(assessor),
    }
    begun = begin.plan_of(
        arm, points, assessor, instruments, limits, given["seed"], joints_now, about,
        by_travel=given["visit"] == "travel",
    )  # fmt: skip
    unsure = prediction_check.unsure(
        arm, points, instruments, given["point"], limits.implausible_mm
    )
    for line in [] if unsure is None else unsure.in_words():
        click.echo(line, err=True)
    folder.start(given["folder"], begun)
    if given["as_json"]:
        click.echo(json.dumps(answers.begun_facts(given["folder"], begun, unsure), indent=1))
        return
    merged = len(found.joints) - len(points)
    click.echo(answers.begun_in_words(given["folder"], begun, merged))


def next_(path: str, every: bool, output: str | None, as_json: bool, force: bool) -> None:
    """Name the next point, or all that are certain."""
    opened = folder.open_(path)
    found = opened.state()
    say_doubts(opened)
    if found.asked is None:
        said = {"point": None, "done": words.standing(found)[-1]}
        click.echo(json.dumps(said) if as_json else said["done"])
        return
    wanted = found.ahead() if every else []
    wanted = wanted if found.asked in wanted else [found.asked, *wanted]
    if output is not None or as_json or every:
        choice.deliver(answers.visit_sheet(opened.plan, wanted), output, as_json, force)
        if output is not None and not as_json:
            click.echo(f"{len(wanted)} points, in the order to measure them")
        return
    click.echo(answers.next_in_words(found))


def status(given: Mapping) -> None:
    """Say where the campaign stands, and what it is likely to need."""
    from kinacc.campaign import forecast
    from kinacc.cli.campaign_options import not_positive
    from kinacc.progress import reporting

    names = ("width_mm", "tolerance_mm")
    refuse([each for name in names for each in not_positive(given, name)])
    opened = folder.open_(given["folder"])
    found = opened.state()
    aims = opened.plan.limits
    wanted = given["width_mm"] or aims.width_mm
    tolerance = given["tolerance_mm"] or aims.tolerance_mm
    target = given["target"] or aims.target
    ahead, why_none = None, None
    if given["simulations"] and found.asked is not None:
        why_none = words.reason(forecast.why_none(found))
        with reporting("forecast", bar=True) as progress:
            ahead = forecast.forecast(
                found, given["simulations"], wanted, tolerance, target, progress
            )
    if given["as_json"]:
        facts = answers.as_facts(found, tolerance)
        facts |= {"forecast": answers.forecast_facts(ahead), "no_forecast": why_none}
        click.echo(json.dumps(facts, indent=1))
        return
    say_doubts(opened)
    lines = words.standing(found)
    lines += [words.statement(said, found) for said in found.statements()]
    if tolerance is not None:
        for said in found.statements():
            verdict = decide(said, tolerance)
            lines.append(
                f"tolerance {tolerance:g} mm, {words.TARGETS[said.target]}: {verdict.verdict}, "
                f"{words.reason(verdict.reason)}"
            )
    if ahead is not None:
        lines += forecast.in_words(ahead)
    elif why_none and (wanted or tolerance):
        lines.append(f"no forecast: {why_none}")
    click.echo("\n".join(lines))


def write_report(given: Mapping) -> None:
    """Write tables, picture and text of a campaign."""
    from kinacc.artifacts.atomic import write_whole
    from kinacc.artifacts.store import TableToWrite, write_all
    from kinacc.campaign import report
    from kinacc.cli.sheet import check_output
    from kinacc.figures import campaign as drawing
    from kinacc.figures.save import write
    from kinacc.progress import reporting

    opened = folder.open_(given["folder"])
    say_doubts(opened)
    to = Path(given["to"] or opened.folder / "report")
    text = to / "report.md"
    pictures = {kind: to / f"campaign.{kind}" for kind in ("svg", "png")}
    names = ("campaign_points", "campaign_readings", "campaign_bounds")
    for path in (text, *pictures.values(), *(to / f"{name}.parquet" for name in names)):
        check_output(path, given["force"] or given["to"] is None, ())
    with reporting("report", bar=True) as progress:
        state, tables = report.tables(opened, progress)
    if not state.told:
        raise InputError(Problem(str(opened.folder), "no reading was asked for and taken yet"))
    made = marks.marks_of(opened)
    write_all([TableToWrite(to / f"{name}.parquet", name, tables[name], made) for name in names])
    figure = drawing.draw(
        tables["campaign_points"], tables["campaign_bounds"], len(state.plan.route),
        state.plan.limits.tolerance_mm, state.plan.about["calibration"],
    )  # fmt: skip
    write(figure, pictures)
    write_whole(text, report.markdown(opened, state, tables, "campaign.svg").encode())
    written = [*(f"{name}.parquet" for name in names), "campaign.svg", "campaign.png", "report.md"]
    if given["as_json"]:
        facts = answers.as_facts(state, state.plan.limits.tolerance_mm)
        click.echo(json.dumps({**facts, "folder": str(to), "files": written}, indent=1))
        return
    lines = [words.statement(said, state) for said in state.statements()]
    click.echo("\n".join(lines + report.read_above(state, tables["campaign_points"])))
    click.echo(f"{to}: {', '.join(written)}")


def say_doubts(opened: folder.Opened) -> None:
    """Tell of a last line that was not written to its end, and of other code, on the error stream.

    Other code may choose other points than were measured, and say other bounds of equal readings.
    """
    if not marks.answers_alike(opened.plan.about.get("assessor_code"), opened.plan.assessor):
        begun = opened.plan.about.get("kinacc_version", "an earlier state")
        click.echo(f"begun with other code of the assessors, of kinacc {begun}", err=True)
    if opened.journal.cut_off:
        click.echo(
            "the last entry was cut off while it was written and never confirmed; it is left out: "
            "look whether the last reading has to be recorded again",
            err=True,
        )
