"""The accepted run: a copy of tables with who accepted them and why, and what changed since."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from kinacc import __version__
from kinacc.calibration.summary import selected
from kinacc.deployment import drift, folder
from kinacc.errors import FitError, InputError, Problem, first_few, refuse
from kinacc.gate import chance
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, WARNED, Outcome
from kinacc.gate.run_tables import RunTables, errors_of
from kinacc.measurements.folds import configurations_of
from kinacc.tables import store, sums
from kinacc.tables.atomic import unfinished, write_whole
from kinacc.tables.columns import Columns
from kinacc.tables.comparison import compare_tables
from kinacc.tables.history_tables import MOVED, OPEN, RECALIBRATE, SAME

NOTE = "accepted.json"
CONFIDENCE = 0.99
_SEED = 16
_FAR = 3.0  # standard deviations beyond which a parameter counts as moved


def accept(results: Path, folder: Path, datasets: Sequence[str], reason: str) -> dict:
    """Copy tables and digests of data sets to the folder of the accepted run, with a note.

    Raises InputError without a reason, or where the folder holds something else.
    """
    refuse([Problem("--reason", "is empty", "why this run is as it should be")]
           if not reason.strip() else [])  # fmt: skip
    if folder.exists() and any(folder.iterdir()) and not (folder / NOTE).is_file():
        what = f"holds no accepted run, and is not empty: {NOTE} is missing"
        raise InputError(Problem(str(folder), what, "a folder of its own"))
    for name in datasets:
        new, target = unfinished(folder / name), folder / name
        for path in sorted((results / name).rglob("*")):
            if path.suffix in (".parquet", ".sha256") or path.name == "SHA256SUMS":
                place = new / path.relative_to(results / name)
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path, place)
        shutil.rmtree(target, ignore_errors=True)
        os.replace(new, target)
    before = json.loads((folder / NOTE).read_text("utf-8")) if (folder / NOTE).is_file() else []
    note = {
        "reason": reason,
        "date": datetime.now(UTC).date().isoformat(),
        "by": os.environ.get("USER", ""),
        "kinacc_version": __version__,
        "datasets": list(datasets),
    }
    write_whole(folder / NOTE, (json.dumps([*before, note], indent=1) + "\n").encode())
    return note


def compared(now: Path, before: Path, rotation_weight_mm_per_rad: float) -> Iterator[Outcome]:
    """A data set beside the accepted one: equal tables where inputs are the same, else better,
    same, worse or undecided by held-out errors, whether the arm changed, and the parameters that
    moved.
    """
    if not (before / "measurements.parquet").is_file():
        says = f"there is no accepted run of {now.name} in {before.parent}"
        fix = f'kinacc check-results {now.parent} --accept {before.parent} --reason ".."'
        yield Outcome(now.name, "accepted run", "accepted", FAILED, says, fix)
        return
    same = _measured(now) == _measured(before)
    if same:
        yield _equal(now, before)
    else:
        yield _errors_beside(now, before)
        yield _arm_beside(now, before, rotation_weight_mm_per_rad)
        yield _parameters_beside(now, before)


def _measured(folder: Path) -> str | None:
    return sums.stated(folder).get("measurements.parquet")


def _equal(now: Path, before: Path) -> Outcome:
    found: list[str] = []
    for path in sorted(before.glob("*.parquet")):
        if not (now / path.name).is_file():
            found.append(f"{path.name} is missing")
            continue
        for each in compare_tables(path, now / path.name):
            found.append(str(each))
    if not found:
        says = "the same measurements, and every table agrees within its tolerance"
        return Outcome(now.name, "accepted run", "accepted", PASSED, says)
    says = f"the same measurements, but {len(found)} columns differ: {first_few(found)}"
    fix = f'kinacc check-results {now.parent} --accept {before.parent} --reason "..", if intended'
    figures = {"columns": len(found)}
    return Outcome(now.name, "accepted run", "accepted", FAILED, says, fix, figures)


def _errors_beside(now: Path, before: Path) -> Outcome:
    """Whether the mean held-out position error is better, the same or worse than accepted."""
    runs = [RunTables(now), RunTables(before)]
    try:
        samples = [_sample(each) for each in runs]
    except InputError as error:
        says = f"undecided: {error.problems[0]}"
        return Outcome(now.name, "held-out errors", "accepted", UNDECIDED, says)
    new, old = samples
    worse = chance.change("mean", new, old, False, CONFIDENCE)
    better = chance.change("mean", old, new, False, CONFIDENCE)
    verdict, word = PASSED, "same"
    if worse.open:
        verdict, word = UNDECIDED, "undecided"
    elif worse.least > 0.0:
        verdict, word = FAILED, "worse"
    elif better.least > 0.0:
        word = "better"
    means = [float(each.sizes.mean()) for each in samples]
    says = (
        f"{word}: mean held-out position error {means[0]:.3f} mm, accepted run {means[1]:.3f} mm "
        f"({new.count} and {old.count} poses, {CONFIDENCE:.0%} confidence)"
    )
    figures: dict[str, float | int | str | None] = {
        "mean_mm": means[0],
        "accepted_mean_mm": means[1],
        "difference_mm": worse.difference,
        "at_least_mm": worse.least,
        "confidence": CONFIDENCE,
        "result": word,
    }
    fix = f"kinacc compare {before} {now}" if verdict == FAILED else worse.open
    return Outcome(now.name, "held-out errors", "accepted", verdict, says, fix, figures)


def _arm_beside(now: Path, before: Path, rotation_weight_mm_per_rad: float) -> Outcome:
    """Whether the accepted calibration still holds, by :mod:`kinacc.deployment.drift`.

    A refit takes up what a knocked joint does, so that held-out errors do not show it. The
    instrument counts as set up anew, the tool as the same.
    """
    try:
        sessions = [
            drift.session_of(
                folder.read_tables(each, "robot", "measurements", "pose_errors"),
                name,
                name,
                MOVED,
                SAME,
            )
            for name, each in (("1 accepted", before), ("2 now", now))
        ]
        rows = drift.history(sessions, rotation_weight_mm_per_rad, _SEED)
    except (FitError, InputError) as error:
        says = f"undecided: {getattr(error, 'problems', (error,))[0]}"
        return Outcome(now.name, "arm", "accepted", UNDECIDED, says)
    row = {name: values[1] for name, values in rows.items()}
    moved_mm, chance_mm = float(row["moved_mm"]), float(row["chance_mm"])
    figures: dict[str, float | int | str | None]
    figures = {"moved_mm": moved_mm, "chance_mm": chance_mm, "result": "same"}
    says = f"moved by {moved_mm:.3f} mm, by chance up to {chance_mm:.3f} mm"
    if row["verdict"] == OPEN:
        says = f"undecided: {row['reason']}"
        return Outcome(now.name, "arm", "accepted", UNDECIDED, says, figures=figures)
    if row["verdict"] != RECALIBRATE:
        return Outcome(now.name, "arm", "accepted", PASSED, f"same: {says}", figures=figures)
    joint = "" if np.isnan(row["joint"]) else f", as joint {row['joint']:.0f} would"
    fix = f"kinacc compare {before} {now}"
    figures["result"] = "worse"
    says = f"worse: the accepted calibration holds no more; {says}{joint}"
    return Outcome(now.name, "arm", "accepted", FAILED, says, fix, figures)


def _sample(tables: RunTables) -> chance.Sample:
    model = selected(tables["model_selection"])
    sizes, rows = errors_of(tables, model, "held_out", "position")
    return chance.Sample(sizes, configurations_of(tables["measurements"])[rows])


def _parameters_beside(now: Path, before: Path) -> Outcome:
    """DH parameters that moved by more than their uncertainty, given the model."""
    new, old = (store.read(each / "dh_model.parquet") for each in (now, before))
    moved = [*_moved(new, old)]
    says = "no DH parameter moved beyond its uncertainty"
    if moved:
        says = f"{len(moved)} DH parameters moved by more than {_FAR:g} standard deviations: "
        says += first_few(moved)
    verdict = WARNED if moved else PASSED
    return Outcome(now.name, "parameters", "accepted", verdict, says,
                   figures={"moved": len(moved)})  # fmt: skip


def _moved(new: Columns, old: Columns) -> Iterator[str]:
    for name in ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad"):
        change = new[name] - old[name]
        std = np.hypot(new[f"std_{name}"], old[f"std_{name}"])  # NaN where undetermined
        for row in np.flatnonzero(np.abs(change) > _FAR * std):
            unit = "mm" if name.endswith("mm") else "mrad"
            factor = 1.0 if unit == "mm" else 1e3
            shown = f"{factor * change[row]:+.3g} {unit}"
            yield f"{name.rpartition('_')[0]} of joint {int(new['joint'][row])} by {shown}"
