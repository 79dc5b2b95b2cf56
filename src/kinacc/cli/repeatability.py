"""``kinacc repeatability``: noise of readings, and repeatability of arm and instrument."""

from __future__ import annotations

import math

import click

from kinacc.assess.noise import ENOUGH, FEWEST
from kinacc.calibration.noise import per_axis_mm
from kinacc.checks.repeated_readings import estimate, read_repeats
from kinacc.cli.choice import PATH, option
from kinacc.cli.output import Output, answers
from kinacc.report.rendering import lines


@click.command("repeatability")
@click.argument("file", type=PATH)
@option("--rows", "rows_are", type=click.Choice(["visits", "stays"]),
        help="Whether the arm left the pose before every row, or stayed.")  # fmt: skip
@answers(table=True)
def repeatability(file: str, rows_are: str | None, out: Output) -> None:
    """Estimate the noise of a campaign's readings from poses that were read repeatedly.

    FILE has x_mm, y_mm, z_mm (or _m) and `pose`; and optionally `visit` (rows of one visit: the arm
    stayed), `side` (of approach) and `time` (or time_s, time_min, time_h), of one target and
    instrument. 20 poses, visited three times from different sides over the day, are enough.

    \b
    Example:
      kinacc repeatability repeats.csv -o noise.json
      kinacc campaign start check --calibration results/ur10_d --repeatability noise.json
    """
    read = read_repeats(file, rows_are)
    for note in read.notes:
        click.echo(f"{file}: {note}", err=True)
    result = estimate(read)
    instrument = per_axis_mm(result.instrument_std_mm)
    arm = "arm and instrument" if math.isnan(instrument) else "arm"
    parts = {
        "instrument": instrument,
        f"{arm} from one side": per_axis_mm(result.one_side_std_mm),
        f"{arm} from all sides": per_axis_mm(result.all_sides_std_mm),
    }
    known = {name: std for name, std in parts.items() if math.isfinite(std)}
    text = lines("repeatability.txt", r=result, parts=known, fewest=FEWEST, enough=ENOUGH)
    out.show(result, result.rows, text)
