"""``kinacc repeatability``: what repeated readings say of instrument, arm and noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from kinacc.cli.choice import option
from kinacc.cli.output import answers

if TYPE_CHECKING:
    from kinacc.cli.repeatability_answer import Found


@click.command("repeatability")
@click.argument("file", type=click.Path())
@option("--rows", "rows_are", type=click.Choice(["visits", "stays"]),
        help="Whether the arm left the pose before every row, or stayed.")  # fmt: skip
@answers(table=True)
def repeatability(file, rows_are, out) -> None:
    """Tell the noise of a campaign's readings from poses that were read again and again.

    FILE has x_mm, y_mm, z_mm (or _m) and a column `pose`; `visit` (or approach) numbers the times
    the arm came to the pose, so that rows of one visit are readings between which it stayed; `side`
    (or direction) names where it came from; `time` (or time_s, time_min, time_h) is when. All rows
    are of one target, instrument and set-up.

    Readings of one visit tell the instrument, visits from one side the arm's unidirectional and
    sides its bidirectional repeatability; ISO 9283's RP stands beside them. What a reading of a
    campaign carries is all of it. 20 poses, visited three times each from different sides and
    spread over the day, are enough (60 degrees of freedom or more).

    \b
    Example:
      kinacc repeatability repeats.csv
      kinacc repeatability repeats.csv --rows visits -o noise.json
      kinacc campaign start check --calibration results/ur10_d --repeatability noise.json
    """
    from kinacc.cli import repeated_rows
    from kinacc.cli.repeatability_answer import as_sheet, found_in, in_words

    found: Found = found_in(repeated_rows.of_file(file, rows_are))
    if found.rows.unused:
        click.echo(f"not used: {', '.join(found.rows.unused)}", err=True)
    out.deliver(as_sheet(found), "\n".join(in_words(found, out.table)))
