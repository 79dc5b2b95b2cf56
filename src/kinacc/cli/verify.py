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
    import numpy as np

    from kinacc.calibration.observations import Observations
    from kinacc.cli.sheet import Sheet
    from kinacc.deployment.verify import Seen, Trial, Verdict

_FAR_MM = 10.0
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
    for beside the results; or a .yaml that `kinacc init` wrote of readings in another form. 5 to 15
    poses, spread as those of the calibration are, tell large changes; what they tell is said, and
    what more would.

    What was moved is fitted anew to the readings (base 6 numbers, tool 3 or 6), for every model its
    own, and so it is to the held-out poses that they are compared with. The arm is not touched. The
    verdict is on the selected model where the calibration was measured: it fails where errors are
    as large, or look as much like offsets of joints, as in 1 % of such handfuls where nothing has
    changed; passes otherwise; and cannot be told where fewer poses than show errors doubled are no
    worse. It goes by positions; where base or tool was moved, by measured orientations too. It is
    no bound on the largest error. Exit code 1: it fails, or cannot be told.

    \b
    Example:
      kinacc verify today.csv --calibration results/tracker --base same --tool same
      kinacc verify ur10_d.yaml --calibration results/ur10_b --base moved --tool moved --json
    """
    import warnings

    import numpy as np

    from kinacc.calibration.observations import from_columns
    from kinacc.deployment import folder as results
    from kinacc.deployment import shared_readings
    from kinacc.deployment.applicability import is_measured_there
    from kinacc.deployment.verify import BASE, OPEN, PASSES, TOOL, Verdict, trials, verdict
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
        seen = from_columns(columns, arm)
        tried = trials(tables, arm, seen, moved, weight)
        selected = results.selected_model(tables)
        known = results.calibration(tables, arm, selected)
        point = next((each for each in seen.target_names if each in known.targets), None)
        there = is_measured_there(known, seen.at, point)
        shared = 0
        if "measurements" in tables:
            shared = shared_readings.shared(tables["measurements"], columns, False).count
        if shared:
            found = Verdict(OPEN, _FITTED)
        elif not moved and _far_off(tried):
            found = Verdict(OPEN, _ELSEWHERE)
        else:
            found = verdict(tables, arm, selected, seen, there, moved, weight)
    for each in dict.fromkeys(str(warning.message) for warning in said):
        click.echo(f"{name}: {each}", err=True)
    facts = {
        "calibration": str(folder),
        "readings_of": name,
        "readings": len(seen),
        "base": base,
        "tool": tool,
        "numbers_fitted": _numbers(seen, moved),
        "selected": selected,
        "shared_readings": shared,
        "like_measured": int(np.sum(there)),
    }
    step, command = _next(found, readings, folder, dataset, moved)
    facts |= _of_verdict(found) | {
        "worse_than_nominal": [
            {"model": kind, "readings": count, "mean_mm": mean, "nominal_mean_mm": plain}
            for kind, count, mean, plain in _worse_than_nominal(tried)
        ],
        "next_step": step,
        "next": command,
    }
    units = ["mm" if slides else "mrad" for slides in arm.dh.prismatic]
    out.deliver(_sheet(facts, tried), _in_words(facts, tried, found, moved, units))
    if found.says != PASSES:
        raise SystemExit(AGAINST)


_FITTED = "some are among those it was fitted to"
_ELSEWHERE = "instrument or tool stands elsewhere"


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


def _of_verdict(found: Verdict) -> dict[str, object]:
    """The verdict as facts."""
    from kinacc.deployment.handful import LEVEL, POWER

    held = found.held
    return {
        "verdict": found.says,
        "verdict_reason": found.reason,
        "level": LEVEL,
        "power": POWER,
        "here": found.here and found.here._asdict(),
        "held_out": found.held_out and found.held_out._asdict(),
        "expected_mean_mm": held and held.expected_mm,
        "limit_mm": held and held.limit_mm,
        "offsets_mm": held and held.offsets_mm,
        "offsets_limit_mm": held and held.offsets_limit_mm,
        "most_like_offset_of_joint": held and held.joint,
        "most_like_offset": held and held.offset,
        "probability": held and held.probability,
        "least_configurations": found.least,
        "seen": found.seen and _of_seen(found.seen),
        "seen_with": [_of_seen(each) for each in found.table],
    }


def _of_seen(seen: Seen) -> dict[str, object]:
    """What poses show, as facts: null what they do not."""
    return {
        "poses": seen.poses,
        "errors_times": seen.factor,
        "offsets_of_joints": [float(each) for each in seen.joints],
    }


def _next(
    found: Verdict, readings: str, folder: str, dataset: str | None, moved: Sequence[str]
) -> tuple[str, str]:
    """What to do after a verdict, and the command for it."""
    from kinacc.deployment.verify import FEW_HELD_OUT, OPEN, PASSES

    words = ["kinacc", "verify", readings, "--calibration", folder]
    words += [] if dataset is None else ["--dataset", dataset]
    anew = shlex.join([*words, "--base", "moved", "--tool", "moved"])
    fitted = shlex.join(["kinacc", "summary", folder])
    poses = shlex.join(["kinacc", "show", f"{folder}/measurements", "--columns", "pose,q*"])
    if found.says == PASSES:
        return "the calibration can be used on", fitted
    if found.says != OPEN:
        if not moved:
            step = "see whether the arm has changed, or only instrument or tool was moved"
            return step, anew
        return "measure as many poses as those of the calibration anew, and calibrate", poses
    if found.reason == _ELSEWHERE:
        return "fit base and tool to these readings", anew
    if found.reason == FEW_HELD_OUT:
        step = "calibrate with folds (measurements.folds) and enough poses to hold some out"
        return step, fitted
    some = "more" if found.least is None else f"{found.least} or more"
    step = f"measure {some} new configurations near those of the calibration, and verify again"
    return f"{step}; this lists those", poses


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


def _numbers(seen: Observations, moved: Sequence[str]) -> int:
    """How many numbers what was moved is, of a single model."""
    import numpy as np

    from kinacc.deployment.verify import BASE, TOOL

    turned = np.unique(seen.target[seen.has_rotation])
    base = 6 * len(seen.session_names) if BASE in moved else 0
    return base + (3 * len(seen.target_names) + 3 * len(turned) if TOOL in moved else 0)


def _sheet(facts: Mapping, trials: Sequence[Trial]) -> Sheet:
    """One row for each model and set of readings."""
    import numpy as np

    from kinacc.calibration.summary import LARGE_SHARE
    from kinacc.cli.sheet import Field, Sheet
    from kinacc.config.error_models import ERROR_MODELS, NOMINAL, model_name

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
    from kinacc.config.error_models import NOMINAL, model_name

    largest = {kind: each for each in trials for kind in each.errors}
    for kind, trial in largest.items():
        mean, plain = (_sizes(trial.errors[of].position_mm) for of in (kind, NOMINAL))
        if len(mean) and mean.mean() > plain.mean():
            yield model_name(kind), len(mean), float(mean.mean()), float(plain.mean())


def _in_words(
    facts: Mapping,
    tried: Sequence[Trial],
    found: Verdict,
    moved: Sequence[str],
    units: Sequence[str],
) -> str:
    """Where the readings lie, whether the calibration holds there, and what to do next."""
    from kinacc.config.error_models import model_name
    from kinacc.deployment.verify_words import of_verdict

    count, selected = facts["readings"], facts["selected"]
    lines = [
        f"{facts['like_measured']} of {count} readings lie where the calibration was measured; "
        "errors elsewhere may be larger than those held out"
    ]
    if moved:
        lines.append(
            f"{' and '.join(moved)} fitted to these readings: {facts['numbers_fitted']} numbers "
            "for each model, which take up a part of its errors; the arm was not touched"
        )
    else:
        lines.append(
            "base and tool are those of the calibration; nothing was fitted to these readings"
        )
    said = max((int(each.rows.sum()) for each in tried if selected in each.errors), default=0)
    if said < count:
        lines.append(
            f"{model_name(selected)}, the selected model, says nothing at {count - said} of "
            f"{count} readings: their joints lie outside the range it was fitted in"
        )
    else:
        lines.append(f"{model_name(selected)} is the selected model")
    for name, number, mean, plain in _worse_than_nominal(tried):
        lines.append(
            f"{name} is worse than the nominal arm at {number} readings: mean {mean:.4g} mm, "
            f"nominal {plain:.4g} mm"
        )
    if found.reason == _ELSEWHERE:
        lines.append(
            "every model is off by centimetres or more: the instrument or the tool stands "
            "elsewhere than it did; --base moved --tool moved fits both anew"
        )
    if facts["shared_readings"]:
        lines.append(
            f"{facts['shared_readings']} of these readings are among those it was fitted to: they "
            "say nothing of new ones"
        )
    lines += of_verdict(found, selected, moved, units)
    lines += [f"next: {facts['next_step']}", f"  {facts['next']}"]
    return "\n".join(lines)
