"""Check the measured file before anything is fitted to it; what makes a fit wrong stops here."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from kinacc.checks import check, few_poses
from kinacc.checks.report import Report
from kinacc.checks.suspicion import Suspicion
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import read
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

Progress = Callable[[Iterable, str], Iterable]


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
    few = few_poses.found(reading.columns, arm, settings["calibration"])
    accepted = settings["data_check"]["accept"]
    return replace(report, suspicions=(*report.suspicions, *few), accepted=dict(accepted))


def _problem(path: str, each: Suspicion) -> Problem:
    where = f"{path}, {each.where}" if each.lines else path
    return Problem(
        where, f"{each.kind}: {each.what}", fix="; or ".join([each.fix, *each.commands()])
    )


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
