"""``kinacc campaign``: a measuring campaign on disk, from the first point to the report."""

from __future__ import annotations

import click

from kinacc.cli import campaign_plan, choice
from kinacc.cli.choice import option
from kinacc.cli.file_options import joint_file_options
from kinacc.cli.group import InOrder
from kinacc.cli.output import answers


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


@campaign.command("start")
@click.argument("folder", type=click.Path(file_okay=False))
@option("--calibration", required=True, type=click.Path(), help="Results folder of the arm.")
@choice.SELECTED
@choice.ROBOT
@choice.NAMING
@choice.SESSION
@choice.POINT
@option("--candidates", type=click.Path(), help="File of joints that may be measured.")
@joint_file_options
@option("--drawn", default=200, type=click.IntRange(1, 20_000),
        help="Candidates drawn where there is no file.")  # fmt: skip
@option(
    "--region",
    type=click.Choice(["measured", "configured", "fitted", "limits"]),
    help="Draw between neighbouring measured poses, or evenly from the configured evaluation "
    "space, the joint ranges the calibration covers, or the joint limits. [configured if there is "
    "a configuration with a space, fitted with --joints-deg, else measured]",
)
@option("--joints-deg", help='Ranges to draw from, e.g. "-90:90,-60:60,...".')
@option("--inside-mm", help='Where the tool may be in the base: "x0:x1,y0:y1,z0:z1".')
@option("--instrument", multiple=True,
        help="NAME=noise, NAME=three or NAME=nine numbers, NAME=laser:KEY=.. (see above); may be "
        "repeated.")  # fmt: skip
@option("--frame", type=click.Choice(["instrument", "base"]), default="instrument",
        help="Frame of readings and covariances.")  # fmt: skip
@choice.campaign_options
@option("--budget", default=200, type=click.IntRange(max=1_000_000), help="Readings in all.")
@option("--joint-tolerance-deg", default=0.02, type=float,
        help="How far reported joints may be from those asked for.")  # fmt: skip
@option("--implausible-mm", type=float, help="Error beyond which a reading is refused.")
@option("--from-deg", help="Joints the arm starts at. [zero]")
@option("--visit", type=click.Choice(["travel", "random"]), default="travel",
        help="Order of the first visit.")  # fmt: skip
@answers("Print what was begun as JSON.")
def start(out, **given) -> None:
    """Begin a campaign in FOLDER: nothing of this can be changed once there are readings.

    Candidates are the joint configurations the statement is about: rows of a file in any form that
    `kinacc init` reads, robots' programs included (of q1_deg .. also s1 .., directions of travel),
    or drawn. Their order is random, by the seed, and knows nothing of the errors. Where more than a
    tenth of them lie where the calibration was not measured, that is asked about.

    The noise must hold all that differs between readings of one pose: the instrument, its target,
    and how well the arm repeats the pose. `kinacc repeatability` tells it of repeated readings.

    A laser tracker's noise grows with the distance: give standard deviations along the beam
    (range_mm, range_um_per_m) and across it (angle_mm, angle_um_per_m), and how the arm repeats a
    pose (repeat_mm). Half of what makers state as MPE or as two standard deviations is meant. Its
    head is the origin of the frame of the calibration's readings.

    \b
    Example:
      kinacc campaign start check --calibration results/ur10_d --noise-mm 0.05 --budget 200
      kinacc campaign start check --calibration results/ur10_d \\
          --instrument tracker=laser:range_mm=0.008,angle_um_per_m=5,repeat_mm=0.03
      kinacc campaign start check --calibration results/mh180 --candidates points.csv \\
          --instrument tracker=0.03 --instrument camera=0.1,0.1,0.3 --tolerance-mm 0.8
    """
    from kinacc.cli import campaigns

    campaigns.start(given, out)


@campaign.command("next")
@click.argument("folder", type=click.Path())
@option(
    "--all", "every", is_flag=True, help="All points that are measured whatever is read, in order."
)
@answers(table=True)
def next_(folder, every, out) -> None:
    """Name the joint values to measure next, in degrees and radians.

    Nothing is written, so it may be asked as often as wanted. With --all the rest of the first
    visit, to write a robot program of it.

    \b
    Example:
      kinacc campaign next check
      kinacc campaign next check --all -o visit.csv
    """
    from kinacc.cli import campaigns

    campaigns.next_(folder, every, out)


