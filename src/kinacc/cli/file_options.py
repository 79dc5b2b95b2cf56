"""Options that say how a measured file is written, where the file itself leaves it open."""

from __future__ import annotations

import click

from kinacc.cli.choice import option, together, values_of

_FILE = "measurements.file"

file_options = together(
    option("--encoding", type=values_of(f"{_FILE}.encoding"), help="Characters of a text file."),
    option("--sheet", help="Sheet of an Excel workbook."),
    option("--decimal", type=values_of(f"{_FILE}.decimal"), help="Decimal mark."),
    option(
        "--thousands",
        type=click.Choice([".", ",", " ", "'", "none"]),
        help="Mark between thousands.",
    ),
    option("--names", metavar="A,B,..", help="Names of the columns of a file without any."),
    option(
        "--no-reading",
        metavar="NUMBER",
        help="Number that says that nothing was read, such as 0 (all of x, y, z) or 9999; or none.",
    ),
    option(
        "--sigma",
        type=click.Choice(["1", "2", "3", "none"]),
        help="Standard deviations that an uncertainty of the file is; none leaves it out.",
    ),
    option(
        "--direction-unit",
        type=values_of(f"{_FILE}.directions.unit"),
        help="Unit of an instrument's horizontal and vertical angles.",
    ),
    option(
        "--vertical",
        type=values_of(f"{_FILE}.directions.vertical"),
        help="What vertical angles are counted from.",
    ),
    option(
        "--horizontal",
        type=values_of(f"{_FILE}.directions.horizontal"),
        help="How horizontal angles are counted, seen from above.",
    ),
)
# Their names among the options, which are the keys of the choices they answer.
ANSWERS = (
    *("encoding", "sheet", "decimal", "thousands", "names", "no_reading", "sigma"),
    *("direction_unit", "vertical", "horizontal"),
)
