"""The whole check of one file: what it holds, what its numbers mean, which rows are off."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from kinacc.calibration.noise import of_measurements
from kinacc.checks import (
    coverage,
    digits,
    meanings,
    moved,
    orientations,
    readings,
    robust_fit,
    rows,
    tails,
)
from kinacc.checks.findings import Finding, finding
from kinacc.checks.meanings import Meaning
from kinacc.checks.readings import Readings
from kinacc.checks.report import Report
from kinacc.checks.robust_fit import Fitted
from kinacc.errors import InputError, Problem
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import Robot, outside_limits
from kinacc.measurements.faults import LIMIT_SLACK
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import MeasuredFile, read
from kinacc.tables.allowed import LEFT_OUT
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

Progress = Callable[[Iterable, str], Iterable]
_FEWEST_POSES = 6
_SYMPTOMS = ("outliers", "outside_limits")
_OTHER_LENGTHS = 0.01  # of the arm's: real arms are off their description by a tenth of that
_REACH = (0.02, 3.0)  # of the arm's length: what points that an arm reaches may spread over
_GROSS = 20.0  # robust spreads per axis: further off is no reading of this arm


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
    return {
        "data_check": columns_of(
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
                for each in (*report.suspicions, *report.notes)
            ],
        )
    }


def _problem(path: str, each: Finding) -> Problem:
    where = f"{path}, {each.where}" if each.lines else path
    return Problem(
        where, f"{each.kind}: {each.what}", fix="; or ".join([each.fix, *each.commands()])
    )


def examined(settings: Mapping, dataset: str, progress: Progress) -> Report:
    """Report on a data set's file, with what its configuration accepts.

    ``settings``: robot and the sections ``measurements``, ``calibration`` and ``data_check``.
    Raises InputError where the file cannot be read or holds too few poses.
    """
    arm, section = robots.load(settings["robot"]), settings["measurements"]["file"]
    reading = read(section, arm, strict=False)
    report = check(reading, Layout.of(section), arm, dataset, section["path"], progress)
    few = coverage.few_poses(reading.columns, arm, settings["calibration"])
    accepted = dict(settings["data_check"]["accept"])
    return replace(report, suspicions=(*report.suspicions, *few), accepted=accepted)


def check(
    reading: MeasuredFile, layout: Layout, robot: Robot, dataset: str, path: str, progress: Progress
) -> Report:
    """Report on what was read from ``path``. Raises InputError for too few poses."""
    every = readings.of_file(reading, robot)
    if (count := len(np.unique(every.pose))) < _FEWEST_POSES:
        raise InputError(Problem(path, f"{count} poses", f"at least {_FEWEST_POSES}"))
    every = replace(every, earlier=digits.unread(every))
    distances = readings.distances(every)
    by_distances, renamed = moved.by_distances(every, distances)
    one, cell, away_mm = readings.merged(every)
    scatter = of_measurements(reading.columns, robot)
    fitted, meaning, found = _meant(one, layout, robot, progress)
    kinds = {each.kind for each in found}
    found += by_distances
    if not any(kind.startswith("joint_") for kind in kinds):
        found += _outside(every, robot)
    gross = []
    if "does_not_fit" in kinds:
        fitted = None
    else:
        target = renamed.target[np.unique(cell, return_index=True)[1]]
        seen = replace(fitted.seen, target=target, target_names=renamed.target_names)
        fitted, jumps = moved.without_jumps(seen, robot.dh, progress)
        if jumps and _turned_well(fitted):
            found = [each for each in found if each.kind != "orientations"]
        found += jumps
        found += digits.commanded(fitted, meaning)
        found += [*rows.found(fitted, meaning, layout), *_largest(fitted)]
        gross = fitted.seen.lines(fitted.left_mm > _GROSS * fitted.trial.sigma_mm)
    off = np.flatnonzero(away_mm > tails.limit(away_mm, 3))
    if off.size:
        most_mm = float(away_mm[off].max())
        found.append(
            finding("outliers/repeats", every.line[off], count=off.size, largest_mm=most_mm)
        )
    found += digits.copies(every, scatter.per_axis_mm)
    facts = coverage.facts_of(every, robot, scatter, distances, fitted)
    unread = dict.fromkeys((*reading.notes, *reading.left_out()))
    return Report(
        dataset,
        path,
        facts,
        coverage.remarks_of(every, scatter, distances),
        tuple(
            replace(each.held_to(gross), row_names=reading.row_names)
            for each in _once(found, np.unique(every.line).size)
        ),
        (
            *(finding(LEFT_OUT, words=words) for words in unread),
            *coverage.thin(facts["joint_coverage"]),
        ),
        *(() if fitted is None else (fitted.seen.line, fitted.left_mm)),
    )


def _meant(
    one: Readings, layout: Layout, robot: Robot, progress: Progress
) -> tuple[Fitted, Meaning, list[Finding]]:
    """The fit of the file as it is meant, its meaning, and findings of all rows."""
    here = robust_fit.fit(meanings.as_written(robot.joint_map).seen(one), robot.dh)
    meaning, changes = meanings.find(one, robot, here.trial, progress)
    fitted = robust_fit.fit(meaning.seen(one), robot.dh) if changes else here
    spread_mm = meanings.spread_mm(one.position_mm) * meaning.scale
    if fitted.trial.sigma_mm > meanings.FAR * spread_mm:
        return fitted, meaning, [*changes, _no_fit(one, fitted, robot, spread_mm)]
    found = [*changes, *_of_other_lengths(one, fitted, robot)]
    seen, there = fitted.seen, fitted.seen.has_rotation
    if not there.any():
        return fitted, meaning, found
    way, least, before = orientations.find(
        one.turns[there], layout, fitted.left.flange[there], seen.target[there]
    )
    bad = before > meanings.BAD_RAD
    if bad and (by_turns := meanings.find_by_turns(one, robot, meaning, least)) is not None:
        meaning, told = by_turns
        fitted = robust_fit.fit(meaning.seen(one), robot.dh)
        return fitted, meaning, [*found, told]
    if way.change is not None:
        found.append(orientations.told(way.change, one, there, before, least))
        rotation = seen.rotation.copy()
        rotation[there] = meaning.rotations(way.read(one.turns[there]))
        fitted = robust_fit.fit(replace(seen, rotation=rotation), robot.dh)
    elif bad:
        degrees = float(np.rad2deg(before))
        found.append(finding("orientations", one.lines(there), as_written_deg=degrees))
    return fitted, meaning, found


def _turned_well(fitted: Fitted) -> bool:
    """Whether the orientations go with the joints, now that every jump has frames of its own."""
    there = fitted.seen.has_rotation
    if not there.any():
        return False
    flange, rotation = fitted.left.flange[there], fitted.seen.rotation[there]
    return orientations.scatter(flange, rotation, fitted.seen.target[there]) < meanings.BAD_RAD


def _no_fit(one: Readings, fitted: Fitted, robot: Robot, spread_mm: float) -> Finding:
    whole_mm = float(np.sum(np.abs(robot.dh.a_mm)) + np.sum(np.abs(robot.dh.d_mm)))
    unit = (
        f". The points spread over {spread_mm:.3g} mm, links and offsets of {robot.name} add up "
        f"to {whole_mm:.4g} mm: check the unit of the positions too"
    )
    return finding(
        "does_not_fit",
        one.lines(),
        robot=robot.name,
        sigma_mm=fitted.trial.sigma_mm,
        more="" if _REACH[0] * whole_mm < spread_mm < _REACH[1] * whole_mm else unit,
    )


def _of_other_lengths(one: Readings, fitted: Fitted, robot: Robot) -> Iterator[Finding]:
    """An arm that fits with other lengths alone is another one of the same build."""
    new, old = (np.stack([arm.a_mm, arm.d_mm]) for arm in (fitted.trial.arm.model, robot.dh))
    apart = np.abs(new - old)
    far = np.argwhere(apart > _OTHER_LENGTHS * np.abs(old).sum())
    if len(far):
        words = [
            f"{'ad'[n]} of joint {joint + 1} {new[n, joint]:.4g} for {old[n, joint]:.4g} mm"
            for n, joint in sorted(far.tolist(), key=lambda each: -apart[*each])
        ]
        yield finding(
            "does_not_fit/lengths",
            one.lines(),
            robot=robot.name,
            lengths=", ".join(words),
            largest_mm=float(apart.max()),
        )


def _largest(fitted: Fitted) -> Iterator[Finding]:
    """Readings that are no outliers, and stand apart from the others all the same."""
    good = np.flatnonzero(~fitted.bad)
    poses, number = np.unique(fitted.seen.pose[good], return_inverse=True)
    worst = np.zeros(len(poses))
    np.maximum.at(worst, number, fitted.left_mm[good])
    if count := tails.detached(worst):
        ordered = np.sort(worst)[::-1]
        yield finding(
            "largest_rows",
            fitted.seen.lines(good[worst[number] >= ordered[count - 1]]),
            count=count,
            errors=", ".join(f"{value:.3g}" for value in ordered[:count]),
            next=f"{ordered[count]:.3g}",
        )


def _outside(every: Readings, robot: Robot) -> Iterator[Finding]:
    """Rows in which a joint is beyond its limits."""
    for each in outside_limits(robot, every.q, LIMIT_SLACK):
        yield finding(
            "outside_limits",
            every.line[each.rows],
            joint=each.joint,
            largest=each.values[np.argmax(np.abs(each.values))],
            unit=each.unit,
            allowed=each.allowed,
        )


def _once(known: list[Finding], lines: int) -> list[Finding]:
    """Findings without those another makes needless.

    Those of the same kind and of no other rows, and what merely shows (outliers, joints outside
    their limits) in rows of which a fault is known that is not in all ``lines`` of the file.
    """
    faults = [e for e in known if e.kind not in _SYMPTOMS and len(e.lines) < lines]
    named = {line for each in faults for line in each.lines}
    kept: list[Finding] = []
    for each in known:
        own = set(each.lines)
        rivals = [set(other.lines) for other in kept if other.kind == each.kind]
        # A second jump concerns part of the rows of the first and is another one all the same.
        jump = each.kind in ("base_jump", "target_moved")
        needless = any(own == other if jump else own <= other for other in rivals)
        if not needless and not (each.kind in _SYMPTOMS and own <= named):
            kept.append(each)
    return kept
