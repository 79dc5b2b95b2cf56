"""``kinacc plan-campaign``: how many readings a wanted bound takes, before the first is taken."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.output import answers


@click.command("plan-campaign")
@option("--poses", default=200, type=click.IntRange(2, 100_000),
        help="Candidates the statement is to be about.")  # fmt: skip
@choice.campaign_options
@option("--budget", multiple=True, type=click.IntRange(1, 1_000_000),
        help="Readings in all; may be repeated. [1/4 to 3 times the poses]")  # fmt: skip
@option("--power", default=0.8, type=click.FloatRange(0.0, 1.0),
        help="How often the aim is to be reached.")  # fmt: skip
@option(
    "--errors", multiple=True, help="Errors simulated; may be repeated. [smooth, workshop, defect]"
)
@option("--point", help="Target of a results folder whose errors are meant. "
        "[the tool, else the first]")  # fmt: skip
@option("--largest-mm", type=float, help="Scale the errors so that the largest is this.")
@option("--repetitions", default=30, type=click.IntRange(2, 100_000),
        help="Simulated campaigns per budget.")  # fmt: skip
@answers(table=True, picture="Draw width against budget: .svg, .png, .pdf.")
def plan_campaign(out, **given) -> None:
    """Simulate campaigns: which width a budget brings, and which budget a wanted bound takes.

    \b
    Errors to simulate with (--errors):
      a results folder       held-out errors of one of its targets, or the points of its study
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
    from kinacc.cli import campaign_plans
    from kinacc.progress import reporting

    asked = campaign_plans.question(given)
    with reporting("plan-campaign", bar=True) as progress:
        found = campaign_plans.answer(asked, progress)
    if out.picture is not None:
        out.draw(campaign_plans.drawn(asked, found))
    out.deliver(campaign_plans.as_sheet(asked, found), campaign_plans.in_words(asked, found))
