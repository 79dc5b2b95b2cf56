"""``kinacc plan-poses``: which poses to measure, and in which order to drive to them."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.file_options import joint_file_options
from kinacc.cli.output import answers
from kinacc.config import schema

MOST_CANDIDATES = 100_000
TRUNCATION = "calibration.dh.truncation"


@click.command("plan-poses")
@click.argument("robot", required=False)
@option("--poses", "count", default=40, type=click.IntRange(1, 2000), help="Poses chosen.")
@option("--candidates", type=click.Path(), help="File of joints to choose from.")
@joint_file_options
@option("--drawn", default=1000, type=click.IntRange(10, MOST_CANDIDATES), help="Candidates drawn.")
@option("--joints-deg", help='Ranges to draw from, e.g. "-90:90,-60:60,...". [limits]')
@option("--inside-mm", help='Where the tool may be in the base: "x0:x1,y0:y1,z0:z1".')
@option("--dataset", help="Take robot, fit and region of a data set of the configuration.")
@option("--config", multiple=True, help=f"Configuration. [{choice.CONFIG}]")
@option("--tool-mm", help="Measured point in the flange frame. [the robot's tool]")
@option("--position-only", is_flag=True, help="Orientations are not measured.")
@option("--frames-known", is_flag=True, help="Base and tool are not estimated.")
@option("--hayati", help='Joints with a Hayati angle, e.g. "2,3".')
@option("--threshold", default=schema.key(TRUNCATION)["default"], type=choice.values_of(TRUNCATION),
        help="Directions seen less than this share of the best are left out.")  # fmt: skip
@option("--from-deg", help="Joints the arm starts at. [zero]")
@answers(table=True, picture="Draw index against poses: .svg, .png, .pdf.")
def plan_poses(out, **given) -> None:
    """Choose a D-optimal set of poses, in an order with little travel.

    ROBOT is a shipped name or a robot file (not needed with --dataset). Poses come from a file in
    any form that `kinacc init` reads, or are drawn evenly over the joints and kept where the tool
    may be. Collisions and the instrument's view are not known here: leave such poses out of the
    candidates.

    \b
    Example:
      kinacc plan-poses ur10 --hayati 2,3 --poses 50 -o plan.csv --picture index.svg
      kinacc plan-poses --dataset mh180 --poses 60 --json
      kinacc plan-poses my_robot.yaml --candidates reachable.csv --position-only -o my_plan.csv
    """
    from kinacc.cli import planned
    from kinacc.progress import reporting

    asked = planned.question(given)
    with reporting("plan-poses", bar=True) as progress:
        found = planned.answer(asked, progress)
        if out.picture is not None:
            from kinacc.figures import planned_poses

            out.draw(planned_poses.draw(found.index, asked.robot.name))
    out.deliver(planned.as_sheet(asked, found), planned.in_words(found))
