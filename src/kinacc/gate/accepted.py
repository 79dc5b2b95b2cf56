"""The accepted run: a copy of tables with a reason, and how new results compare with it."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from kinacc import __version__
from kinacc.deployment import folder, history
from kinacc.errors import FitError, InputError, first_few, input_error
from kinacc.gate import chance
from kinacc.gate.outcome import FAILED, PASSED, UNDECIDED, Outcome
from kinacc.gate.values import SELECTED, RunTables, same_measurements
from kinacc.tables.allowed import MOVED, OPEN, RECALIBRATE, SAME
from kinacc.tables.atomic import unfinished, write_whole
from kinacc.tables.comparison import compare_folders

NOTE = "accepted.json"
# Of 1 % false alarms 0.3 % are for held-out errors and 0.7 % for the arm: a new fit absorbs a
# knocked joint, so that only the arm's test shows it.
CONFIDENCE, ARM_LEVEL = 0.997, 0.007
_PICTURES = shutil.ignore_patterns("*.svg", "*.png", "*.pdf", "*.html")


def accept(results: Path, folder: Path, datasets: Sequence[str], reason: str) -> dict[str, Any]:
    """Copy tables and digests of data sets to the folder of the accepted run, with a note.

    Raises InputError without a reason, or where the folder holds something else.
    """
    if not reason.strip():
        raise input_error("--reason", "is empty", "why this run is as it should be")
    note, known = folder / NOTE, []
    if note.is_file():
        known = json.loads(note.read_text("utf-8"))
    elif folder.exists() and any(folder.iterdir()):
        message = f"holds no accepted run, and is not empty: {NOTE} is missing"
        raise input_error(str(folder), message, "a folder of its own")
    for name in datasets:
        new, target = unfinished(folder / name), folder / name
        shutil.copytree(results / name, new, ignore=_PICTURES)
        shutil.rmtree(target, ignore_errors=True)
        os.replace(new, target)
    known.append(
        {
            "reason": reason,
            "date": datetime.now(UTC).date().isoformat(),
            "by": os.environ.get("USER", ""),
            "kinacc_version": __version__,
            "datasets": list(datasets),
        }
    )
    write_whole(note, (json.dumps(known, indent=1) + "\n").encode())
    return known[-1]


def compared(now: Path, before: Path, rotation_weight_mm_per_rad: float) -> Iterator[Outcome]:
    """A data set compared with the accepted one.

    Where the measurements are the same, whether all tables are; else whether held-out errors are
    better, same, worse or undecided, and whether the arm changed.
    """

    def outcome(name: str, verdict: str, says: str, fix: str = "", **figures: Any) -> Outcome:
        return Outcome(now.name, name, "accepted", verdict, says, fix, figures)

    accepting = f'kinacc check-results {now.parent} --accept {before.parent} --reason ".."'
    if not (before / "measurements.parquet").is_file():
        says = f"no accepted run of {now.name} in {before.parent}"
        yield outcome("accepted run", FAILED, says, accepting)
    elif same_measurements(now, before):
        results = [*compare_folders(before, now)]
        says = "same measurements, and every table agrees within its tolerance"
        if results:
            says = f"same measurements, but {len(results)} columns differ: {first_few(results)}"
        fix = f"if intended: {accepting}" if results else ""
        verdict = FAILED if results else PASSED
        yield outcome("accepted run", verdict, says, fix, columns=len(results))
    else:
        compare = f"kinacc compare {before} {now}"
        for name, of in (("held-out errors", _errors), ("arm", _arm)):
            try:
                verdict, says, figures = of(now, before, rotation_weight_mm_per_rad)
            except (FitError, InputError) as error:
                problem = getattr(error, "problems", [error])[0]
                verdict, says, figures = UNDECIDED, f"undecided: {problem}", {}
            yield outcome(name, verdict, says, compare if verdict == FAILED else "", **figures)


def _errors(now: Path, before: Path, _: float) -> tuple[str, str, dict[str, Any]]:
    """Whether the mean held-out position error is better, the same or worse than accepted."""
    new, old = (RunTables(item).errors(SELECTED, "position") for item in (now, before))
    worse = chance.change("mean", new, old, False, CONFIDENCE)
    better = chance.change("mean", old, new, False, CONFIDENCE)
    word = "worse" if worse.least > 0.0 else "better" if better.least > 0.0 else "same"
    word = "undecided" if worse.open else word
    figures = {
        "mean_mm": float(new.sizes.mean()),
        "accepted_mean_mm": float(old.sizes.mean()),
        "difference_mm": worse.difference,
        "at_least_mm": worse.least,
        "confidence": CONFIDENCE,
        "result": word,
    }
    says = (
        f"{word}: mean held-out position error {figures['mean_mm']:.3f} mm, accepted run "
        f"{figures['accepted_mean_mm']:.3f} mm ({new.count} and {old.count} poses, "
        f"{CONFIDENCE:.1%} confidence)"
    )
    says += f"; {worse.open}" if worse.open else ""
    return {"worse": FAILED, "undecided": UNDECIDED}.get(word, PASSED), says, figures


def _arm(
    now: Path, before: Path, rotation_weight_mm_per_rad: float
) -> tuple[str, str, dict[str, Any]]:
    """Whether the accepted calibration still holds, by :mod:`kinacc.deployment.history`.

    A new fit absorbs a knocked joint, so that held-out errors do not show it. The instrument
    counts as set up anew, the tool as the same.
    """
    names = ("robot", "measurements", "pose_errors")
    sessions = [
        history.session_of(folder.read_tables(item, *names), name, name, MOVED, SAME)
        for name, item in (("1 accepted", before), ("2 now", now))
    ]
    rows = history.history(sessions, rotation_weight_mm_per_rad, ARM_LEVEL)
    row = {name: values[1] for name, values in rows.items()}
    figures: dict[str, Any] = {name: float(row[name]) for name in ("moved_mm", "chance_mm")}
    says = f"moved by {figures['moved_mm']:.3f} mm, by chance up to {figures['chance_mm']:.3f} mm"
    if row["verdict"] == OPEN:
        return UNDECIDED, f"undecided: {row['reason']}", figures | {"result": "undecided"}
    if row["verdict"] != RECALIBRATE:
        return PASSED, f"same: {says}", figures | {"result": "same"}
    joint = "" if np.isnan(row["joint"]) else f", mostly at joint {row['joint']:.0f}"
    says = f"worse: the accepted calibration no longer holds; {says}{joint}"
    return FAILED, says, figures | {"result": "worse"}
