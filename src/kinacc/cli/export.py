"""``kinacc export``: a calibrated arm in the forms others read."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.output import answers
from kinacc.config.error_models import ERROR_MODELS, PLAINEST
from kinacc.deployment.export.files import FORMATS

_MAKERS = ("kuka", "abb", "fanuc", "ur", "yaskawa", "staubli", "ros")


@click.command("export")
@click.argument("folder", type=click.Path())
@option("--out", "target", type=click.Path(), default=".", help="Folder.")
@option("--format", "formats", multiple=True, type=click.Choice(FORMATS), help="Formats. [all]")
@option(
    "--for",
    "maker",
    type=click.Choice(_MAKERS, case_sensitive=False),
    help="Controller to enter values into.",
)
@option(
    "--model",
    type=click.Choice(list(ERROR_MODELS)),
    default=PLAINEST,
    help="Model to write; one that is no DH table goes into json alone.",
)
@option("--name", help="Name of the files. [the data set's, and the --model]")
@option("--urdf", type=click.Path(), help="A URDF whose origins are corrected.")
@option("--base-link", help="Link of that file the arm starts at. [its root]")
@option("--tip-link", help="Link of that file the arm ends at. [the only one it can]")
@option("--dh-joints", is_flag=True, help="URDF in the joints of the DH table.")
@choice.ROBOT
@choice.NAMING
@answers("List the files as JSON.", force="Replace files that are there.")
def export(
    folder,
    target,
    formats,
    maker,
    model,
    name,
    urdf,
    base_link,
    tip_link,
    dh_joints,
    robot,
    config,
    out,
) -> None:
    """Write a calibrated model of FOLDER, a results folder, for other programs.

    \b
    yaml      a robot file kinacc reads again
    json      parameters, deviations, frames, residuals, what the poses cannot tell
    csv       one row per joint, degrees and millimetres
    urdf      joint origins of the calibrated arm; with --urdf a file of yours, corrected in place
    markdown  Tables I to III
    latex     the same for a paper (booktabs)

    With --for, a page of values to enter into the robot's controller instead: joint zeros, or the
    DH offsets of UR, Staubli and ROS, TOOL and BASE, from a fit with only these parameters.

    Either all files appear or none; files that are there are kept without --force.

    \b
    Example:
      kinacc export results/mh180 --out exported
      kinacc export results/ur10_b --format urdf --urdf my_ur10.urdf --out exported
      kinacc export results/ur10_b --for ur --out exported
    """
    from kinacc.deployment.export.files import contents, formats_of, notes, read_source, write
    from kinacc.errors import Problem, refuse

    wanted = formats or formats_of(model)
    about_urdf = {"--base-link": base_link, "--tip-link": tip_link}
    problems = [
        Problem(option, "is given without a file of yours", fix="give --urdf as well")
        for option, value in about_urdf.items()
        if value is not None and urdf is None
    ]
    if urdf is not None and "urdf" not in wanted:
        problems.append(Problem("--urdf", f"{urdf} is not wanted", "with --format urdf"))
    refuse(problems, "Nothing was written")
    if maker is not None:
        _to_controller(folder, target, maker, name, robot, config, out)
        return
    arm = choice.robot_of(folder, robot, config)
    source = read_source(folder, arm, model, urdf, (base_link, tip_link), dh_joints)
    paths = write(contents(source, wanted, name), target, out.force)
    reason = choice.say_outdated(folder)
    out.say({"files": paths, **({"outdated": reason} if reason else {})}, "\n".join(paths))
    for item in notes(source):
        click.echo(item, err=True)


def _to_controller(folder, target, maker, name, robot, config, out) -> None:
    """Write the page of values for a controller, and its file where it reads one."""
    from pathlib import Path

    from kinacc.deployment import folder as results
    from kinacc.deployment.export.files import write
    from kinacc.deployment.export.pendant import fit_pendant
    from kinacc.report.pendant import pendant_page
    from kinacc.workflow.described import calibration_settings

    data_set = Path(folder).resolve().name
    arm = choice.robot_of(folder, robot, config)
    settings = calibration_settings(Path(folder), config)
    result = fit_pendant(results.read_tables(folder), arm, settings, maker, data_set)
    stem = f"{name or data_set}_{maker}"
    files = {f"{stem}.html": pendant_page(result)}
    if result.ending:
        files[f"{stem}{result.ending}"] = result.text + "\n"
    paths = write(files, target, out.force)
    choice.say_outdated(folder)
    first, *_ = errors = [*result.errors.itertuples()]
    lines = [f"Mean position error at {first.points} {first.poses}:"]
    lines += [f"  {item.model}: {item.position_mm:.3f} mm" for item in errors]
    out.say({**vars(result), "files": paths}, "\n".join([*lines, *paths]))
