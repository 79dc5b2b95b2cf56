"""``kinacc verify``: a calibration at readings that it was not fitted to."""

from __future__ import annotations

import warnings
from pathlib import Path

import click

from kinacc.cli.choice import PATH, option
from kinacc.cli.data import measured_data_set
from kinacc.cli.output import Output, answers
from kinacc.cli.process import AGAINST, DONE, UNDECIDED
from kinacc.config.records import Settings
from kinacc.deployment import folder as results
from kinacc.deployment import verify as verification
from kinacc.deployment.permutation import LEVEL
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot as robots
from kinacc.progress import reporting
from kinacc.report import rendering
from kinacc.synthetic import source
from kinacc.workflow.described import like_those_of

_YAML = (".yaml", ".yml")
_SETUP = click.Choice(["same", "moved"])
_DETAILS = ("mean_mrad", "quantile_99_mrad", "largest_mrad", "rms_mrad", "rms_mm")
_EXIT = {verification.PASS: DONE, verification.FAIL: AGAINST, verification.UNDECIDED: UNDECIDED}


@click.command("verify")
@click.argument("readings", type=click.Path(path_type=Path), metavar="NEW")
@option("--calibration", "folder", type=PATH, required=True, help="Results folder.")
@option("--base", type=_SETUP, required=True, help="Instrument since the calibration.")
@option("--tool", type=_SETUP, required=True, help="Tool or target since the calibration.")
@option("--dataset", help="Data set of NEW, where NEW is a .yaml. [the only one]")
@answers(table=True, verbose=True)
def verify(
    readings: Path, folder: str, base: str, tool: str, dataset: str | None, out: Output
) -> None:
    """Test whether a calibration still holds at 10 to 20 new configurations.

    NEW is a file of readings like those of the calibration, or a .yaml by `kinacc init`. A frame
    that was moved is fitted to the new readings. Exit code 0: PASS; 1: FAIL; 3: UNDECIDED.

    \b
    Example:
      kinacc verify today.csv --calibration results/tracker --base same --tool same
    """
    moved = [name for name, how in (("base", base), ("tool", tool)) if how == "moved"]
    name, config = _settings(readings, folder, dataset)
    tables = results.read_tables(folder, "pose_errors")
    arm = results.robot_of(tables)
    results.require_same_robot(arm, robots.load(config["robot"]), folder)
    weight = float(config["calibration"]["rotation_weight_mm_per_rad"])
    with reporting("verify"), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            columns = source.run({}, config)["measurements"]
        except InputError as error:
            if readings.suffix.lower() in _YAML:
                raise
            message = "cannot be read as the readings of the calibration were"
            fix = f"if it has another form: run kinacc init {readings} first, and give the .yaml"
            raise InputError([Problem(str(readings), message, fix=fix), *error.problems]) from None
        result = verification.verify(tables, columns, moved, weight)
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        click.echo(f"{name}: {text}", err=True)
    lines = rendering.lines(
        "verify.txt",
        v=result,
        level=LEVEL,
        slides=arm.dh.prismatic,
        set_up_moved=verification.SET_UP_MOVED,
        new=str(readings),
        folder=folder,
        dataset=dataset,
        moved=moved,
    )
    shown = result.errors if out.verbose else result.errors.drop(columns=[*_DETAILS])
    out.show(result, result.rows, lines, shown)
    if code := _EXIT[result.verdict]:
        raise SystemExit(code)


def _settings(readings: Path, folder: str, dataset: str | None) -> tuple[str, Settings]:
    """Name and settings of the new readings: those of a .yaml, or of the calibration."""
    if readings.suffix.lower() not in _YAML:
        return readings.stem, like_those_of(Path(folder), readings)
    return measured_data_set(str(readings), dataset)
