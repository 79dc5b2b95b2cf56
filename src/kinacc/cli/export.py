"""``kinacc export``: a calibrated arm in the forms others read."""

from __future__ import annotations

from pathlib import Path

import click

from kinacc import __version__
from kinacc.cli import choice
from kinacc.cli.choice import FOLDER, option
from kinacc.cli.output import Output, answers
from kinacc.config.error_models import ERROR_MODELS, PLAINEST
from kinacc.deployment import folder as results
from kinacc.deployment.export import files, source
from kinacc.deployment.export.controllers import CONTROLLERS
from kinacc.deployment.export.pendant import fit_pendant
from kinacc.errors import input_error
from kinacc.report.rendering import environment, lines
from kinacc.workflow.described import calibration_settings


@click.command("export")
@FOLDER
@option("--out", "target", type=choice.PATH, default=".", help="Folder.")
@option("--format", "formats", multiple=True, type=click.Choice([*files.FORMATS]),
        help="Formats. [all]")  # fmt: skip
@option("--for", "maker", type=click.Choice([*CONTROLLERS], case_sensitive=False),
        help="Controller whose values are written, as a page.")  # fmt: skip
@option("--model", type=click.Choice(list(ERROR_MODELS)), default=PLAINEST,
        help="Error model; one that is no DH table goes into json alone.")  # fmt: skip
@option("--urdf", type=choice.PATH, help="URDF file whose origins are corrected.")
@option("--base-link", help="Link of that file where the arm starts. [its root]")
@option("--tip-link", help="Link of that file where the arm ends. [the only one it can]")
@answers(force=True)
def export(
    folder: str,
    target: str,
    formats: tuple[str, ...],
    maker: str | None,
    model: str,
    urdf: str | None,
    base_link: str | None,
    tip_link: str | None,
    out: Output,
) -> None:
    """Write the calibrated model of the results in FOLDER for other programs.

    \b
    yaml      a robot file kinacc reads again
    json      parameters, deviations, frames, residuals, unidentifiable parameters
    csv       one row per joint, degrees and millimetres
    urdf      joint origins of the calibrated arm; with --urdf in a file of yours
    markdown  Tables I to III
    latex     the same for a paper (booktabs)

    \b
    Example:
      kinacc export results/mh180 --out exported
      kinacc export results/ur10_b --for ur --out exported
    """
    wanted = formats or files.formats_of(model)
    if urdf is None and (base_link or tip_link):
        message = "are given without a file of yours"
        raise input_error("--base-link, --tip-link", message, fix="give --urdf as well")
    if urdf is not None and "urdf" not in wanted:
        raise input_error("--urdf", f"{urdf} is not wanted", "with --format urdf")
    reason = choice.print_outdated(folder)
    if maker is not None:
        _to_controller(folder, target, maker, out)
        return
    content = source.read_source(folder, model, urdf, (base_link, tip_link))
    paths = files.write(files.contents(content, wanted), target, out.force)
    out.show({"files": paths, "outdated": reason}, lines=paths)
    for item in source.notes(content):
        click.echo(item, err=True)


def _to_controller(folder: str, target: str, maker: str, out: Output) -> None:
    """Write the page of values for a controller, and its file where it reads one."""
    data_set = Path(folder).resolve().name
    settings = calibration_settings(Path(folder))
    result = fit_pendant(results.read_tables(folder), settings, maker, data_set)
    stem = f"{data_set}_{maker}"
    page = environment().get_template("pendant.html")
    contents = {f"{stem}.html": page.render(found=result, version=__version__)}
    if result.ending:
        contents[f"{stem}{result.ending}"] = result.text + "\n"
    paths = files.write(contents, target, out.force)
    out.show(vars(result) | {"files": paths}, lines=lines("pendant.txt", r=result, files=paths))
