"""``kinacc plan-campaign``: how many readings a wanted bound takes, before the first is taken."""

from __future__ import annotations

import click

from kinacc.assess.statement import CONFIDENCE
from kinacc.cli import choice
from kinacc.cli.plan_poses import PICTURES


@click.command("plan-campaign")
@click.option("--noise-mm", help="Standard deviation per axis: one number, or three.")
@click.option("--covariance-mm2", help="Covariance of a reading: nine numbers, row by row.")
@click.option("--poses", default=200, show_default=True, type=click.IntRange(2, 100_000),
              help="Candidates the statement is to be about.")  # fmt: skip
@click.option("--budget", multiple=True, type=click.IntRange(1, 1_000_000),
              help="Readings in all; may be repeated. [1/4 to 3 times the poses]")  # fmt: skip
@click.option("--width-mm", type=float, help="Wanted distance of upper from lower bound.")
@click.option("--tolerance-mm", type=float, help="Largest error allowed.")
@click.option("--target", type=click.Choice(["candidates", "measured"]), default="candidates",
              show_default=True, help="Which largest error is meant.")  # fmt: skip
@click.option("--power", default=0.8, show_default=True, type=click.FloatRange(0.0, 1.0),
              help="How often the aim is to be reached.")  # fmt: skip
@click.option("--errors", multiple=True,
              help="Errors simulated; may be repeated. [smooth, workshop, defect]")  # fmt: skip
@click.option("--largest-mm", type=float, help="Scale the errors so that the largest is this.")
@click.option("--assessor", help="How points are chosen and bounds made. [search_and_confirm]")
@click.option("--set", "settings", multiple=True, help="Setting of the assessor: NAME=VALUE.")
@click.option("--confidence", default=CONFIDENCE, show_default=True, type=float,
              help="How surely each bound is to hold.")  # fmt: skip
@click.option("--repetitions", default=30, show_default=True, type=click.IntRange(2, 100_000),
              help="Simulated campaigns per budget.")  # fmt: skip
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0),
              help="Decides every random draw.")  # fmt: skip
@click.option("--picture", type=click.Path(), help="Draw width against budget: .svg, .png, .pdf.")
@choice.output_options
def plan_campaign(**given) -> None:
    """Simulate campaigns: which width a budget brings, and which budget a wanted bound takes.

    \b
    Errors to simulate with (--errors):
      a results folder       its cross-validated residuals, or the points of its study
      a .csv, .parquet file  columns ex_mm, ey_mm, ez_mm
      smooth, gravity, ripple, thermal, workshop, defect, rare
                             families of synthetic arms after a DH calibration

    How large the errors are and how heavy their tail is matters as much as the noise: simulate with
    what your arm is like, and with worse. The budget named is enough on all of them.

    \b
    Example:
      kinacc plan-campaign --noise-mm 0.05 --poses 200 --width-mm 0.3
      kinacc plan-campaign --noise-mm 0.1 --errors results/ur10_d --tolerance-mm 2.5 --json
      kinacc plan-campaign --noise-mm 0.1 --errors defect --largest-mm 1.5 --width-mm 0.4 \\
          --budget 200 --budget 400 --picture width.svg
    """
    from kinacc.cli import campaign_plans, sheet
    from kinacc.progress import reporting

    sheet.check_output(given["output"], given["force"])
    sheet.check_output(given["picture"], given["force"], PICTURES)
    asked = campaign_plans.question(given)
    with reporting("plan-campaign", bar=True) as progress:
        found = campaign_plans.answer(asked, progress)
    if given["picture"] is not None:
        campaign_plans.draw(asked, found, given["picture"])
    answer = campaign_plans.as_sheet(asked, found)
    choice.deliver(answer, given["output"], given["as_json"], given["force"])
    if not given["as_json"]:
        click.echo(campaign_plans.in_words(asked, found))
