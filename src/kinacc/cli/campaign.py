"""``kinacc campaign``: a measuring campaign on disk, from the first point to the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
import pandas as pd

from kinacc.cli import campaign_plan, campaign_record, campaign_start
from kinacc.cli.choice import option
from kinacc.cli.exit_codes import AGAINST
from kinacc.cli.group import InOrder
from kinacc.cli.output import Output, answers, require_writable, write_table

if TYPE_CHECKING:
    from kinacc.campaign.campaign import Campaign, NextPose
    from kinacc.campaign.status import CampaignStatus


@click.group("campaign", cls=InOrder)
def campaign() -> None:
    """Bound the largest error of a calibrated arm, one measurement after another.

    \b
    plan     the budget of readings for a wanted bound, by simulation
    start    fix points, instruments, assessor and budget
    next     which joints to measure now
    record   take a reading, or a file of readings
    status   what may be said so far, and what is still needed
    report   tables, picture and text
    verify   whether the journal still holds what a report said

    \b
    Example:
      kinacc campaign start check --calibration results/ur10_d --noise-mm 0.05 --budget 200
      kinacc campaign next check
      kinacc campaign record check --position-mm "812.31,-40.02,655.90"
      kinacc campaign status check
    """


@campaign.command("next")
@click.argument("folder", type=click.Path())
@option("--all", "every", is_flag=True, help="All poses that are measured whatever is read.")
@answers("JSON of the poses.", table=True)
def next_(folder, every, out) -> None:
    """Print the pose to measure next: joints, and the expected position.

    \b
    Example:
      kinacc campaign next check
      kinacc campaign next check --all -o visit.csv
    """
    from kinacc.campaign.campaign import Campaign

    found = Campaign(folder)
    _say_doubts(found)
    table, pose, done = found.visit(every), found.next_pose(), found.status().progress
    result = {"rows": table, "progress": done}
    shown = table[[each for each in table.columns if not each.endswith("_rad")]]
    one = not every and out.table is None and pose is not None
    lines = _pose_lines(found, pose) if one and pose else [done]
    out.show(result, table, lines, shown.head(0) if one else shown)


@campaign.command("leave-out")
@click.argument("folder", type=click.Path())
@click.argument("point")
@option("--reason", required=True, help="Reason why it cannot be measured.")
@answers("JSON of the status.")
def leave_out(folder, point, reason, out) -> None:
    """Leave out a POINT without readings that the instrument or the arm cannot reach.

    \b
    Example:
      kinacc campaign leave-out check 17 --reason "hidden behind the column"
    """
    from kinacc.campaign.campaign import Campaign

    found = Campaign(folder)
    found.leave_out(point, reason)
    _show(found.status(), out)


@campaign.command("strike")
@click.argument("folder", type=click.Path())
@click.argument("number", type=click.IntRange(1))
@option("--reason", required=True, help="What went wrong with it.")
@answers("JSON of the status.")
def strike(folder, number, reason, out) -> None:
    """Declare reading NUMBER void, for a reason other than its size.

    It stays in the journal and in every report. Striking a reading for its size makes bounds wrong.

    \b
    Example:
      kinacc campaign strike check 31 --reason "reflector was not seated"
    """
    from kinacc.campaign.campaign import Campaign

    found = Campaign(folder)
    found.strike(number, reason)
    _show(found.status(), out)


@campaign.command("status")
@click.argument("folder", type=click.Path())
@option("--tolerance-mm", type=click.FloatRange(0.0, 1e6, min_open=True),
        help="Largest error allowed. [as started]")  # fmt: skip
@answers("JSON of the status.", verbose=True)
def status(folder, tolerance_mm, out) -> None:
    """Show the current bounds, the verdict, and the next point.

    \b
    Example:
      kinacc campaign status check --tolerance-mm 0.5
    """
    from kinacc.campaign.campaign import Campaign

    found = Campaign(folder)
    if not out.as_json:
        _say_doubts(found)
    _show(found.status(tolerance_mm), out)


@campaign.command("report")
@click.argument("folder", type=click.Path())
@option("--out", "-o", "to", type=click.Path(file_okay=False),
        help="Folder. [report in the campaign's]")  # fmt: skip
@option("--table", "formats", multiple=True, type=click.Choice(["csv", "xlsx"]),
        help="Further form of the tables; repeatable.")  # fmt: skip
@answers("JSON of the status.", page="Page for a browser: an .html file.",
         force="Replacement of existing files.")  # fmt: skip
def report(folder, to, formats, out) -> None:
    """Write tables, picture and text of a campaign.

    Files: campaign_points, _readings, _bounds (.parquet), campaign (.svg, .png), report.md.

    \b
    Example:
      kinacc campaign report check --page check.html --table xlsx
    """
    from kinacc.campaign.campaign import Campaign

    found = Campaign(folder)
    _say_doubts(found)
    into = Path(to or found.folder / "report")
    written = _write_report(found, into, formats, out, out.force or to is None)
    result = found.status()
    lines = [result.headline, f"{into}: {', '.join(written)}", out.page or ""]
    answer = {**vars(result), "report": str(into), "files": written, "page": out.page}
    out.show(answer, pd.DataFrame(), filter(None, lines))


@campaign.command("verify")
@click.argument("folder", type=click.Path())
@option("--sha256", help="SHA-256 of the journal, as a report states it.")
@option("--readings", type=click.IntRange(0), help="Number of readings, as a report states it.")
@answers("JSON of the verification.")
def verify(folder, sha256, readings, out) -> None:
    """Check the journal in FOLDER: the checksum of each line, and the SHA-256 of a report.

    The exit code is 1 where the journal does not continue the one of the report.

    \b
    Example:
      kinacc campaign verify check --readings 57 --sha256 5bd24b8a..
    """
    from kinacc.campaign import folder as folders

    opened = folders.open_(folder)
    found = folders.verify(opened, sha256, readings)
    verdict = f"FAIL: {'; '.join(found.problems)}." if found.problems else "PASS."
    text = f"{found.entries} entries are whole, {found.readings} readings, SHA-256 {found.sha256}"
    out.show(found, pd.DataFrame(), [verdict, f"{opened.folder}: {text}", *folders.doubts(opened)])
    if found.problems:
        raise SystemExit(AGAINST)


def _write_report(
    found: Campaign, into: Path, formats: Sequence[str], out: Output, force: bool
) -> list[str]:
    """Write the report; the names of its files."""
    from kinacc.campaign import report as reports
    from kinacc.campaign.folder import marks_of
    from kinacc.errors import InputError, Problem
    from kinacc.figures import campaign as drawing
    from kinacc.figures.save import render
    from kinacc.report.campaign import campaign_page, markdown
    from kinacc.tables.atomic import write_together
    from kinacc.tables.store import content_of, to_table

    if not found.state.told:
        what = "no reading was requested and taken yet"
        raise InputError(Problem(str(found.folder), what))
    names = ("campaign_points", "campaign_readings", "campaign_bounds")
    pictures = {kind: into / f"campaign.{kind}" for kind in ("svg", "png")}
    text = into / "report.md"
    sheets = {into / f"{name}.{kind}": name for kind in dict.fromkeys(formats) for name in names}
    paths = [*(into / f"{name}.parquet" for name in names), *sheets, *pictures.values(), text]
    require_writable(paths, force)
    state, tables = reports.tables(found.opened)
    marks = marks_of(found.opened)
    contents = {
        into / f"{name}.parquet": content_of(to_table(name, tables[name], marks)) for name in names
    }
    figure = drawing.draw(
        tables["campaign_points"],
        tables["campaign_bounds"],
        len(state.plan.route),
        state.plan.limits.tolerance_mm,
        state.plan.about["calibration"],
    )
    contents |= {pictures[kind]: drawn for kind, drawn in render(figure, pictures).items()}
    contents[text] = markdown(found.opened, state, tables, "campaign.svg").encode()
    write_together(contents)
    for path, name in sheets.items():
        write_table(pd.DataFrame(tables[name]), path)
    if out.page is not None:
        out.write_page(campaign_page(found.opened, state, tables))
    return [each.name for each in paths]


def _show(found: CampaignStatus, out: Output) -> None:
    out.show(found, pd.DataFrame(), status_lines(found, out.verbose))


def status_lines(found: CampaignStatus, verbose: bool = False) -> list[str]:
    """Return the verdict, the bounds, their conditions, and the progress."""
    texts = [found.headline]
    if not found.against:
        texts += [each.text for each in found.bounds if math.isfinite(each.upper_mm)]
    texts += [found.assumes, *(f"{text}." for text in found.against[1:]), *found.advice]
    texts.append(found.progress)
    texts += [f"Note: {text}." for text in found.notes]
    texts += [f"Overruled at the start: {text}." for text in found.overruled]
    if verbose:
        texts += [f"Instrument {name}: {noise}." for name, noise in found.noise.items()]
        texts += [
            f"Mean excess of the upper bound ({each.about}): {each.attainable_mm:.3f} mm with all "
            f"errors known, no reliable bound below {each.proven_mm:.3f} mm; now "
            f"{each.upper_mm - each.value_mm:.3f} mm above the estimate."
            for each in found.bounds
            if math.isfinite(each.attainable_mm)
        ]
    return [each for each in dict.fromkeys(texts) if each]


def _pose_lines(found: Campaign, pose: NextPose) -> list[str]:
    """The joints of a pose, and where the model expects the reading."""
    budget = found.plan.assessor.measurements
    lines = [f"Point {pose.point}, reading {len(found.state.told) + 1} of {budget}"]
    for joint, (value, slides) in enumerate(zip(pose.joints, found.plan.slides, strict=True)):
        shown = f"{value:12.4f} mm"
        if not slides:
            shown = f"{math.degrees(value):12.4f} deg  {value:12.7f} rad"
        travel = 0 if pose.directions is None else pose.directions[joint]
        lines.append(f"  q{joint + 1} {shown}{('', '  arriving up', '  arriving down')[travel]}")
    x, y, z = pose.expected_mm
    lines.append(f"Expected at {x:.3f}, {y:.3f}, {z:.3f} mm in the {pose.frame} frame.")
    again = f"Read {pose.times_read} times before: leave the pose and come back to it."
    return [*lines, again] if pose.times_read else lines


def _say_doubts(found: Campaign) -> None:
    from kinacc.campaign.folder import doubts

    for line in doubts(found.opened):
        click.echo(line, err=True)


campaign.add_command(campaign_plan.plan)
campaign.add_command(campaign_start.start)
campaign.add_command(campaign_record.record)
