"""What the commands of ``kinacc campaign`` do with their options and how they answer."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from kinacc import __version__
from kinacc.assess.conformity import decide
from kinacc.assess.statement import Statement
from kinacc.campaign import consistency, folder, instrument, marks, words
from kinacc.campaign.plan import Limits, Plan
from kinacc.campaign.state import State
from kinacc.commands import choice
from kinacc.commands.sheet import Field, Sheet
from kinacc.errors import InputError, Problem
from kinacc.geometry import invert

if TYPE_CHECKING:
    from kinacc.campaign.forecast import Forecast
    from kinacc.campaign.foreseen import Unsure


def start(given: Mapping) -> None:
    """Begin a campaign and say what was begun."""
    from kinacc.campaign import begin, foreseen
    from kinacc.commands import campaign_candidates, campaign_options, rows

    problems: list[Problem] = []
    instruments = campaign_options.gathered(
        problems, lambda: campaign_options.instruments(given), ()
    )
    assessor = campaign_options.gathered(problems, lambda: campaign_options.assessor(given))
    for name in ("tolerance_mm", "width_mm", "joint_tolerance_deg", "implausible_mm"):
        problems += campaign_options.not_positive(given, name)
    if problems:
        raise InputError(problems, "The campaign was not begun")
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
        "assessor_code": marks.assessor_code(),
    }
    begun = begin.plan_of(
        arm, points, assessor, instruments, limits, given["seed"], joints_now, about,
        by_travel=given["visit"] == "travel",
    )  # fmt: skip
    folder.start(given["folder"], begun)
    merged = len(found.joints) - len(points)
    unsure = foreseen.unsure(arm, points, instruments, given["point"], limits.implausible_mm)
    _say_begun(given, begun, merged, unsure)


def _say_begun(given: Mapping, begun: Plan, merged: int, unsure: Unsure | None) -> None:
    content = {
        "folder": str(given["folder"]),
        **begun.about,
        "points": len(begun.points),
        "first_visit": len(begun.route),
        "assessor": begun.assessor.name,
        "budget": begun.assessor.measurements,
        "implausible_mm": begun.limits.implausible_mm,
        "joint_tolerance_deg": math.degrees(begun.limits.joint_rad),
        "prediction": None if unsure is None else unsure.as_facts(),
    }
    for line in [] if unsure is None else unsure.in_words():
        click.echo(line, err=True)
    if given["as_json"]:
        click.echo(json.dumps(content, indent=1))
        return
    named = ", ".join(f"{each.name} ({instrument.noise(each)})" for each in begun.instruments)
    lines = [
        f"campaign begun in {given['folder']}",
        f"{len(begun.points)} candidates ({begun.about['candidates']})"
        + (f"; {merged} rows repeat the joints of others" if merged else ""),
        f"the {begun.about['point']} of {begun.about['robot']}, {begun.about['model']} model of "
        f"{begun.about['calibration']}",
        f"instruments: {named}",
        f"{begun.assessor.name}: {begun.assessor.measurements} readings, the first at "
        f"{len(begun.route)} points whatever they say",
        f"a reading is refused {refusals(begun)}",
        f"next: kinacc campaign next {given['folder']}",
    ]
    click.echo("\n".join(lines))


def refusals(begun: Plan) -> str:
    """When a reading is refused."""
    return (
        f"more than {math.degrees(begun.limits.joint_rad):g} deg from the joints asked for, or "
        f"more than {begun.limits.implausible_mm:g} mm from the model"
    )


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
        choice.deliver(_visit_sheet(opened.plan, wanted), output, as_json, force)
        if output is not None and not as_json:
            click.echo(f"{len(wanted)} points, in the order to measure them")
        return
    click.echo(_next_in_words(found))


def _next_in_words(found: State) -> str:
    begun, point = found.plan, found.asked
    joints = begun.points.joints[point]
    lines = [f"point {begun.points.label[point]}, reading {len(found.told) + 1} of "
             f"{begun.assessor.measurements}"]  # fmt: skip
    for joint, value in enumerate(joints):
        if begun.slides[joint]:
            shown = f"{value:12.4f} mm"
        else:
            shown = f"{math.degrees(value):12.4f} deg  {value:12.7f} rad"
        arrive = ""
        if begun.points.directions is not None and begun.points.directions[point, joint]:
            arrive = "  arriving " + ("up" if begun.points.directions[point, joint] > 0 else "down")
        lines.append(f"  q{joint + 1} {shown}{arrive}")
    seen = in_instrument(begun, begun.points.modelled_mm[[point]])[0]
    frame = begun.instruments[0].frame
    x, y, z = seen if frame == instrument.INSTRUMENT else begun.points.modelled_mm[point]
    lines.append(f"expected at {x:.3f}, {y:.3f}, {z:.3f} mm in the {frame} frame")
    again = sum(each.reading.point == point for each in found.told)
    if again:
        times = "once" if again == 1 else f"{again} times"
        lines.append(f"read {times} before: leave the pose and come back to it")
    return "\n".join(lines)


def _visit_sheet(begun: Plan, points: list[int]) -> Sheet:
    joints = begun.points.joints[points]
    seen = in_instrument(begun, begun.points.modelled_mm[points])
    label = np.array([begun.points.label[each] for each in points], dtype=object)
    fields = [Field("pose", label, "", "name of the point among the candidates")]
    for joint, slides in enumerate(begun.slides):
        name = f"q{joint + 1}"
        if slides:
            fields.append(Field(f"{name}_mm", joints[:, joint], "mm", f"joint {joint + 1}"))
        else:
            degrees = np.rad2deg(joints[:, joint])
            fields.append(Field(f"{name}_deg", degrees, "deg", f"joint {joint + 1}"))
    fields += [
        Field(f"q{joint + 1}_rad", joints[:, joint], "rad", f"joint {joint + 1}", False)
        for joint, slides in enumerate(begun.slides)
        if not slides
    ]
    if begun.points.directions is not None:
        fields += [
            Field(f"s{joint + 1}", begun.points.directions[points, joint], "1", "travel", False)
            for joint in range(joints.shape[1])
        ]
    fields += [
        Field(f"expected_{axis}_mm", seen[:, i], "mm", "modelled, in the instrument's frame")
        for i, axis in enumerate("xyz")
    ]
    return Sheet("", dict(begun.about), fields, shown_rows=60)


def in_instrument(begun: Plan, position_mm: np.ndarray) -> np.ndarray:
    """Positions (n, 3) of the robot's base in the instrument's frame."""
    back = invert(begun.to_base)
    return position_mm @ back.rotation.T + back.position_mm


def status(given: Mapping) -> None:
    """Say where the campaign stands, and what it is likely to need."""
    from kinacc.campaign import forecast
    from kinacc.stages.progress import reporting

    opened = folder.open_(given["folder"])
    found = opened.state()
    aims = opened.plan.limits
    wanted = given["width_mm"] or aims.width_mm
    tolerance = given["tolerance_mm"] or aims.tolerance_mm
    target = given["target"] or aims.target
    ahead, why_none = None, ""
    if given["simulations"] and found.asked is not None:
        why_none = forecast.why_none(found)
        with reporting("forecast", bar=True) as progress:
            ahead = forecast.forecast(
                found, given["simulations"], wanted, tolerance, target, progress
            )
    if given["as_json"]:
        facts = as_facts(found, tolerance)
        facts |= {"forecast": _forecast_facts(ahead), "no_forecast": why_none or None}
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
                f"{verdict.reason}"
            )
    if ahead is not None:
        lines += forecast.in_words(ahead)
    elif why_none and (wanted or tolerance):
        lines.append(f"no forecast: {why_none}")
    click.echo("\n".join(lines))


def _forecast_facts(ahead: Forecast | None) -> dict[str, object] | None:
    if ahead is None:
        return None
    finite = [value if math.isfinite(value) else None for value in ahead.width_mm]
    return {
        "by": "simulation from the readings so far",
        "simulations": ahead.simulations,
        "readings_left": ahead.left,
        "final_width_mm": dict(zip(("q05", "median", "q95"), finite, strict=True)),
        "target": ahead.target,
        "wanted_width_mm": ahead.wanted_mm,
        "reached_within_budget": ahead.reached,
        "readings_needed": ahead.more,
        "budget_of_a_new_campaign": ahead.budget,
        "largest_budget_tried": ahead.tried,
        "decisions": ahead.decisions,
    }


def write_report(given: Mapping) -> None:
    """Write tables, picture and text of a campaign."""
    from kinacc.artifacts.store import TableToWrite, write_all
    from kinacc.campaign import report
    from kinacc.commands.sheet import check_output, write_whole
    from kinacc.figures import campaign as drawing
    from kinacc.figures.save import write
    from kinacc.stages.progress import reporting

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
        facts = as_facts(state, state.plan.limits.tolerance_mm)
        click.echo(json.dumps({**facts, "folder": str(to), "files": written}, indent=1))
        return
    click.echo("\n".join(words.statement(said, state) for said in state.statements()))
    click.echo(f"{to}: {', '.join(written)}")


def as_facts(found: State, tolerance: float | None) -> dict[str, object]:
    """The standing of a campaign for a machine."""
    label = found.plan.points.label
    return {
        **found.plan.about,
        "assessor": found.plan.assessor.name,
        "budget": found.plan.assessor.measurements,
        "readings": found.taken,
        "readings_used": len(found.told),
        "points": len(label) - len(found.left_out),
        "points_measured": len({each.reading.point for each in found.told}),
        "left_out": {label[point]: reason for point, reason in found.left_out.items()},
        "struck": {str(each.number): reason for each, reason in found.struck},
        "scatter": _scatter_facts(found),
        "next": None if found.asked is None else label[found.asked],
        "statements": [statement_facts(said, found, tolerance) for said in found.statements()],
    }


def _scatter_facts(found: State) -> dict[str, object] | None:
    """Scatter of repeated readings for a machine."""
    seen = consistency.scatter(found)
    if seen is None:
        return None
    return {
        "ratio": seen.ratio,
        "degrees_of_freedom": seen.freedom,
        "probability": seen.probability,
        "in_words": consistency.in_words(seen),
    }


def statement_facts(said: Statement, found: State, tolerance: float | None) -> dict[str, object]:
    """A statement for a machine; null for what is not said."""

    def plain(value: float) -> float | None:
        return None if math.isnan(value) else value

    facts = {
        "target": said.target,
        "value_mm": plain(said.value_mm),
        "lower_mm": plain(said.lower_mm),
        "upper_mm": plain(said.upper_mm),
        "confidence": plain(said.confidence),
        "share": said.share,
        "assumption": said.assumption or None,
        "withheld": said.withheld or None,
        "in_words": words.statement(said, found),
    }
    if tolerance is not None:
        facts |= {"tolerance_mm": tolerance, "decision": _decision_facts(said, tolerance)}
    return facts


def _decision_facts(said: Statement, tolerance: float) -> dict[str, object]:
    """A decision for a machine."""
    found = decide(said, tolerance)
    known = math.isfinite(found.guard_band_mm)
    return {
        "verdict": found.verdict,
        "reason": found.reason,
        "guard_band_mm": found.guard_band_mm if known else None,
        "acceptance_limit_mm": found.acceptance_limit_mm if known else None,
        "risk": None if math.isnan(found.risk) else found.risk,
    }


def say_doubts(opened: folder.Opened) -> None:
    """Tell of a last line that was not written to its end, and of other code, on the error stream.

    Other code may choose other points than were measured, and say other bounds of equal readings.
    """
    if opened.plan.about.get("assessor_code") != marks.assessor_code():
        begun = opened.plan.about.get("kinacc_version", "an earlier state")
        click.echo(f"begun with other code of the assessors, of kinacc {begun}", err=True)
    if opened.journal.cut_off:
        click.echo(
            "the last entry was cut off while it was written and never confirmed; it is left out: "
            "look whether the last reading has to be recorded again",
            err=True,
        )
