"""``kinacc compare``: two calibrations of one arm side by side."""

from __future__ import annotations

import click

from kinacc.cli import choice

PICTURES = (".svg", ".png", ".pdf")


@click.command("compare")
@click.argument("first", type=click.Path())
@click.argument("second", type=click.Path())
@click.option("--joints", type=click.Path(), help="Joints to compare poses at. [as measured]")
@click.option(
    "--poses",
    "count",
    default=500,
    show_default=True,
    type=click.IntRange(10, 100_000),
    help="At most.",
)
@click.option("--picture", type=click.Path(), help="Draw to a .svg, .png or .pdf file.")
@click.option(
    "--model",
    type=choice.MODEL,
    default="dh",
    show_default=True,
    help="Model compared.",
)
@click.option("--robot", help="Robot of both. [as the results say]")
@click.option("--config", multiple=True, help="Configuration naming it.")
@choice.output_options
def compare(
    first, second, joints, count, picture, model, robot, config, output, as_json, force
) -> None:
    """Compare two calibrations of one arm: what moved, and by how many standard deviations.

    FIRST and SECOND are results folders of data sets, or robot files. Parameters that the poses of
    either do not determine are marked, not counted. Poses are compared at the joints both were
    measured at: as they stand, and after the base and tool changes that bring them closest, each
    beside what two calibrations of an unchanged arm would show by chance.

    \b
    Example:
      kinacc compare results/ur10_b results/ur10_d --picture moved.svg
      kinacc compare before.yaml after.yaml --json
    """
    from kinacc.cli import comparison_report, sheet
    from kinacc.config import schema
    from kinacc.deployment.compare import compare as compared
    from kinacc.progress import reporting

    sheet.check_output(output, force)
    sheet.check_output(picture, force, PICTURES)
    with reporting("compare", bar=True):
        arms = [comparison_report.source(each, model, robot, config) for each in (first, second)]
        q_rad = comparison_report.joints(arms, (first, second), joints, count)
        weight = schema.key("calibration.rotation_weight_mm_per_rad").default
        found = compared(*arms, q_rad, weight)
    answer = comparison_report.answer(found, arms, len(q_rad))
    if picture is not None:
        from pathlib import Path

        from kinacc.figures.comparison import draw
        from kinacc.figures.save import write

        path = Path(picture)
        write(draw(found, *comparison_report.short_names(arms)), {path.suffix[1:]: path})
    choice.deliver(answer, output, as_json, force)
    if not as_json:
        click.echo(comparison_report.in_words(found, arms))
