"""``kinacc verify``: a calibration at readings that it was not fitted to."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.exit_codes import AGAINST, UNDECIDED
from kinacc.cli.output import answers

if TYPE_CHECKING:
    from kinacc.deployment.verify import Verification

_YAML = (".yaml", ".yml")
_SETUP = click.Choice(["same", "moved"])
_DETAILS = ("mean_mrad", "quantile_99_mrad", "largest_mrad", "rms_mrad", "rms_mm")


@click.command("verify")
@click.argument("readings", type=click.Path(path_type=Path), metavar="NEW")
@click.option("--calibration", "folder", type=click.Path(), required=True, help="Results folder.")
@click.option("--base", type=_SETUP, required=True, help="Instrument since the calibration.")
@click.option("--tool", type=_SETUP, required=True, help="Tool or target since the calibration.")
@click.option("--dataset", help="Data set of NEW, where NEW is a .yaml. [the only one]")
@answers(table=True, verbose=True)
def verify(readings: Path, folder: str, base: str, tool: str, dataset: str | None, out) -> None:
    """Test whether a calibration still holds at 5 to 15 new configurations.

    NEW is a file of readings like those of the calibration, or a .yaml by `kinacc init`. A frame
    that was moved is fitted to the new readings. A permutation test compares position errors near
    measured poses with held-out errors, at the 1 % level. The exit code is 0 where it passes, 1
    where it fails and 3 where it is undecided.

    \b
    Example:
      kinacc verify today.csv --calibration results/tracker --base same --tool same
      kinacc verify ur10_d.yaml --calibration results/ur10_b --base moved --tool moved --json
    """
    import warnings

    from kinacc.deployment import folder as results
    from kinacc.deployment import verify as verification
    from kinacc.errors import InputError, Problem
    from kinacc.progress import reporting
    from kinacc.synthetic import source

    moved = [name for name, how in (("base", base), ("tool", tool)) if how == "moved"]
    name, config = _settings(readings, folder, dataset)
    tables = results.read_tables(folder, "pose_errors")
    arm = choice.robot_of(folder, config["robot"], ())
    weight = float(config["calibration"]["rotation_weight_mm_per_rad"])
    with reporting("verify", bar=True), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            columns = source.run({}, config)["measurements"]
        except InputError as error:
            if readings.suffix.lower() in _YAML:
                raise
            message = "cannot be read as the readings of the calibration were"
            fix = f"if it has another form: run kinacc init {readings} first, and give the .yaml"
            raise InputError([Problem(str(readings), message, fix=fix), *error.problems]) from None
        result = verification.verify(tables, arm, columns, moved, weight)
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        click.echo(f"{name}: {text}", err=True)
    units = ["mm" if slides else "mrad" for slides in arm.dh.prismatic]
    shown = result.errors if out.verbose else result.errors.drop(columns=[*_DETAILS])
    again = ["kinacc", "verify", str(readings), "--calibration", folder]
    again += ["--dataset", dataset] if dataset else []
    again += ["--base", "moved", "--tool", "moved"]
    lines = [*_lines(result, units), *_next(result, folder, "" if moved else shlex.join(again))]
    out.show(result, result.errors, lines, shown)
    if result.verdict != verification.PASS:
        raise SystemExit(AGAINST if result.verdict == verification.FAIL else UNDECIDED)


def _settings(readings: Path, folder: str, dataset: str | None) -> tuple[str, Mapping]:
    """Name and settings of the new readings: those of a .yaml, or of the calibration."""
    from kinacc.checks.contradictions import load
    from kinacc.errors import InputError, Problem
    from kinacc.workflow.described import like_those_of

    if readings.suffix.lower() not in _YAML:
        return readings.stem, like_those_of(Path(folder), readings)
    settings = load([str(readings)])
    name = next(iter(settings)) if dataset is None and len(settings) == 1 else dataset
    if name not in settings:
        message = f"{dataset!r} is none of its data sets" if dataset else "is not given"
        raise InputError(Problem("--dataset", message, ", ".join(settings)))
    return name, settings[name]


def _lines(result: Verification, units: list[str]) -> Iterator[str]:
    import numpy as np

    from kinacc.config.error_models import model_name
    from kinacc.deployment.permutation import LEVEL
    from kinacc.report.rendering import size

    test, offsets = result.test, result.smallest_offsets
    if test is None or offsets is None:
        yield f"UNDECIDED: {result.reason}."
    else:
        p = "p > 0.99" if test.probability > 0.99 else f"p = {test.probability:.2g}"
        p = f"at the {100.0 * LEVEL:g} % level ({p})"
        finite = np.where(np.isfinite(offsets), offsets, -1.0)
        worst, hidden = int(np.argmax(finite)), np.flatnonzero(np.isinf(offsets)) + 1
        if result.verdict == "pass":
            yield f"PASS: no change detected {p}."
        elif result.verdict == "fail":
            change = f"joint {test.joint} off by {size(test.offset)} {units[test.joint - 1]}"
            yield f"FAIL: change detected {p}. Most like {change}."
        else:
            yield f"UNDECIDED: {result.reason}."
        yield (
            f"Would be detected in 80 % of cases: errors {size(result.smallest_factor)} times as "
            f"large; joint {worst + 1} off by {size(finite[worst])} {units[worst]}"
            + (f" (not joint {', '.join(map(str, hidden))})." if len(hidden) else ".")
        )
        yield (
            f"{model_name(result.model)}, rms position error of {result.here.configurations} "
            f"configurations: {size(test.rms_mm)} mm. Limit: {size(test.limit_mm)} mm (random "
            f"held-out samples: median {size(test.expected_mm)} mm)."
        )
    left_out = f", {result.known} known to the calibration left out" if result.known else ""
    yield f"Readings near measured poses: {result.near} of {result.readings}{left_out}."


def _next(result: Verification, folder: str, again: str) -> Iterator[str]:
    """The next step, and its command: ``again``, the test with base and tool fitted, or poses."""
    from kinacc.deployment.verify import FAIL, PASS, SET_UP_MOVED

    if again and (result.verdict == FAIL or result.reason == SET_UP_MOVED):
        yield f"Next: test the arm alone, base and tool fitted: {again}"
    elif result.verdict != PASS:
        poses = shlex.join(["kinacc", "show", folder, "measurements", "-o", "poses.csv"])
        yield f"Next: measure more poses of the calibration: {poses}"
