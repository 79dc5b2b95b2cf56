"""``kinacc campaign``: a measuring campaign on disk, from the first point to the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np
import pandas as pd

from kinacc.cli import campaign_plan, campaign_record, campaign_start
from kinacc.cli.choice import option, positive
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
    found = _open(folder)
    table, pose, progress = found.visit(every), found.next_pose(), found.status().progress
    shown, lines = table[[name for name in table if not name.endswith("_rad")]], [progress]
    if pose is not None and not every and out.table is None:
        shown, lines = shown.head(0), _pose_lines(found, pose)
    out.show({"rows": table, "progress": progress}, table, lines, shown)


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
    found = _open(folder)
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
    found = _open(folder)
    found.strike(number, reason)
    _show(found.status(), out)


@campaign.command("status")
@click.argument("folder", type=click.Path())
@option("--tolerance-mm", type=positive, help="Largest error allowed. [as started]")
@answers("JSON of the status.", verbose=True)
def status(folder, tolerance_mm, out) -> None:
    """Show the current bounds, the verdict, and the next point.

    \b
    Example:
      kinacc campaign status check --tolerance-mm 0.5
    """
    _show(_open(folder).status(tolerance_mm), out)


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
    found = _open(folder)
    into = Path(to or found.folder / "report")
    files = _write_report(found, into, formats, out, out.force or to is None)
    result = found.status()
    lines = [result.headline, f"{into}: {', '.join(files)}", out.page or ""]
    answer = {**vars(result), "report": str(into), "files": files, "page": out.page}
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
        raise InputError(Problem(str(found.folder), "no reading was requested and taken yet"))
    state, tables = reports.tables(found.opened)
    metadata = marks_of(found.opened)
    figure = drawing.draw(
        tables["campaign_points"],
        tables["campaign_bounds"],
        len(state.plan.route),
        state.plan.limits.tolerance_mm,
        state.plan.about["calibration"],
    )
    contents = {
        f"{name}.parquet": content_of(to_table(name, table, metadata))
        for name, table in tables.items()
    }
    pictures = render(figure, ("svg", "png"))
    contents |= {f"campaign.{kind}": content for kind, content in pictures.items()}
    contents["report.md"] = markdown(found.opened, state, tables, "campaign.svg").encode()
    sheets = {f"{name}.{kind}": name for kind in dict.fromkeys(formats) for name in tables}
    require_writable([into / name for name in (*contents, *sheets)], force)
    write_together({into / name: content for name, content in contents.items()})
    for path, name in sheets.items():
        write_table(pd.DataFrame(tables[name]), into / path)
    if out.page is not None:
        out.write_page(campaign_page(found.opened, state, tables))
    return [*contents, *sheets]


def _show(found: CampaignStatus, out: Output) -> None:
    out.show(found, pd.DataFrame(), status_lines(found, out.verbose))


def status_lines(found: CampaignStatus, verbose: bool = False) -> list[str]:
    """Return the verdict, the bounds, their conditions, and the progress."""
    bounds = [bound for bound in found.bounds if math.isfinite(bound.upper_mm)]
    texts = [
        found.headline,
        *(bound.text for bound in bounds if not found.against),
        found.assumes,
        *(f"{text}." for text in found.against[1:]),
        *found.advice,
        found.progress,
        *(f"Note: {text}." for text in found.notes),
        *(f"Overruled at the start: {text}." for text in found.overruled),
    ]
    if verbose:
        texts += [f"Instrument {name}: {noise}." for name, noise in found.noise.items()]
        texts += [
            f"Mean excess of the upper bound ({bound.about}): {bound.attainable_mm:.3f} mm with "
            f"all errors known, no reliable bound below {bound.proven_mm:.3f} mm; now "
            f"{bound.upper_mm - bound.value_mm:.3f} mm above the estimate."
            for bound in bounds
            if math.isfinite(bound.attainable_mm)
        ]
    return list(filter(None, dict.fromkeys(texts)))


def _pose_lines(found: Campaign, pose: NextPose) -> list[str]:
    """The joints of a pose, and where the model expects the reading."""
    lines = [f"Point {pose.point}, reading {len(found.state.told) + 1} of {found.status().budget}"]
    travel = np.zeros(len(pose.joints), int) if pose.directions is None else pose.directions
    for joint, (value, slides) in enumerate(zip(pose.joints, found.plan.slides, strict=True)):
        turn = f"{math.degrees(value):12.4f} deg  {value:12.7f} rad"
        arrival = ("", "  arriving up", "  arriving down")[travel[joint]]
        lines.append(f"  q{joint + 1} {f'{value:12.4f} mm' if slides else turn}{arrival}")
    x, y, z = pose.expected_mm
    lines.append(f"Expected at {x:.3f}, {y:.3f}, {z:.3f} mm in the {pose.frame} frame.")
    if pose.times_read:
        lines.append(f"Read {pose.times_read} times before: leave the pose and come back to it.")
    return lines


def _open(folder: str) -> Campaign:
    """The campaign; what is unusual about its files goes to the error stream."""
    from kinacc.campaign.campaign import Campaign
    from kinacc.campaign.folder import doubts

    found = Campaign(folder)
    for line in doubts(found.opened):
        click.echo(line, err=True)
    return found


campaign.add_command(campaign_plan.plan)
campaign.add_command(campaign_start.start)
campaign.add_command(campaign_record.record)
