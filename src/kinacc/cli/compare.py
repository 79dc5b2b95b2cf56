"""``kinacc compare``: two calibrations of one arm side by side."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.output import answers


@click.command("compare")
@click.argument("first", type=click.Path())
@click.argument("second", type=click.Path())
@option("--joints", type=click.Path(), help="Joints to compare poses at. [as measured]")
@option("--poses", "count", default=500, type=click.IntRange(10, 100_000), help="At most.")
@option("--model", type=choice.MODEL, default="dh", help="Model compared.")
@choice.ROBOT
@choice.NAMING
@answers(table=True, picture="Draw to a .svg, .png or .pdf file.",
         page="Write a page to read in a browser: an .html file.")  # fmt: skip
def compare(first, second, joints, count, model, robot, config, out) -> None:
    """Compare two calibrations of one arm: what moved, and by how many standard deviations.

    FIRST and SECOND are results folders of data sets, or robot files. Parameters that the poses of
    either do not determine are marked, not counted. Poses are compared at the joints both were
    measured at: as they stand, and after the base and tool changes that bring them closest, each
    beside what two calibrations of an unchanged arm would show by chance. A VEC model says nothing
    outside the joint range it was fitted in: poses there are left out. No change is called proven
    where most poses lie where not both were measured.

    \b
    Example:
      kinacc compare results/ur10_b results/ur10_d --page moved.html --picture moved.svg
      kinacc compare before.yaml after.yaml --json
    """
    from kinacc.cli import comparison_report
    from kinacc.config import schema
    from kinacc.deployment.compare import compare as compared
    from kinacc.progress import reporting
    from kinacc.report.comparison_lines import lines

    with reporting("compare", bar=True):
        calibrations = [
            comparison_report.source(each, model, robot, config) for each in (first, second)
        ]
        q_rad = comparison_report.joints(calibrations, (first, second), joints, count)
        weight = schema.key("calibration.rotation_weight_mm_per_rad")["default"]
        found = compared(*calibrations, q_rad, weight, comparison_report.shared((first, second)))
    if out.picture is not None:
        from kinacc.figures.comparison import draw

        out.draw(draw(found))
    if out.page is not None:
        from kinacc.report.comparison import comparison_page

        out.write_page(comparison_page(found, calibrations[0], q_rad))
    out.deliver(comparison_report.answer(found), "\n".join(lines(found)))
