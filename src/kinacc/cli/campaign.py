"""``kinacc campaign``: a measuring campaign on disk, from the first point to the report."""

from __future__ import annotations

import click

from kinacc.assess.statement import CONFIDENCE
from kinacc.cli import choice
from kinacc.cli.groups import InOrder


@click.group("campaign", cls=InOrder)
def campaign() -> None:
    """Bound the largest error of a calibrated arm, one measurement after another.

    \b
    start    fix points, instruments, assessor and budget
    next     which joints to measure now
    record   take a reading, or a file of readings
    status   what may be said so far, and what is still needed
    report   tables, picture and text

    \b
    Example:
      kinacc campaign start check --calibration results/ur10_d --noise-mm 0.05 --budget 200
      kinacc campaign next check
      kinacc campaign record check --position-mm "812.31,-40.02,655.90"
      kinacc campaign status check
    """


@campaign.command("start")
@click.argument("folder", type=click.Path(file_okay=False))
@click.option("--calibration", required=True, type=click.Path(), help="Results folder of the arm.")
@click.option("--model", type=choice.MODEL, help="Model to judge. [the one selected]")
@click.option("--robot", help="Robot of the results. [as the results say]")
@click.option("--config", multiple=True, help=f"Configuration naming it. [{choice.CONFIG}]")
@click.option("--session", help="Session whose instrument placement is meant. [the first]")
@click.option("--point", help="Target that is measured, or flange. [the tool]")
@click.option("--candidates", type=click.Path(), help="File of joints that may be measured.")
@click.option("--drawn", default=200, show_default=True, type=click.IntRange(1, 20_000),
              help="Candidates drawn where there is no file.")  # fmt: skip
@click.option(
    "--region",
    type=click.Choice(["configured", "fitted", "limits"]),
    help="Draw from the configured evaluation space, the joints the calibration covers, or the "
    "joint limits. [configured if there is a configuration, else fitted]",
)
@click.option("--joints-deg", help='Ranges to draw from, e.g. "-90:90,-60:60,...".')
@click.option("--inside-mm", help='Where the tool may be in the base: "x0:x1,y0:y1,z0:z1".')
@click.option("--noise-mm", help="Standard deviation per axis: one number, or three.")
@click.option("--covariance-mm2", help="Covariance of a reading: nine numbers, row by row.")
@click.option("--instrument", multiple=True,
              help="NAME=noise, NAME=three or NAME=nine numbers; may be repeated.")  # fmt: skip
@click.option("--frame", type=click.Choice(["instrument", "base"]), default="instrument",
              show_default=True, help="Frame of readings and covariances.")  # fmt: skip
@click.option("--assessor", help="How points are chosen and bounds made. [search_and_confirm]")
@click.option("--set", "settings", multiple=True, help="Setting of the assessor: NAME=VALUE.")
@click.option("--budget", default=200, show_default=True, type=click.IntRange(max=1_000_000),
              help="Readings in all.")  # fmt: skip
@click.option("--confidence", default=CONFIDENCE, show_default=True, type=float,
              help="How surely each bound is to hold.")  # fmt: skip
@click.option("--tolerance-mm", type=float, help="Largest error the arm is allowed to have.")
@click.option("--width-mm", type=float, help="Wanted distance of upper from lower bound.")
@click.option("--target", type=click.Choice(["candidates", "measured"]), default="candidates",
              show_default=True, help="Which largest error the width is wanted of.")  # fmt: skip
@click.option("--joint-tolerance-deg", default=0.02, show_default=True, type=float,
              help="How far reported joints may be from those asked for.")  # fmt: skip
@click.option("--implausible-mm", type=float, help="Error beyond which a reading is refused.")
@click.option("--from-deg", help="Joints the arm starts at. [zero]")
@click.option("--visit", type=click.Choice(["travel", "random"]), default="travel",
              show_default=True, help="Order of the first visit.")  # fmt: skip
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0),
              help="Decides every random draw.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print what was begun as JSON.")
def start(**given) -> None:
    """Begin a campaign in FOLDER: nothing of this can be changed once there are readings.

    Candidates are the joint configurations the statement is about: rows of a file (q1_deg .. or
    q1_rad ..; q1_mm where a joint slides; a `pose` column names them, s1 .. are directions of
    travel), or drawn. Their order is random, by the seed, and knows nothing of the errors. Where
    the calibration is too unsure of them for readings to be judged, that is said.

    The noise must hold all that differs between readings of one pose: the instrument, its target,
    and how well the arm repeats the pose.

    \b
    Example:
      kinacc campaign start check --calibration results/ur10_d --noise-mm 0.05 --budget 200
      kinacc campaign start check --calibration results/mh180 --candidates points.csv \\
          --instrument tracker=0.03 --instrument camera=0.1,0.1,0.3 --tolerance-mm 0.8
    """
    from kinacc.cli import campaigns

    campaigns.start(given)


