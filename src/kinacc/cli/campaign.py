"""``kinacc campaign``: a measuring campaign on disk, from the first point to the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from kinacc.campaign import folder as folders
from kinacc.campaign import report as reports
from kinacc.campaign.campaign import Campaign
from kinacc.campaign.status import CampaignStatus
from kinacc.cli import campaign_plan, campaign_start
from kinacc.cli.choice import FOLDER, PATH, option, positive
from kinacc.cli.group import InOrder
from kinacc.cli.output import Output, answers
from kinacc.cli.process import AGAINST
from kinacc.cli.rows import joints_given, numbers_given
from kinacc.errors import input_error
from kinacc.report.rendering import lines as texts
from kinacc.tables.atomic import require_writable, write_together, write_whole
from kinacc.tables.store import content_of, to_table

_SHA256 = 64  # hexadecimal digits


@click.group("campaign", cls=InOrder)
def campaign() -> None:
    """Bound the largest error of a calibrated arm, one measurement after another.

    \b
    plan     the budget of readings for a wanted bound, by simulation
    start    fix points, instruments, assessor and budget
    next     which joints to measure now
    record   take a reading, or a file of readings
    status   bounds, verdict and the next point
    report   tables, picture and text
    verify   compare the journal with a report

    \b
    Example:
      kinacc campaign start check --calibration results/ur10_d --noise-mm 0.05 --budget 200
      kinacc campaign next check
      kinacc campaign record check --position-mm "812.31,-40.02,655.90"
      kinacc campaign status check
    """


@campaign.command("next")
@FOLDER
@option("--all", "every", is_flag=True, help="All poses that are measured whatever is read.")
@answers(table=True)
def next_(folder: str, every: bool, out: Output) -> None:
    """Print the pose to measure next: joints, and the expected position.

    \b
    Example:
      kinacc campaign next check
      kinacc campaign next check --all -o visit.csv
    """
    opened = _open(folder)
    table, pose = opened.visit(every), None if every else opened.next_pose()
    about = {"s": opened.status(), "pose": pose, "slides": opened.plan.slides}
    lines = texts("campaign_pose.txt", degrees=np.rad2deg, **about)
    out.show({"rows": table}, table, lines, table if every else table.head(0))


@campaign.command("leave-out")
@FOLDER
@click.argument("point")
@option("--reason", required=True, help="Reason why it cannot be measured.")
@answers()
def leave_out(folder: str, point: str, reason: str, out: Output) -> None:
    """Leave out a POINT without readings that the instrument or the arm cannot reach.

    \b
    Example:
      kinacc campaign leave-out check 17 --reason "hidden behind the column"
    """
    opened = _open(folder)
    opened.leave_out(point, reason)
    _show(opened.status(), out)


@campaign.command("strike")
@FOLDER
@click.argument("number", type=click.IntRange(1))
@option("--reason", required=True, help="What went wrong with it.")
@answers()
def strike(folder: str, number: int, reason: str, out: Output) -> None:
    """Declare reading NUMBER void, for a reason other than its size.

    It stays in the journal and in every report. Striking a reading for its size makes bounds wrong.

    \b
    Example:
      kinacc campaign strike check 31 --reason "reflector was not seated"
    """
    opened = _open(folder)
    opened.strike(number, reason)
    _show(opened.status(), out)


@campaign.command("status")
@FOLDER
@option("--tolerance-mm", type=positive, help="Largest error allowed. [as started]")
@answers(verbose=True)
def status(folder: str, tolerance_mm: float | None, out: Output) -> None:
    """Show the current bounds, the verdict, and the next point.

    \b
    Example:
      kinacc campaign status check --tolerance-mm 0.5
    """
    _show(_open(folder).status(tolerance_mm), out)


@campaign.command("report")
@FOLDER
@option("--out", "-o", "to", type=click.Path(file_okay=False),
        help="Folder. [report in the campaign's]")  # fmt: skip
@answers(page="Page for a browser: an .html file.", force=True)
def report(folder: str, to: str | None, out: Output) -> None:
    """Write tables, picture and text of a campaign.

    Files: campaign_points, _readings, _bounds (.parquet), campaign (.svg, .png), report.md.
    `kinacc show FOLDER/report campaign_points -o points.xlsx` writes a table in another form.

    \b
    Example:
      kinacc campaign report check --page check.html
    """
    # Plots take half of a start, and other commands draw none.
    from kinacc.figures.save import render
    from kinacc.report.campaign import campaign_page, markdown, section
    from kinacc.report.page import html

    campaign = _open(folder)
    opened, into = campaign.opened, Path(to or campaign.folder / "report")
    if not campaign.state.used:
        raise input_error(folder, "has no reading yet", fix="kinacc campaign next, then record")
    tables, metadata = reports.tables(opened), folders.marks_of(opened)
    part = section(opened, tables)
    contents: dict[Path | str, bytes] = {
        into / f"{name}.parquet": content_of(to_table(name, table, metadata))
        for name, table in tables.items()
    }
    for kind, content in render(part.figures["bounds"], ("svg", "png")).items():
        contents[into / f"campaign.{kind}"] = content
    contents[into / "report.md"] = markdown(part, "campaign.svg").encode()
    require_writable(contents, out.force or to is None)
    write_together(contents)
    if out.page is not None:
        write_whole(out.page, html(campaign_page(opened, part), metadata).encode())
    result, files = campaign.status(), [Path(path).name for path in contents]
    lines = [_lines(result)[0], f"{into}: {', '.join(files)}", out.page or ""]
    answer = {**vars(result), "report": str(into), "files": files, "page": out.page}
    out.show(answer, lines=filter(None, lines))


@campaign.command("verify")
@FOLDER
@option("--sha256", help="SHA-256 of the journal, as a report states it.")
@answers()
def verify(folder: str, sha256: str | None, out: Output) -> None:
    """Check the journal in FOLDER: the checksum of each line, and the SHA-256 of a report.

    The exit code is 1 where the journal does not continue the one of the report.

    \b
    Example:
      kinacc campaign verify check --sha256 5bd24b8a..
    """
    opened = folders.open_(folder)
    if sha256 is not None and len(sha256) != _SHA256:
        raise input_error("--sha256", f"{len(sha256)} digits", f"all {_SHA256}")
    checked = folders.verify(opened, sha256)
    against = "FAIL: not the journal of that report; it was shortened or rewritten."
    verdict = "PASS." if checked.continues else against
    text = f"{checked.entries} entries are whole, {checked.readings} readings"
    lines = [verdict, f"{opened.folder}: {text}, SHA-256 {checked.sha256}"]
    out.show(checked, lines=[*lines, *folders.doubts(opened)])
    if not checked.continues:
        raise SystemExit(AGAINST)


def _show(summary: CampaignStatus, out: Output) -> None:
    out.show(summary, lines=_lines(summary, out.verbose))


def _lines(summary: CampaignStatus, verbose: bool = False) -> list[str]:
    """The verdict, the bounds, their conditions, and the progress."""
    lines = texts("campaign_status.txt", s=summary, verbose=verbose)
    return list(dict.fromkeys(lines))  # the verdict may be the bound


def _open(folder: str) -> Campaign:
    """The campaign; what is unusual about its files goes to the error stream."""
    opened = Campaign(folder)
    for line in folders.doubts(opened.opened):
        click.echo(line, err=True)
    return opened


@campaign.command("record")
@FOLDER
@click.argument("file", type=PATH, required=False)
@option("--position-mm", help='Measured position "x,y,z".')
@option("--point", help="Measured candidate. [the next one]")
@option("--joints-deg", help="Joints of the controller (mm where a joint slides).")
@option("--instrument", help="Instrument. [the first]")
@option("--accept-implausible", is_flag=True, help="Acceptance of an error of any size.")
@option("--again", is_flag=True, help="Acceptance of readings that repeat or replace others.")
@answers()
def record(out: Output, folder: str, file: str | None, **options: Any) -> None:
    """Record a reading, or all new readings of a CSV, Excel, Parquet or JSON FILE.

    FILE has x_mm, y_mm, z_mm (or _m) and a column pose or joints q1_deg ..; optional: instrument,
    std_x_mm .. std_z_mm. Nothing is taken where a row is wrong. Readings taken are on disk.

    \b
    Example:
      kinacc campaign record check --position-mm "812.31,-40.02,655.90"
      kinacc campaign record check readings.csv
    """
    position, point, joints = (options[name] for name in ("position_mm", "point", "joints_deg"))
    if (position is None) == (file is None):
        message = "is given twice" if file else "is not given"
        raise input_error("the reading", message, "--position-mm, or a FILE")
    campaign = Campaign(folder)
    flags = {name: options[name] for name in ("instrument", "accept_implausible", "again")}
    if file is not None:
        if (point, joints) != (None, None):
            raise input_error("--point, --joints-deg", "are columns of a file")
        taken = campaign.add_readings(file, **flags)
    else:
        if joints is not None:
            joints = joints_given("--joints-deg", joints, campaign.plan.slides)
        position_mm = numbers_given("--position-mm", position, 3)
        taken = campaign.add_reading(position_mm, point, joints, **flags)
    summary = campaign.status()
    first = texts("recorded.txt", taken=taken, file=file)
    out.show({**vars(taken), "status": summary}, lines=[*first, *_lines(summary)])


campaign.add_command(campaign_plan.plan)
campaign.add_command(campaign_start.start)
