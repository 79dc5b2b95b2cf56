"""``kinacc verify``: a calibration held to readings that it was not fitted to."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from kinacc.cli import choice
from kinacc.cli.output import answers

if TYPE_CHECKING:
    import numpy as np

    from kinacc.calibration.observations import Observations
    from kinacc.cli.sheet import Sheet
    from kinacc.deployment.verify import Level, Trial, Verdict

_FAR_MM = 10.0


@click.command("verify")
@click.argument("folder", type=click.Path())
@click.argument("files", nargs=-1, required=True, type=click.Path(), metavar="FILE.yaml...")
@click.option(
    "--base-and-tool",
    type=choice.values_of("calibration.base_and_tool"),
    help="As they were fitted, or fitted anew to these readings.  [required]",
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

    The verdict is on the selected model where the calibration was measured: whether its mean error
    there is that of its held-out poses, by the 99 % interval of the difference. It is no bound on
    the largest error.

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
    from kinacc.deployment.verify import OPEN, verdict, with_frames_fitted, with_kept_frames
    from kinacc.progress import reporting
    from kinacc.workflow.stages import measurements

    _require_choice(base_and_tool)
    name, config = _section(files, dataset)
    tables = results.read_tables(folder, "pose_errors")
    arm = choice.robot_of(folder, config["robot"], ())
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
        found = verdict(tables, selected, trials, seen, there)
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
    if shared:
        found = replace(found, says=OPEN, reason="some are among those it was fitted to")
    elif base_and_tool == "fixed" and _far_off(trials):
        found = replace(found, says=OPEN, reason="instrument or tool stands elsewhere")
    step, command = _next(found, base_and_tool, folder, files, dataset)
    facts |= _of_verdict(found) | {
        "worse_than_nominal": [
            {"model": kind, "readings": count, "mean_mm": mean, "nominal_mean_mm": plain}
            for kind, count, mean, plain in _worse_than_nominal(trials)
        ],
        "next_step": step,
        "next": command,
    }
    out.deliver(_sheet(facts, trials), _in_words(facts, trials, found))


def _require_choice(base_and_tool: str | None) -> None:
    """InputError, with how to choose, where nothing is said of base and tool."""
    from kinacc.errors import InputError, Problem

    if base_and_tool is None:
        fix = (
            "give fixed where instrument and tool stand as they did when the calibration was "
            "measured, estimated where either stands anew: both are then fitted to these readings"
        )
        what = "is not given, and only you know whether something was moved"
        raise InputError(Problem("--base-and-tool", what, fix=fix))


def _of_verdict(found: Verdict) -> dict[str, object]:
    """The verdict as facts."""
    from kinacc.deployment.verify import AS_GOOD, CONFIDENCE, LEAST

    return {
        "verdict": found.says,
        "verdict_reason": found.reason,
        "here": found.here and found.here._asdict(),
        "held_out": found.held_out and found.held_out._asdict(),
        "difference_mm": found.difference_mm,
        "difference_low_mm": found.low_mm,
        "difference_high_mm": found.high_mm,
        "difference_confidence": CONFIDENCE,
        "as_good_up_to": AS_GOOD,
        "least_configurations": LEAST,
    }


def _next(
    found: Verdict, base_and_tool: str, folder: str, files: Sequence[str], dataset: str | None
) -> tuple[str, str]:
    """What to do after a verdict, and the command for it."""
    from kinacc.deployment.verify import ENOUGH, GOOD, LEAST, OPEN

    more = [] if dataset is None else ["--dataset", dataset]
    anew = shlex.join(["kinacc", "verify", folder, *files, *more, "--base-and-tool", "estimated"])
    again = shlex.join(["kinacc", "calibrate", *files])
    poses = shlex.join(["kinacc", "show", f"{folder}/measurements", "--columns", "pose,q*"])
    if found.says == GOOD:
        return "the calibration can be used on", shlex.join(["kinacc", "fitted", folder])
    if found.says == OPEN:
        if found.reason.startswith("instrument"):
            return "fit base and tool to these readings", anew
        if found.reason.startswith("too few held-out"):
            step = "calibrate with folds (measurements.folds) and enough poses to hold some out"
            return step, shlex.join(["kinacc", "fitted", folder])
        step = (
            f"measure {ENOUGH} new configurations near those of the calibration, {LEAST} at least"
        )
        if found.reason.startswith("the difference"):
            step = f"measure {ENOUGH} new configurations or more near those of the calibration"
        return f"{step}, and verify again; this lists those", poses
    if base_and_tool == "fixed":
        return "see whether the arm has changed, or only instrument or tool was moved", anew
    return "calibrate anew with these readings", again


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
                    "all readings" if trial.rows.all() else "covered by all models",
                    len(position),
                    *_statistics(position, LARGE_SHARE),
                    *_statistics(turn, LARGE_SHARE),
                )
            )
    columns = [np.array(each, dtype=object) for each in zip(*rows, strict=True)] or [[]] * 11
    mm, mrad = "of position errors", "of orientation errors"
    meanings = [
        ("model", "", "what was held to the readings"),
        ("at", "", "which readings: all, or those where every model says something"),
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
    turned = bool(len(rows)) and any(np.isfinite(row[7]) for row in rows)
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


def _worse_than_nominal(trials: Sequence[Trial]) -> Iterator[tuple[str, int, float, float]]:
    """Models that are off by more than the nominal arm, in the largest trial they are part of.

    Name, number of readings, its mean and that of the nominal arm in mm.
    """
    from kinacc.artifacts.error_models import NOMINAL, model_name

    largest = {kind: each for each in trials for kind in each.errors}
    for kind, trial in largest.items():
        mean, plain = (_sizes(trial.errors[of].position_mm) for of in (kind, NOMINAL))
        if len(mean) and mean.mean() > plain.mean():
            yield model_name(kind), len(mean), float(mean.mean()), float(plain.mean())


def _in_words(facts: Mapping, trials: Sequence[Trial], found: Verdict) -> str:
    """Where the readings lie, whether the calibration holds there, and what to do next."""
    from kinacc.artifacts.error_models import model_name

    count, selected = facts["readings"], facts["selected"]
    lines = [
        f"{facts['like_measured']} of {count} readings lie where the calibration was measured; "
        "errors elsewhere may be larger than those held out"
    ]
    if facts["base_and_tool"] == "fixed":
        lines.append(
            "base and tool are those of the calibration; nothing was fitted to these readings"
        )
    else:
        lines.append(
            f"base and tool were fitted to these readings, {facts['numbers_fitted']} numbers for "
            "each model, and judged at readings held out of that; the arm was not touched"
        )
    said = max((int(each.rows.sum()) for each in trials if selected in each.errors), default=0)
    if said < count:
        lines.append(
            f"{model_name(selected)}, the selected model, says nothing at {count - said} of "
            f"{count} readings: their joints lie outside the range it was fitted in"
        )
    else:
        lines.append(f"{model_name(selected)} is the selected model")
    for name, number, mean, plain in _worse_than_nominal(trials):
        lines.append(
            f"{name} is worse than the nominal arm at {number} readings: mean {mean:.4g} mm, "
            f"nominal {plain:.4g} mm"
        )
    if found.reason.startswith("instrument"):
        lines.append(
            "every model is off by centimetres or more: the instrument or the tool stands "
            "elsewhere than it did; --base-and-tool estimated fits both anew"
        )
    if facts["shared_readings"]:
        lines.append(
            f"{facts['shared_readings']} of these readings are among those it was fitted to: they "
            "say nothing of new ones"
        )
    lines.append(
        f"{model_name(selected)} where it was measured: {_level(found.here)}; at its held-out "
        f"poses: {_level(found.held_out)}"
    )
    lines += [_verdict(found), f"next: {facts['next_step']}", f"  {facts['next']}"]
    return "\n".join(lines)


def _level(level: Level | None) -> str:
    """How large the errors are, in words."""
    if level is None:
        return "no errors known"
    return (
        f"mean {level.mean_mm:.4g} mm, 99 % at most {level.quantile_99_mm:.4g} mm "
        f"({level.readings} readings of {level.configurations} configurations)"
    )


def _verdict(found: Verdict) -> str:
    """The verdict as one sentence."""
    from kinacc.deployment.verify import AS_GOOD, GOOD, LEAST, OPEN

    interval = f"the mean differs by {found.low_mm:+.3g} to {found.high_mm:+.3g} mm (99 % interval)"
    if found.says == GOOD:
        return (
            "verdict: as good as at its held-out poses, where it was measured: "
            f"{interval}, less than {100 * AS_GOOD:.0f} % more"
        )
    if found.says == OPEN:
        needed = (
            f"; {LEAST} configurations are needed" if found.reason.startswith("too few") else ""
        )
        uncertain = f", {interval}" if found.reason.startswith("the difference") else ""
        reason = f"{found.reason}{uncertain}{needed}"
        return f"verdict: cannot be told from these readings: {reason}"
    share = found.difference_mm / found.held_out.mean_mm
    return (
        f"verdict: worse by {found.difference_mm:.3g} mm ({100 * share:.0f} %) than at its "
        f"held-out poses: {interval}"
    )
