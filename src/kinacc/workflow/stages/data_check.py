"""Check the measured file before anything is fitted to it; what makes a fit wrong stops here."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.contract import columns_of
from kinacc.calibration.observations import from_columns
from kinacc.calibration.vec_estimator import VECEstimator
from kinacc.checks import check
from kinacc.checks.report import Report
from kinacc.checks.suspicion import NOTE, Suspicion, suspicion
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot
from kinacc.kinematics.robot import Robot
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import Reading, read
from kinacc.workflow.stages.measurements import configurations

Progress = Callable[[Iterable, str], Iterable]
_PER_POSE = 6  # a rigid body has no more, however many targets it carries


def run(inputs: Mapping, settings: Mapping, progress: Progress | None = None) -> dict[str, Columns]:
    """``data_check``: every finding with its level and, where it was accepted, the reason.

    Raises InputError where findings stop the workflow, one problem each.
    """
    report = examined(settings, "", progress or (lambda items, words: items))
    if report.stopping:
        title = f"{report.path} is not ready to be fitted"
        raise InputError([_problem(report.path, each) for each in report.stopping], title)
    for each in report.suspicions:
        warnings.warn(f"{each.kind}: {each.what}", stacklevel=1)
    return {"data_check": _columns(report)}


def examined(settings: Mapping, dataset: str, progress: Progress) -> Report:
    """What the check finds in a data set's file, and what its configuration says of that.

    ``settings``: robot and the sections ``measurements``, ``calibration`` and ``data_check``.
    Raises InputError where the file cannot be read or holds too little to say anything.
    """
    arm, section = robot.load(settings["robot"]), settings["measurements"]["file"]
    reading = read(section, arm, strict=False)
    report = check.check(reading, Layout.of(section), arm, dataset, section["path"], progress)
    few = _few_poses(reading, arm, settings["calibration"])
    accepted = settings["data_check"]["accept"]
    return replace(report, suspicions=(*report.suspicions, *few), accepted=dict(accepted))


def in_words(table: Mapping) -> list[str]:
    """Findings of a ``data_check`` table, a line each, the gravest first."""
    order = sorted(range(len(table["finding"])), key=lambda i: table["level"][i] == NOTE)
    return [
        f"{table['finding'][i]}: {table['what'][i]}"
        + (f" ({table['lines'][i]})" if table["lines"][i] else "")
        + (f"; accepted: {table['accepted'][i]}" if table["accepted"][i] else "")
        for i in order
    ]


def _few_poses(reading: Reading, arm: Robot, calibration: Mapping) -> list[Suspicion]:
    """Whether the VEC model has more coefficients than the poses give independent readings."""
    count = len(reading.columns["pose"])
    seen = from_columns({**reading.columns, "fold": np.full(count, np.nan)}, arm)
    fit = VECEstimator.of(calibration, arm, seen)
    same = configurations(reading.columns)
    # A target adds three components to a pose, an orientation three; repeats add none.
    pairs, first = np.unique(np.stack([same, seen.target]), axis=1, return_index=True)
    turned = np.zeros(same.max() + 1)
    np.maximum.at(turned, pairs[0], 3.0 * seen.has_rotation[first])
    components = np.minimum(3.0 * np.bincount(pairs[0]) + turned, _PER_POSE)
    coefficients = fit.size
    frames = int(fit.common.terms(seen).free.sum()) if fit.common.frames_estimated else 0
    if components.sum() >= coefficients + frames:
        return []
    of_frames = f" and {frames} of base and targets" if frames else ""
    return [
        suspicion(
            "few_poses",
            f"{len(components)} different poses give {components.sum():.0f} independent numbers "
            f"for the {coefficients} coefficients of the VEC model of order {fit.order}"
            f"{of_frames}: its prior decides most of them, not the measurements",
            (),
            "measure more poses, lower calibration.vec.order, or let it be chosen (order: auto)",
            poses=len(components),
            coefficients=coefficients,
        ).held_to(())
    ]


def _problem(path: str, each: Suspicion) -> Problem:
    where = f"{path}, {each.where}" if each.lines else path
    return Problem(where, f"{each.kind}: {each.what}", fix=f"{each.fix}. {each.to_go_on}")


def _columns(report: Report) -> Columns:
    return columns_of(
        "data_check",
        [
            {
                "finding": each.kind,
                "level": each.level,
                "what": each.what,
                "lines": each.where if each.lines else None,
                "fix": each.fix or None,
                "accepted": report.accepted.get(each.kind),
                "rows": len(each.lines),
            }
            for each in report.findings
        ],
    )
