"""Options that say how a measured file is written, where the file itself leaves it open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click

from kinacc.cli.choice import option, together, values_of

_FILE = "measurements.file"

_text = (
    option("--encoding", type=values_of(f"{_FILE}.encoding"), help="Characters of a text file."),
    option("--sheet", help="Sheet of an Excel workbook."),
    option("--decimal", type=values_of(f"{_FILE}.decimal"), help="Decimal mark."),
    option(
        "--thousands",
        type=click.Choice([".", ",", " ", "'", "none"]),
        help="Mark between thousands.",
    ),
    option("--names", metavar="A,B,..", help="Names of the columns of a file without any."),
)
file_options = together(
    *_text,
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

# What a file of joints alone may leave open.
joint_file_options = together(
    *_text,
    option("--take", multiple=True, metavar="COLUMN",
           help="Read these joints of a file that names several; one column of them."),
    option("--joint-unit", type=values_of(f"{_FILE}.joint_unit"),
           help="Unit of the joints of a file."),
    option("--pulses-per-deg", metavar="A,B,..", help="Pulses of each joint in a degree."),
)  # fmt: skip
JOINT_ANSWERS = (
    *("encoding", "sheet", "decimal", "thousands", "names", "take", "joint_unit"),
    "pulses_per_deg",
)


def joint_answers(options: Mapping[str, Any]) -> dict[str, Any]:
    """What the options of a command say of a file of joints."""
    return {name: options[name] for name in JOINT_ANSWERS if options.get(name)}
