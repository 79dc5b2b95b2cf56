"""The whole check of one file: what it holds, what its numbers mean, which rows are off."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kinacc.calibration.least_squares import one_thread
from kinacc.calibration.noise import of_readings
from kinacc.checks import (
    coverage,
    digits,
    distances,
    meanings,
    moved,
    readings,
    robust_fit,
    rows,
    shipped,
    tails,
)
from kinacc.checks.findings import Finding, Report, finding
from kinacc.checks.readings import Readings
from kinacc.checks.robust_fit import Fitted
from kinacc.config.measured import Orientation
from kinacc.config.records import Settings
from kinacc.config.settings import OUTSIDE_LIMITS
from kinacc.errors import InputError, Problem, input_error
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import Robot, outside_limits
from kinacc.measurements.faults import LIMIT_SLACK
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import MeasuredFile, read
from kinacc.tables.allowed import LEFT_OUT
from kinacc.tables.columns import Tables
from kinacc.tables.contract import columns_of

_FEWEST_POSES = 6
_SYMPTOMS = ("outliers", OUTSIDE_LIMITS)
_OTHER_LENGTHS = 0.01  # of the arm's: real arms are off their description by a tenth of that
_GROSS = 20.0  # robust spreads per axis: further off is no reading of this arm


def run(inputs: Tables, settings: Settings) -> Tables:
    """``data_check``: every finding with its level and, where it was accepted, the reason.

    Raises InputError where findings stop the workflow, one problem each.
    """
    report = examined(settings)
    if report.stopping:
        title = f"{report.path} is not ready to be fitted"
        raise InputError(
            [
                Problem(
                    f"{report.path}, {item.where}".removesuffix(", "),
                    f"{item.kind}: {item.what}",
                    fix="; or ".join([item.fix, *item.commands()]),
                )
                for item in report.stopping
            ],
            title,
        )
    for item in report.suspicions:
        warnings.warn(f"{item.kind}: {item.what}", stacklevel=1)
    table = [
        {
            "finding": item.kind,
            "level": item.level,
            "what": item.what,
            "lines": item.where or None,
            "fix": item.fix or None,
            "accepted": report.accepted.get(item.kind),
            "rows": len(item.lines),
        }
        for item in (*report.suspicions, *report.notes)
    ]
    return {"data_check": columns_of("data_check", table)}


def examined(settings: Settings) -> Report:
    """Check a data set's file, with what its configuration accepts.

    Parameters
    ----------
    settings
        ``robot`` and the sections ``measurements``, ``calibration`` and ``data_check``.

    Returns
    -------
    Report
        Facts, remarks and findings.

    Raises
    ------
    InputError
        Where the file cannot be read or holds fewer than 6 poses.
    """
    arm, section = robots.load(settings["robot"]), settings["measurements"]["file"]
    reading = read(section, arm, strict=False)
    report = check(reading, section, arm)
    of_fit = (reading.columns, arm, settings["calibration"])
    found = (*coverage.few_poses(*of_fit), *coverage.fixed_frames(*of_fit))
    more = [item.held_to((), reading.row_names) for item in found]
    accepted = dict(settings["data_check"]["accept"])
    return replace(report, suspicions=(*report.suspicions, *more), accepted=accepted)


@one_thread
def check(reading: MeasuredFile, section: Settings, robot: Robot) -> Report:
    """Report on what was read as in ``section``. Raises InputError for too few poses."""
    stated = Layout.of(section).orientation
    every = readings.of_file(reading, robot)
    if (count := len(np.unique(every.pose))) < _FEWEST_POSES:
        allowed = f"at least {_FEWEST_POSES}, as base and tool are fitted to check the readings"
        raise input_error(section["path"], f"{count} poses", allowed)
    between = distances.distances(every)
    by_distances, renamed = distances.compared(every, between)
    single, away_mm = readings.merged(renamed)
    scatter = of_readings(every, robot.dh)
    fitted, findings = _meant(single, stated, robot)
    kinds = {item.kind for item in findings}
    findings += by_distances
    if not any(kind.startswith("joint_") for kind in kinds):
        findings += _outside(every, robot)
    gross: list[int] = []
    if fits := "does_not_fit" not in kinds:
        fitted, jumps = moved.without_jumps(fitted)
        findings += [*jumps, *_scattered(fitted), *digits.commanded(fitted, robot)]
        findings += [*rows.explained(fitted, robot, stated), *rows.largest(fitted)]
        gross = fitted.readings.lines(fitted.left_mm > _GROSS * fitted.trial.sigma_mm)
    off = np.flatnonzero(away_mm > tails.limit(away_mm, 3))
    if off.size:
        largest = float(away_mm[off].max())
        findings.append(
            finding("outliers/repeats", every.line[off], count=off.size, largest_mm=largest)
        )
    copies = [*digits.copies(every, scatter.per_axis_mm)]
    if again := [line for item in copies if item.kind == "duplicate_rows" for line in item.lines]:
        scatter = of_readings(every.select(~np.isin(every.line, again)), robot.dh)
    findings += copies
    facts = coverage.facts_of(every, robot, scatter, between, fitted if fits else None)
    unread = dict.fromkeys((*reading.notes, *reading.left_out()))
    return Report(
        section["path"],
        facts,
        tuple(item.held_to(gross, reading.row_names) for item in _once(findings, facts["rows"])),
        (
            *(finding(LEFT_OUT, words=text) for text in unread),
            *coverage.thin(facts["joint_coverage"]),
        ),
        *((fitted.readings.line, fitted.left_mm) if fits else ()),
    )


def _meant(single: Readings, stated: Orientation, robot: Robot) -> tuple[Fitted, list[Finding]]:
    """The fit of the file as it is meant, and findings of all rows."""
    fitted = robust_fit.fit(single, robot.dh)
    read, findings = meanings.find(single, robot, fitted.trial)
    if findings:
        fitted = robust_fit.fit(read, robot.dh)
    if fitted.trial.sigma_mm > meanings.FAR * meanings.spread_mm(read.position_mm):
        names = {"robot": robot.name, "shipped": _shipped(single, robot)}
        sigma_mm = fitted.trial.sigma_mm
        no_fit = finding("does_not_fit", single.lines(), sigma_mm=sigma_mm, **names)
        return fitted, [*findings, no_fit]
    findings += _of_other_lengths(single, fitted, robot)
    if not read.has_rotation.any():
        return fitted, findings
    way, least, before = meanings.find_orientations(read, stated, fitted.residuals.flange)
    if before > meanings.BAD_RAD and (turned := meanings.find_by_turns(read, robot, least)):
        return robust_fit.fit(turned[0], robot.dh), [*findings, turned[1]]
    if way:
        if axis := way[0].finding.values.get("axis"):  # right-handed beside mirrored positions
            fix = f"negate {axis} of the positions; the orientations are right-handed"
            findings = [replace(e, fix=fix) if e.kind == "left_handed" else e for e in findings]
        findings += meanings.of_turns(way, read, before, least)
        fitted = robust_fit.fit(meanings.changed(read, way), robot.dh)
    return fitted, findings


def _scattered(fitted: Fitted) -> Iterator[Finding]:
    """Orientations that do not go with the joints, though every jump has frames of its own."""
    there = fitted.readings.has_rotation
    if there.any():
        part, flange = fitted.readings.select(there), fitted.residuals.flange[there]
        if (scatter := meanings.scatter(flange, part)) > meanings.BAD_RAD:
            degrees = float(np.rad2deg(scatter))
            yield finding("orientations", part.lines(), as_written_deg=degrees)


def _shipped(single: Readings, robot: Robot) -> str:
    rivals = shipped.misfits(single)
    names = [name for share, name in rivals if share <= shipped.SURE and name != robot.name]
    return f". Shipped robots that fit, best first: {', '.join(names)}" if names else ""


def _of_other_lengths(single: Readings, fitted: Fitted, robot: Robot) -> Iterator[Finding]:
    """An arm that fits with other lengths alone is another one of the same build."""
    new, old = (np.stack([arm.a_mm, arm.d_mm]) for arm in (fitted.trial.arm.model, robot.dh))
    apart = np.abs(new - old)
    if (largest_mm := float(apart.max())) > _OTHER_LENGTHS * np.abs(old).sum():
        number, joint = np.argwhere(apart == largest_mm)[0]
        yield finding(
            "does_not_fit/lengths",
            single.lines(),
            robot=robot.name,
            length="ad"[number],
            of=int(joint) + 1,
            new_mm=float(new[number, joint]),
            old_mm=float(old[number, joint]),
            largest_mm=largest_mm,
            shipped=_shipped(single, robot),
        )


def _outside(every: Readings, robot: Robot) -> Iterator[Finding]:
    """Rows in which a joint is beyond its limits."""
    for item in outside_limits(robot, every.q, LIMIT_SLACK):
        yield finding(
            OUTSIDE_LIMITS,
            every.line[item.rows],
            joint=item.joint,
            largest=item.values[np.argmax(np.abs(item.values))],
            unit=item.unit,
            allowed=item.allowed,
        )


def _once(findings: list[Finding], lines: int) -> list[Finding]:
    """Findings without those another makes needless.

    Those of the same kind and joint and of no other rows, and what merely shows (outliers, joints
    outside their limits) in rows of which a fault is known that is not in all ``lines``.
    """
    faults = [e for e in findings if e.kind not in _SYMPTOMS and len(e.lines) < lines]
    named = {line for item in faults for line in item.lines}
    needed: list[Finding] = []
    for item in findings:
        is_shown = item.kind in _SYMPTOMS and named.issuperset(item.lines)
        is_repeated = any(e.about == item.about and {*e.lines} >= {*item.lines} for e in needed)
        if not is_shown and not is_repeated:
            needed.append(item)
    return needed