@campaign.command("next")
@click.argument("folder", type=click.Path())
@click.option("--all", "every", is_flag=True,
              help="All points that are measured whatever is read, in order.")  # fmt: skip
@choice.output_options
def next_(folder, every, output, as_json, force) -> None:
    """Name the joint values to measure next, in degrees and radians.

    Nothing is written, so it may be asked as often as wanted. With --all the rest of the first
    visit, to write a robot program of it.

    \b
    Example:
      kinacc campaign next check
      kinacc campaign next check --all -o visit.csv
    """
    from kinacc.cli import campaigns

    campaigns.next_(folder, every, output, as_json, force)


@campaign.command("record")
@click.argument("folder", type=click.Path())
@click.argument("file", type=click.Path(), required=False)
@click.option("--position-mm", help='Measured position "x,y,z".')
@click.option("--point", help="Point it was measured at. [the one asked for]")
@click.option("--joints-deg", help="Joints the controller reported (mm where a joint slides).")
@click.option("--joints-rad", help="The same in radians.")
@click.option("--instrument", help="Instrument that measured. [the first]")
@click.option("--std-mm", help="Noise of this reading where it is not the instrument's.")
@click.option("--accept-implausible", is_flag=True, help="Take it however large the error is.")
@click.option("--skip-bad", is_flag=True, help="Take the good rows of a file, name the others.")
@click.option("--again", is_flag=True,
              help="They are new readings, though they repeat or replace others.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print the answer as JSON.")
def record(**given) -> None:
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

    campaigns_record.record(given)


@campaign.command("leave-out")
@click.argument("folder", type=click.Path())
@click.argument("point")
@click.option("--reason", required=True, help="Why it cannot be measured.")
@click.option("--json", "as_json", is_flag=True, help="Print the standing as JSON.")
def leave_out(folder, point, reason, as_json) -> None:
    """Leave out a POINT that cannot be measured: hidden from the instrument, or not to be reached.

    Only a point without readings, and only for a reason that has nothing to do with its error. The
    statements then speak of the other candidates.

    \b
    Example:
      kinacc campaign leave-out check 17 --reason "hidden behind the column"
    """
    from kinacc.cli import campaigns_record

    campaigns_record.leave_out(folder, point, reason, as_json)


@campaign.command("strike")
@click.argument("folder", type=click.Path())
@click.argument("number", type=click.IntRange(1))
@click.option("--reason", required=True, help="What went wrong with it.")
@click.option("--json", "as_json", is_flag=True, help="Print the standing as JSON.")
def strike(folder, number, reason, as_json) -> None:
    """Declare reading NUMBER void: something went wrong that has nothing to do with its size.

    The reading stays in the journal and in every report, with the reason. A reading that is struck
    for being large makes the bounds wrong.

    \b
    Example:
      kinacc campaign strike check 31 --reason "reflector was not seated"
    """
    from kinacc.cli import campaigns_record

    campaigns_record.strike(folder, number, reason, as_json)


@campaign.command("status")
@click.argument("folder", type=click.Path())
@click.option("--width-mm", type=float,
              help="Wanted distance of upper from lower bound. [as begun]")  # fmt: skip
@click.option("--tolerance-mm", type=float, help="Largest error allowed. [as begun]")
@click.option("--target", type=click.Choice(["candidates", "measured"]),
              help="Which largest error the forecast is about. [as begun]")  # fmt: skip
@click.option("--simulations", default=20, show_default=True, type=click.IntRange(0, 10_000),
              help="Simulated ends for the forecast; 0 for none.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print the answer as JSON.")
def status(**given) -> None:
    """Say what the readings so far allow to say, and what is still needed.

    How many more readings the wanted width should take, or what the tolerance is likely to be
    decided to, is simulated from what was read so far: a forecast, no bound rests on it.

    \b
    Example:
      kinacc campaign status check
      kinacc campaign status check --width-mm 0.15 --json
    """
    from kinacc.cli import campaigns

    campaigns.status(given)


@campaign.command("report")
@click.argument("folder", type=click.Path())
@click.option("--to", type=click.Path(file_okay=False), help="Folder. [report in the campaign's]")
@click.option("--force", is_flag=True, help="Replace files that are there.")
@click.option("--json", "as_json", is_flag=True, help="Print what it says as JSON.")
def report(**given) -> None:
    """Write what was measured and what may be said of it: tables, picture, text.

    Leaves campaign_points, campaign_readings and campaign_bounds (.parquet), campaign (.svg, .png)
    and report.md.

    \b
    Example:
      kinacc campaign report check
      kinacc campaign report check --to papers/check --json
    """
    from kinacc.cli import campaigns

    campaigns.write_report(given)