@campaign.command("record")
@click.argument("folder", type=click.Path())
@click.argument("file", type=click.Path(), required=False)
@option("--position-mm", help='Measured position "x,y,z".')
@option("--point", help="Point it was measured at. [the one asked for]")
@option("--joints-deg", help="Joints the controller reported (mm where a joint slides).")
@option("--joints-rad", help="The same in radians.")
@option("--instrument", help="Instrument that measured. [the first]")
@option("--std-mm", help="Noise of this reading where it is not the instrument's.")
@option("--accept-implausible", is_flag=True, help="Take it however large the error is.")
@option("--skip-bad", is_flag=True, help="Take the good rows of a file, name the others.")
@option(
    "--again", is_flag=True, help="They are new readings, though they repeat or replace others."
)
@answers()
def record(out, **given) -> None:
    """Take a reading, or all readings of a CSV, Parquet or JSON FILE.

    A file has x_mm, y_mm, z_mm (or _m) and says which point by a column `pose` or by joints
    q1_deg ..; further columns are `instrument`, and std_x_mm .. std_z_mm. All rows are checked
    before any is taken. When the command returns, what it took is on disk. A file that has grown
    may be recorded again: its new rows are taken, and a row that was changed is asked about.

    \b
    Example:
      kinacc campaign record check --position-mm "812.31,-40.02,655.90"
      kinacc campaign record check --point 17 --position-mm "..." --instrument camera
      kinacc campaign record check readings.csv
    """
    from kinacc.cli import campaigns_record

    campaigns_record.record(campaigns_record.Asked(**given), out)


@campaign.command("leave-out")
@click.argument("folder", type=click.Path())
@click.argument("point")
@option("--reason", required=True, help="Why it cannot be measured.")
@answers("Print the standing as JSON.")
def leave_out(folder, point, reason, out) -> None:
    """Leave out a POINT that cannot be measured: hidden from the instrument, or not to be reached.

    Only a point without readings, and only for a reason that has nothing to do with its error. The
    statements then speak of the other candidates.

    \b
    Example:
      kinacc campaign leave-out check 17 --reason "hidden behind the column"
    """
    from kinacc.cli import campaigns_record

    campaigns_record.leave_out(folder, point, reason, out)


@campaign.command("strike")
@click.argument("folder", type=click.Path())
@click.argument("number", type=click.IntRange(1))
@option("--reason", required=True, help="What went wrong with it.")
@answers("Print the standing as JSON.")
def strike(folder, number, reason, out) -> None:
    """Declare reading NUMBER void: something went wrong that has nothing to do with its size.

    The reading stays in the journal and in every report, with the reason. A reading that is struck
    for being large makes the bounds wrong.

    \b
    Example:
      kinacc campaign strike check 31 --reason "reflector was not seated"
    """
    from kinacc.cli import campaigns_record

    campaigns_record.strike(folder, number, reason, out)


@campaign.command("status")
@click.argument("folder", type=click.Path())
@option("--tolerance-mm", type=float, help="Largest error allowed. [as begun]")
@answers()
def status(folder, tolerance_mm, out) -> None:
    """Show the current bounds and the readings still needed.

    \b
    Example:
      kinacc campaign status check
      kinacc campaign status check --tolerance-mm 0.5 --json
    """
    from kinacc.cli import campaigns

    campaigns.status(folder, tolerance_mm, out)


@campaign.command("report")
@click.argument("folder", type=click.Path())
@option("--out", "to", type=click.Path(file_okay=False), help="Folder. [report in the campaign's]")
@option("--table", "formats", multiple=True, type=click.Choice(["csv", "xlsx"]),
        help="The tables in this form as well; may be repeated.")  # fmt: skip
@answers("Print what it says as JSON.", page="Write a page to read in a browser: an .html file.",
         force="Replace files that are there.")  # fmt: skip
def report(folder, to, formats, out) -> None:
    """Write what was measured and what may be said of it: tables, picture, text.

    Leaves campaign_points, campaign_readings and campaign_bounds (.parquet), campaign (.svg, .png)
    and report.md; with --page also one HTML file with pictures to explore, to mail and to keep.

    \b
    Example:
      kinacc campaign report check --page check.html
      kinacc campaign report check --out papers/check --table xlsx
    """
    from kinacc.cli import campaigns

    campaigns.write_report(folder, to, formats, out)


@campaign.command("verify")
@click.argument("folder", type=click.Path())
@option("--sha256", help="SHA-256 of the journal, as a report gives it.")
@option("--readings", type=click.IntRange(0), help="Number of readings, as a report gives it.")
@answers("Print what was found as JSON.")
def verify(folder, sha256, readings, out) -> None:
    """Say whether the journal in FOLDER is whole, and still holds what a report was made of.

    Each line has a checksum. A report states the number of readings and the SHA-256 of the journal:
    kept elsewhere, they tell a journal that was shortened or rewritten, with exit code 1. Readings
    that were taken since do no harm.

    \b
    Example:
      kinacc campaign verify check
      kinacc campaign verify check --readings 57 --sha256 5bd24b8a..
    """
    from kinacc.cli import campaigns

    campaigns.verify(folder, sha256, readings, out)


campaign.add_command(campaign_plan.plan)
