"""``kinacc verify``: a calibration held to readings that it was not fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.output import answers

if TYPE_CHECKING:
    import numpy as np

    from kinacc.calibration.observations import Observations
    from kinacc.cli.sheet import Sheet
    from kinacc.deployment.verify import Trial

_FAR_MM = 10.0


@click.command("verify")
@click.argument("folder", type=click.Path())
@click.argument("files", nargs=-1, required=True, type=click.Path(), metavar="FILE.yaml...")
@click.option(
    "--base-and-tool",
    type=click.Choice(["fixed", "estimated"]),
    required=True,
    help="As they were fitted, or fitted anew to these readings.",
)
@click.option("--dataset", help="Data set of the files. [the only one]")
@answers(table=True)
def verify(folder, files, base_and_tool, dataset, out) -> None:
    """Hold a calibration to readings that it was not fitted to, and say how far it is off.

    FOLDER is the results folder of a data set, FILE.yaml what `kinacc init` wrote of the other
    readings, of the same arm. With --base-and-tool fixed nothing is fitted to them: right where
    instrument and tool stand as they did. Where either stands anew, estimated fits base and tool
    (twelve numbers, of positions alone nine) to these readings, for every model its own, and judges
    it at the shares of the readings that were held out of that; the arm is not touched. All models
    are compared at the same readings: those where each says something.

    \b
    Example:
      kinacc verify results/ur10_b ur10_d.yaml --base-and-tool estimated
      kinacc verify results/monday tuesday.yaml --base-and-tool fixed --json
    """
    import warnings

    import numpy as np

    from kinacc.calibration.observations import from_columns
    from kinacc.deployment import folder as results
    from kinacc.deployment import shared_readings
    from kinacc.deployment.applicability import is_measured_there
    from kinacc.deployment.verify import with_frames_fitted, with_kept_frames
    from kinacc.progress import reporting
    from kinacc.workflow.stages import measurements

    name, config = _section(files, dataset)
    tables, arm = results.read_tables(folder), choice.robot_of(folder, config["robot"], ())
    with reporting("verify", bar=True), warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        columns = measurements.run({}, config)["measurements"]
        seen = from_columns(columns, arm)
        if base_and_tool == "fixed":
            trials = with_kept_frames(tables, arm, seen)
        else:
            weight = float(config["calibration"]["rotation_weight_mm_per_rad"])
            trials = with_frames_fitted(tables, arm, seen, weight)
        selected = results.selected_model(tables)
        known = results.calibration(tables, arm, selected)
        point = next((each for each in seen.target_names if each in known.targets), None)
        there = is_measured_there(known, seen.at, point)
    for each in dict.fromkeys(str(warning.message) for warning in said):
        click.echo(f"{name}: {each}", err=True)
    shared = 0
    if "measurements" in tables:
        shared = shared_readings.shared(tables["measurements"], columns, False).count
    facts = {
        "calibration": str(folder),
        "readings_of": name,
        "readings": len(seen),
        "base_and_tool": base_and_tool,
        "numbers_fitted": 0 if base_and_tool == "fixed" else _numbers(seen),
        "selected": selected,
        "shared_readings": shared,
        "like_measured": int(np.sum(there)),
    }
    out.deliver(_sheet(facts, trials), _in_words(facts, trials))


def _section(files: Sequence[str], dataset: str | None) -> tuple[str, Mapping]:
    """Name and configuration of the data set that is meant. InputError where none or several is."""
    from kinacc.errors import InputError, Problem
    from kinacc.workflow.contradictions import load

    full = load(files)
    if dataset is not None and dataset not in full:
        raise InputError(Problem("--dataset", f"{dataset!r} is not there", ", ".join(full)))
    if dataset is None and len(full) > 1:
        what = f"is not given, and {', '.join(files)} describe several"
        raise InputError(Problem("--dataset", what, ", ".join(full)))
    name = dataset or next(iter(full))
    return name, full[name]


def _numbers(seen: Observations) -> int:
    """How many numbers base and tool of a single model are."""
    import numpy as np

    turned = np.unique(seen.target[seen.has_rotation])
    return 6 * len(seen.session_names) + 3 * len(seen.target_names) + 3 * len(turned)


def _sheet(facts: Mapping, trials: Sequence[Trial]) -> Sheet:
    """One row for each model and set of readings."""
    import numpy as np

    from kinacc.artifacts.error_models import ERROR_MODELS, NOMINAL, model_name
    from kinacc.calibration.summary import LARGE_SHARE
    from kinacc.cli.sheet import Field, Sheet

    order = (NOMINAL, *ERROR_MODELS)
    rows = []
    for trial in trials:
        for kind in sorted(trial.errors, key=order.index):
            found = trial.errors[kind]
            position = _sizes(found.position_mm)
            turn = 1e3 * _sizes(found.rotation_rad)
            rows.append(
                (
                    model_name(kind),
                    len(position),
                    *_statistics(position, LARGE_SHARE),
                    *_statistics(turn, LARGE_SHARE),
                )
            )
    columns = [np.array(each, dtype=object) for each in zip(*rows, strict=True)] or [[]] * 10
    mm, mrad = "of position errors", "of orientation errors"
    meanings = [
        ("model", "", "what was held to the readings"),
        ("readings", "1", "that it was held to"),
        ("mean_mm", "mm", mm),
        ("quantile_99_mm", "mm", f"{mm}: 99 % are no larger"),
        ("largest_mm", "mm", mm),
        ("rms_mm", "mm", mm),
        ("mean_mrad", "mrad", mrad),
        ("quantile_99_mrad", "mrad", f"{mrad}: 99 % are no larger"),
        ("largest_mrad", "mrad", mrad),
        ("rms_mrad", "mrad", mrad),
    ]
    turned = bool(len(rows)) and any(np.isfinite(row[6]) for row in rows)
    fields = [
        Field(label, values, unit, meaning, unit != "mrad" or turned)
        for (label, unit, meaning), values in zip(meanings, columns, strict=True)
    ]
    title = f"{facts['calibration']} at readings of {facts['readings_of']}"
    return Sheet(title, facts, fields)


def _far_off(trials: Sequence[Trial]) -> bool:
    """Whether no model comes near: what differs is no error of an arm."""
    means = [_sizes(found.position_mm).mean() for each in trials for found in each.errors.values()]
    return bool(means) and min(means) > _FAR_MM


def _sizes(vectors: np.ndarray) -> np.ndarray:
    """Magnitudes of the finite ones of ``vectors`` (n, 3)."""
    import numpy as np

    sizes = np.linalg.norm(vectors, axis=1)
    return sizes[np.isfinite(sizes)]


def _statistics(sizes: np.ndarray, share: float) -> tuple[float, float, float, float]:
    """Mean, quantile, largest and rms; NaN of none."""
    import numpy as np

    if not len(sizes):
        return (np.nan,) * 4
    rms = float(np.sqrt(np.mean(sizes**2)))
    return float(sizes.mean()), float(np.quantile(sizes, share)), float(sizes.max()), rms


def _in_words(facts: Mapping, trials: Sequence[Trial]) -> str:
    """What the figures are of, in sentences."""
    from kinacc.artifacts.error_models import model_name

    count, selected = facts["readings"], facts["selected"]
    if facts["base_and_tool"] == "fixed":
        lines = ["base and tool are those of the calibration; nothing was fitted to these readings"]
    else:
        lines = [
            f"base and tool were fitted to these readings, {facts['numbers_fitted']} numbers for "
            "each model, and judged at readings held out of that; the arm was not touched"
        ]
    said = max((int(each.rows.sum()) for each in trials if selected in each.errors), default=0)
    if said < count:
        lines.append(
            f"{model_name(selected)}, the selected model, says nothing at {count - said} of "
            f"{count} readings: their joints lie outside the range it was fitted in"
        )
    else:
        lines.append(f"{model_name(selected)} is the selected model")
    lines.append(
        f"{facts['like_measured']} of {count} readings lie where the calibration was measured; "
        "errors elsewhere may be larger than those held out"
    )
    if facts["base_and_tool"] == "fixed" and _far_off(trials):
        lines.append(
            "every model is off by centimetres or more: the instrument or the tool stands "
            "elsewhere than it did; --base-and-tool estimated fits both anew"
        )
    if facts["shared_readings"]:
        lines.append(
            f"{facts['shared_readings']} of these readings are among those it was fitted to: they "
            "say nothing of new ones"
        )
    return "\n".join(lines)
