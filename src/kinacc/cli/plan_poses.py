"""``kinacc plan-poses``: which poses to measure, and in which order to drive to them."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.config import schema

PICTURES = (".svg", ".png", ".pdf")
MOST_CANDIDATES = 100_000
TRUNCATION = "calibration.dh.truncation"
INDICES = ("O1", "O2", "O3", "O4", "O5")


@click.command("plan-poses")
@click.argument("robot", required=False)
@click.option(
    "--poses",
    "count",
    default=40,
    show_default=True,
    type=click.IntRange(1, 2000),
    help="Poses chosen.",
)
@click.option(
    "--index", type=click.Choice(INDICES), default="O1", show_default=True, help="What is best."
)
@click.option("--candidates", type=click.Path(), help="File of joints to choose from.")
@click.option(
    "--drawn",
    default=1000,
    show_default=True,
    type=click.IntRange(10, MOST_CANDIDATES),
    help="Candidates drawn.",
)
@click.option("--joints-deg", help='Ranges to draw from, e.g. "-90:90,-60:60,...". [limits]')
@click.option("--inside-mm", help='Where the tool may be in the base: "x0:x1,y0:y1,z0:z1".')
@click.option("--dataset", help="Take robot, fit and region of a data set of the configuration.")
@click.option("--config", multiple=True, help=f"Configuration. [{choice.CONFIG}]")
@click.option("--tool-mm", help="Measured point in the flange frame. [the robot's tool]")
@click.option("--position-only", is_flag=True, help="Orientations are not measured.")
@click.option("--frames-known", is_flag=True, help="Base and tool are not estimated.")
@click.option("--hayati", help='Joints with a Hayati angle, e.g. "2,3".')
@click.option("--threshold", default=schema.key(TRUNCATION).default, show_default=True,
              type=choice.values_of(TRUNCATION),
              help="Directions seen less than this share of the best are left out.")  # fmt: skip
@click.option("--metric", type=click.Choice(["largest", "sum"]), default="largest",
              show_default=True,
              help="Travel between poses: of the joint that moves most, or of all.")  # fmt: skip
@click.option("--from-deg", help="Joints the arm starts at. [zero]")
@click.option("--picture", type=click.Path(), help="Draw index against poses: .svg, .png, .pdf.")
@choice.output_options
def plan_poses(**given) -> None:
    """Choose poses that tell most of an arm, in an order with little travel.

    ROBOT is a shipped name or a robot file (not needed with --dataset). Poses come from a file with
    q1_deg and so on, or are drawn evenly over the joints and kept where the tool may be. Collisions
    and the instrument's view are not known here: leave such poses out of the candidates.

    \b
    O1  geometric mean of the singular values / sqrt(poses)  (D-optimal; Borm, Menq)
    O2  least / largest singular value                       (Driels, Pathre)
    O3  least singular value                                 (E-optimal; Nahvi)
    O4  least squared / largest                              (Nahvi, Hollerbach)
    O5  inverse of the sum of inverses                       (Sun, Hollerbach)

    \b
    Example:
      kinacc plan-poses ur10 --hayati 2,3 --poses 50 -o plan.csv --picture index.svg
      kinacc plan-poses --dataset mh180 --poses 60 --index O4 --json
      kinacc plan-poses my_robot.yaml --candidates reachable.csv --position-only -o my_plan.csv
    """
    from kinacc.cli import planned, sheet
    from kinacc.progress import reporting

    sheet.check_output(given["output"], given["force"])
    sheet.check_output(given["picture"], given["force"], PICTURES)
    asked = planned.question(given)
    with reporting("plan-poses", bar=True) as progress:
        found = planned.answer(asked, progress)
        if given["picture"] is not None:
            planned.draw(asked, found, given["picture"], progress)
    choice.deliver(
        planned.as_sheet(asked, found), given["output"], given["as_json"], given["force"]
    )
    if not given["as_json"]:
        click.echo(planned.in_words(asked, found))
