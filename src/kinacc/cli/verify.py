"""``kinacc verify``: a calibration held to readings that it was not fitted to."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.exit_codes import AGAINST
from kinacc.cli.output import answers

if TYPE_CHECKING:
    from kinacc.cli.sheet import Sheet
    from kinacc.deployment.verify import Verification

_SETUP = click.Choice(["same", "moved"])
_DESCRIPTIONS = (".yaml", ".yml")


@click.command("verify")
@click.argument("readings", type=click.Path(), metavar="NEW")
@click.option("--calibration", "folder", type=click.Path(), help="Its results folder.  [required]")
@click.option("--base", type=_SETUP, help="Whether the instrument was moved.  [required]")
@click.option("--tool", type=_SETUP, help="Whether the target or tool was moved.  [required]")
@click.option("--dataset", help="Data set that is meant, where NEW is a .yaml. [the only one]")
@answers(table=True)
def verify(readings, folder, base, tool, dataset, out) -> None:
    """Hold a calibration to a few poses that it was not fitted to: does it still hold?

    NEW is a file of readings in the form of those of the calibration, whose configuration is looked
    for beside the results; or a .yaml that `kinacc init` wrote of readings in another form. Measure
    5 to 15 configurations, spread as those of the calibration are.

    What was moved is fitted anew to the readings (base 6 numbers, tool 3 or 6), for every model its
    own. The verdict is on the selected model, by positions where the calibration was measured: it
    fails where a permutation test finds the errors larger than held-out ones, or more like offsets
    of joints, at the 1 % level; it passes otherwise; it cannot be told where so few poses would not
    show errors doubled. It is no bound on the largest error. Exit code 1: it fails, or cannot be
    told.

    \b
    Example:
      kinacc verify today.csv --calibration results/tracker --base same --tool same
      kinacc verify ur10_d.yaml --calibration results/ur10_b --base moved --tool moved --json
    """
    import warnings

    from kinacc.deployment import folder as results
    from kinacc.deployment.verify import BASE, PASSES, TOOL
    from kinacc.deployment.verify import verify as verified
    from kinacc.progress import reporting
    from kinacc.synthetic import source

    _require_choices(folder, base, tool)
    moved = [name for name, kind in ((BASE, base), (TOOL, tool)) if kind == "moved"]
    name, config = _settings(readings, folder, dataset)
    tables = results.read_tables(folder, "pose_errors")
    arm = choice.robot_of(folder, config["robot"], ())
    weight = float(config["calibration"]["rotation_weight_mm_per_rad"])
    with reporting("verify", bar=True), warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        columns = source.run({}, config)["measurements"]
        found = verified(tables, arm, columns, moved, weight)
    for each in dict.fromkeys(str(warning.message) for warning in said):
        click.echo(f"{name}: {each}", err=True)
    step, command = _next(found, readings, folder, dataset, moved)
    units = ["mm" if slides else "mrad" for slides in arm.dh.prismatic]
    facts = {
        "calibration": str(folder),
        "readings_of": name,
        "readings": found.readings,
        "base": base,
        "tool": tool,
        "selected": found.model,
        "shared_readings": found.known,
        "like_measured": found.near,
        "verdict": found.verdict,
        "verdict_reason": found.reason,
        "here": found.here and found.here._asdict(),
        "held_out": found.held_out and found.held_out._asdict(),
        "test": found.held and found.held._asdict(),
        "smallest_factor": found.smallest_factor,
        "smallest_offsets": None if found.smallest_offsets is None else [*found.smallest_offsets],
        "next_step": step,
        "next": command,
    }
    out.deliver(
        _sheet(facts, found), "\n".join([*_lines(found, units), f"next: {step}", f"  {command}"])
    )
    if found.verdict != PASSES:
        raise SystemExit(AGAINST)


def _require_choices(folder: str | None, base: str | None, tool: str | None) -> None:
    """InputError, with how to choose, where the calibration or what was moved is not given."""
    from kinacc.errors import Problem, refuse

    fix = (
        "give same where it stands as it did when the calibration was measured, moved where it "
        "stands anew: it is then fitted to these readings"
    )
    what = "is not given, and only you know whether it was moved"
    options = ("--base (the instrument)", base), ("--tool (the tool or target)", tool)
    problems = [Problem(option, what, fix=fix) for option, given in options if given is None]
    if folder is None:
        fix = "give the results folder that the readings are held to, such as results/tracker"
        problems.insert(0, Problem("--calibration", "is not given", fix=fix))
    refuse(problems)


def _settings(readings: str, folder: str, dataset: str | None) -> tuple[str, Mapping]:
    """Name and settings of the new readings: as described, or as those of the calibration."""
    from pathlib import Path

    from kinacc.workflow.described import like_those_of

    path = Path(readings)
    if path.suffix.lower() in _DESCRIPTIONS:
        return _section([readings], dataset)
    return path.stem, like_those_of(Path(folder), path)


def _next(
    found: Verification, readings: str, folder: str, dataset: str | None, moved: Sequence[str]
) -> tuple[str, str]:
    """What to do after a verdict, and the command for it."""
    from kinacc.deployment.verify import ELSEWHERE, FEW_HELD_OUT, OPEN, PASSES

    words = ["kinacc", "verify", readings, "--calibration", folder]
    words += [] if dataset is None else ["--dataset", dataset]
    anew = shlex.join([*words, "--base", "moved", "--tool", "moved"])
    fitted = shlex.join(["kinacc", "summary", folder])
    poses = shlex.join(["kinacc", "show", f"{folder}/measurements", "--columns", "pose,q*"])
    if found.verdict == PASSES:
        return "keep using the calibration", fitted
    if found.reason == ELSEWHERE:
        return "fit base and tool to these readings", anew
    if found.reason == FEW_HELD_OUT:
        return "calibrate with folds (measurements.folds) and more poses", fitted
    if found.verdict == OPEN:
        return "measure more new configurations near those of the calibration, listed here", poses
    if not moved:
        return "see whether the arm has changed, or only instrument or tool was moved", anew
    return "measure as many poses as those of the calibration anew, and calibrate", poses


def _section(files: Sequence[str], dataset: str | None) -> tuple[str, Mapping]:
    """Name and configuration of the data set that is meant. InputError where none or several is."""
    from kinacc.checks.contradictions import load
    from kinacc.errors import InputError, Problem

    full = load(files)
    if dataset is not None and dataset not in full:
        raise InputError(Problem("--dataset", f"{dataset!r} is not there", ", ".join(full)))
    if dataset is None and len(full) > 1:
        what = f"is not given, and {', '.join(files)} describe several"
        raise InputError(Problem("--dataset", what, ", ".join(full)))
    name = dataset or next(iter(full))
    return name, full[name]


def _sheet(facts: Mapping, found: Verification) -> Sheet:
    """One row for each model and set of readings."""
    from kinacc.cli.sheet import Field, Sheet
    from kinacc.config.error_models import model_name

    table = found.errors.assign(model=found.errors["model"].map(model_name))
    turned = bool(table["mean_mrad"].notna().any())
    meanings = {
        "model": ("", "what was held to the readings"),
        "at": ("", "which readings: all, or those that all models cover"),
        "readings": ("1", "that it was held to"),
    }
    fields = []
    for name in table.columns:
        unit = name.rpartition("_")[2]
        unit, meaning = meanings.get(name, (unit, f"errors of the model, {name}"))
        values = table[name].to_numpy()
        fields.append(Field(name, values, unit, meaning, unit != "mrad" or turned))
    title = f"{facts['calibration']} at readings of {facts['readings_of']}"
    return Sheet(title, facts, fields)


def _lines(found: Verification, units: Sequence[str]) -> Iterator[str]:
    """The verdict first, what it rests on, and what else the readings show."""
    import numpy as np

    from kinacc.config.error_models import NOMINAL, model_name
    from kinacc.deployment.permutation import LEVEL
    from kinacc.deployment.verify import FAILS, PASSES

    held, selected = found.held, model_name(found.model)
    if held is None or found.verdict not in (PASSES, FAILS):
        yield f"CANNOT BE TOLD: {found.reason}"
    elif found.verdict == PASSES:
        yield f"PASSES: no change detected at the {LEVEL:.0%} level (p = {held.probability:.2g})"
    else:
        yield (
            f"FAILS: a change is detected at the {LEVEL:.0%} level (p = {held.probability:.2g}); "
            f"the errors look most like joint {held.joint} off by {held.offset:+.2g} "
            f"{units[held.joint - 1]}"
        )
    if held is not None:
        yield (
            f"{selected}, rms position error of {found.here.configurations} configurations: "
            f"{held.rms_mm:.3g} mm; held out {held.expected_mm:.3g} mm, 99 % of random samples at "
            f"most {held.limit_mm:.3g} mm"
        )
        offsets = found.smallest_offsets
        hidden = ", ".join(str(joint) for joint in np.flatnonzero(np.isinf(offsets)) + 1)
        worst = int(np.argmax(np.where(np.isinf(offsets), -1.0, offsets)))
        yield (
            f"found in at least 80 % of cases: errors {found.smallest_factor:.2g} times as large; "
            f"joint {worst + 1} off by {offsets[worst]:.2g} {units[worst]}, the others by less"
            f"{hidden and f' (not joint {hidden})'}"
        )
    if found.known:
        yield f"{found.known} of {found.readings} readings are known to the calibration: left out"
    yield f"{found.near} of {found.readings} readings lie where the calibration was measured"
    largest = found.errors.groupby("model")["readings"].max()
    for _, row in found.errors.iterrows():
        own = found.errors[(found.errors["at"] == row["at"]) & (found.errors["model"] == NOMINAL)]
        plain = float(own["mean_mm"].iloc[0])
        if row["mean_mm"] > plain and row["readings"] == largest[row["model"]]:
            yield (
                f"{model_name(row['model'])} is worse than the nominal arm at {row['readings']} "
                f"readings: mean {row['mean_mm']:.3g} mm, nominal {plain:.3g} mm"
            )
