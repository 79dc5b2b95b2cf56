"""What the commands of ``kinacc campaign`` do with their options."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import click
import numpy as np

from kinacc import __version__
from kinacc.assess.conformity import decide
from kinacc.campaign import folder as folders
from kinacc.campaign import words
from kinacc.campaign.folder import open_
from kinacc.campaign.plan import Limits
from kinacc.campaign.state import readings_in
from kinacc.cli import campaigns_answers as answers
from kinacc.cli import choice
from kinacc.cli.exit_codes import AGAINST
from kinacc.cli.output import Output
from kinacc.errors import InputError, Problem, gathered, refuse
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
    out.say(
        answers.begun_facts(given["folder"], begun, unsure),
        answers.begun_in_words(
            given["folder"], begun, len(found.joints) - len(points), [*calibration.targets]
        ),
    )


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


def next_(path: str, every: bool, out: Output) -> None:
    """Name the next point, or all that are certain."""
    opened = open_(path)
    folders.require_method(opened)
    found = opened.state()
    say_doubts(opened)
    if found.asked is None:
        done = words.standing(found)[-1]
        out.say({"point": None, "done": done}, done)
        return
    wanted = found.ahead() if every else []
    wanted = wanted if found.asked in wanted else [found.asked, *wanted]
    if out.table is None and not out.as_json and not every:
        click.echo(answers.next_in_words(found))
        return
    ordered = f"{len(wanted)} points, in the order to measure them" if out.table else ""
    out.deliver(answers.visit_sheet(opened.plan, wanted), ordered)


def status(folder: str, tolerance_mm: float | None, out: Output) -> None:
    """Show the bounds so far and the readings still needed."""
    from kinacc.campaign import nearness
    from kinacc.cli.campaign_options import not_positive

    refuse(not_positive(tolerance_mm=tolerance_mm))
    opened = open_(folder)
    found = opened.state()
    tolerance = tolerance_mm or opened.plan.limits.tolerance_mm
    if not out.as_json:
        say_doubts(opened)
    lines = [*words.standing(found), *words.statements(found), *nearness.in_words(found)]
    lines += words.begun_against(opened.plan)
    if tolerance is not None:
        for said in found.statements():
            verdict = decide(said, tolerance)
            lines.append(
                f"tolerance {tolerance:g} mm, {words.target(said)}: {verdict.verdict}, "
                f"{words.reason(verdict.reason)}"
            )
    facts = answers.as_facts(found, tolerance)
    out.say(facts | {"limits": nearness.as_facts(found)}, "\n".join(lines))


def write_report(path: str, to: str | None, formats: Sequence[str], out: Output) -> None:
    """Write tables, picture, text and, where one is asked for, the page of a campaign."""
    from kinacc.campaign import nearness, report
    from kinacc.cli.output import require_writable
    from kinacc.figures import campaign as drawing
    from kinacc.figures.save import render
    from kinacc.progress import reporting
    from kinacc.report.campaign import markdown
    from kinacc.tables.atomic import write_together
    from kinacc.tables.store import content_of, to_table

    opened = open_(path)
    say_doubts(opened)
    into = Path(to or opened.folder / "report")
    text = into / "report.md"
    pictures = {kind: into / f"campaign.{kind}" for kind in ("svg", "png")}
    tables_to = {
        name: into / f"{name}.parquet"
        for name in ("campaign_points", "campaign_readings", "campaign_bounds")
    }
    sheets_to = {
        into / f"{name}.{kind}": name for kind in dict.fromkeys(formats) for name in tables_to
    }
    made_here = (*tables_to.values(), *sheets_to, *pictures.values(), text)
    require_writable(made_here, out.force or to is None)
    with reporting("report", bar=True) as progress:
        state, tables = report.tables(opened, progress)
    if not state.told:
        raise InputError(Problem(str(opened.folder), "no reading was asked for and taken yet"))
    made = folders.marks_of(opened)
    contents = {
        at: content_of(to_table(name, tables[name], made)) for name, at in tables_to.items()
    }
    for at, name in sheets_to.items():
        contents[at] = answers.sheet_of(name, tables[name]).content(at.suffix)
    figure = drawing.draw(
        tables["campaign_points"], tables["campaign_bounds"], len(state.plan.route),
        state.plan.limits.tolerance_mm, state.plan.about["calibration"],
    )  # fmt: skip
    drawn = render(figure, pictures)
    contents |= {pictures[kind]: content for kind, content in drawn.items()}
    contents[text] = markdown(opened, state, tables, "campaign.svg").encode()
    write_together(contents)
    written = [each.name for each in made_here]
    if out.page is not None:
        from kinacc.report.campaign import campaign_page

        out.write_page(campaign_page(opened, state, tables))
    facts = answers.as_facts(state, state.plan.limits.tolerance_mm)
    facts["limits"] = nearness.as_facts(state)
    lines = [*words.statements(state), *words.begun_against(state.plan)]
    lines.append(f"{into}: {', '.join(written)}")
    lines += [out.page] if out.page is not None else []
    out.say({**facts, "folder": str(into), "files": written, "page": out.page}, "\n".join(lines))


def verify(path: str, sha256: str | None, readings: int | None, out: Output) -> None:
    """Say what the journal holds, and whether it goes on from the one a report was made of."""
    opened = open_(path)
    problems = folders.held_to(opened, sha256, readings)
    count = readings_in(opened.journal.entries)
    entries = len(opened.journal.entries)
    said = f"{count} reading{'' if count == 1 else 's'}, SHA-256 {opened.journal.sha256()}"
    lines = [f"{opened.folder}: {entries} entries are as they were written; {said}"]
    lines += map(str, problems)
    if not problems and (sha256, readings) != (None, None):
        lines.append("it holds what was reported")
    if not out.as_json:
        say_doubts(opened)
    facts = {
        "campaign": opened.digest,
        "sha256": opened.journal.sha256(),
        "entries": entries,
        "readings": count,
        "problems": [asdict(each) for each in problems],
    }
    out.say(facts, "\n".join(lines))
    if problems:
        raise SystemExit(AGAINST)


def say_doubts(opened: folders.Opened) -> None:
    """Tell on the error stream what speaks against the folder as it was read."""
    for line in folders.doubts(opened):
        click.echo(line, err=True)
