"""The whole check of one file: from what it says to what it means to which rows are off."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from kinacc.calibration.noise import of_measurements
from kinacc.checks import (
    cells,
    changes,
    commanded,
    doubles,
    fitting,
    meaning,
    noise,
    rows,
    tails,
    targets,
    turned_joints,
    turns,
)
from kinacc.checks.cells import Cells
from kinacc.checks.facts import coverage_of, facts_of, left_out, remarks_of
from kinacc.checks.fitting import Fitted, Jump
from kinacc.checks.report import Report
from kinacc.checks.suspicion import Suspicion, suspicion
from kinacc.errors import InputError, Problem
from kinacc.kinematics.robot import Robot, outside_limits
from kinacc.measurements.faults import LIMIT_SLACK
from kinacc.measurements.layout import Layout
from kinacc.measurements.reader import MeasuredFile, read

Progress = Callable[[Iterable, str], Iterable]
_FEWEST_POSES = 6
_FROM_THERE_ON = ("base_jump", "target_moved")
NO_TURN = "orientations"
_SYMPTOMS = ("outliers", "outside_limits")
_OTHER_LENGTHS = 0.01  # of the arm's: real arms are off their description by a tenth of that
_REACH = (0.02, 3.0)  # of the arm's length: what points that an arm reaches may spread over
_GROSS = 20.0  # robust spreads per axis: further off is no reading of this arm


def check_file(section: Mapping, robot: Robot, dataset: str, progress: Progress) -> Report:
    """Report on the file that ``section`` (``measurements.file``) names.

    Raises InputError where it cannot be read or holds too little to say anything.
    """
    reading = read(section, robot, strict=False)
    return check(reading, Layout.of(section), robot, dataset, section["path"], progress)


def check(
    reading: MeasuredFile, layout: Layout, robot: Robot, dataset: str, path: str, progress: Progress
) -> Report:
    """Report on what was read."""
    every = cells.of_columns(reading.columns, robot.dh.joints, reading.row_names)
    if len(np.unique(every.pose)) < _FEWEST_POSES:
        what = f"{len(np.unique(every.pose))} poses"
        raise InputError(Problem(path, what, f"at least {_FEWEST_POSES}, to compare them"))
    one, cell = cells.merged(every)
    first = np.unique(cell, return_index=True)[1]
    repeats = noise.repeats(every, cell)
    distances = noise.distances(every)
    scatter = of_measurements(reading.columns, robot)
    equal = doubles.earlier(every)
    found = doubles.found(every, scatter.per_axis_mm)
    moved, numbers = targets.found(every, distances)
    fitted, raw, global_ones = _meant(one, reading, layout, robot, first, progress)
    known = global_ones + found + moved
    misread = any(each.kind.startswith("joint_") for each in global_ones)
    known += [] if misread else _outside(every, robot)
    if any(each.kind == "does_not_fit" for each in global_ones):
        fitted = None
    else:
        seen = replace(fitted.seen, target=numbers[first])
        fitted = fitting.with_jumps(seen, robot.dh, progress)
        raw = replace(raw, earlier=equal[first])
        if fitted.jumps and _turned_well(fitted):
            known = [each for each in known if each.kind != NO_TURN]
        known += _moved_frames(fitted)
        known += _commanded(fitted, reading, raw, first, robot)
        known += rows.found(fitted, raw)
        known += _largest(fitted)
    known += _scattered(every, repeats)
    known += doubles.stale(every, equal, scatter.per_axis_mm)
    gross = _gross_lines(fitted)
    facts = facts_of(every, robot, scatter, distances, fitted)
    return Report(
        dataset,
        path,
        facts,
        remarks_of(every, repeats, scatter, distances),
        tuple(
            replace(each.held_to(gross), row_names=reading.row_names)
            for each in _once(known, np.unique(every.line).size)
        ),
        (*left_out(reading), *coverage_of(facts["joint_coverage"])),
        *(() if fitted is None else (fitted.seen.cells.line, fitted.left_mm)),
    )


def _meant(
    one: Cells, reading: MeasuredFile, layout: Layout, robot: Robot, first, progress: Progress
):
    """The fit of the file as it is meant, what it was read from, and suspicions of all rows."""
    written = changes.as_written(robot.joint_map)
    here = fitting.fit(meaning.seen_as(one, written), robot.dh)
    finding = meaning.find(one, robot, here.trial, progress)
    suspicions = [_of_all(one, change, finding) for change in finding.meaning.changes]
    seen = meaning.seen_as(one, finding.meaning)
    fitted = here if not suspicions else fitting.fit(seen, robot.dh)
    raw = rows.Raw(
        one.q,
        reading.turns[first],
        layout,
        finding.meaning,
        None if reading.commanded is None else reading.commanded[first],
        np.zeros(len(one), dtype=np.int64),
    )
    centred = one.position_mm - np.median(one.position_mm, axis=0)
    spread = float(np.median(np.linalg.norm(centred, axis=1)))
    if fitted.trial.sigma_mm > meaning.FAR * spread * finding.meaning.scale:
        suspicions.append(_no_fit(one, fitted, robot, spread * finding.meaning.scale))
        return fitted, raw, suspicions
    suspicions += _of_other_lengths(one, fitted, robot)
    if seen.cells.turned.any():
        return _turned(one, fitted, raw, robot, suspicions)
    return fitted, raw, suspicions


def _turned(one: Cells, fitted: Fitted, raw: rows.Raw, robot: Robot, suspicions: list[Suspicion]):
    """As ``_meant``, after the orientations were held against the joints."""
    seen, there = fitted.seen, fitted.seen.cells.turned
    way, least, before = turns.find(
        raw.turns[there], raw.layout, fitted.left.flange[there], seen.target[there]
    )
    if before > turned_joints.BAD_RAD:
        joints = turned_joints.find(one, robot, raw.meaning, least)
        if joints is not None:
            change = joints.meaning.changes[-1]
            told = _turn(one, change, joints.found_rad, joints.before_rad, one.turned)
            fitted = fitting.fit(meaning.seen_as(one, joints.meaning), robot.dh)
            return fitted, replace(raw, meaning=joints.meaning), [*suspicions, told]
    if way.change is not None:
        suspicions = [*suspicions, _turn(one, way.change, least, before, there)]
        rotation = seen.cells.rotation.copy()
        rotation[there] = raw.meaning.rotations(way.read(raw.turns[there]))
        seen = replace(seen, cells=replace(seen.cells, rotation=rotation))
        fitted = fitting.fit(seen, robot.dh)
    elif before > turned_joints.BAD_RAD:
        suspicions = [*suspicions, _no_turn(one, before, there)]
    return fitted, raw, suspicions


def _turned_well(fitted: Fitted) -> bool:
    """Whether the orientations go with the joints, now that every jump has frames of its own."""
    there = fitted.seen.cells.turned
    if not there.any():
        return False
    flange, rotation = fitted.left.flange[there], fitted.seen.cells.rotation[there]
    return turns.scatter(flange, rotation, fitted.seen.target[there]) < turned_joints.BAD_RAD


def _no_turn(one: Cells, before: float, there: np.ndarray) -> Suspicion:
    return suspicion(
        NO_TURN,
        f"the orientations do not go with the joints: seen from the flange they scatter by "
        f"{np.rad2deg(before):.3g} deg, and no other way to read them that was tried does better",
        one.lines(there),
        "check their kind, convention, unit and the order of their columns",
        as_written_deg=float(np.rad2deg(before)),
    )


def _of_all(one: Cells, change: changes.Change, finding: meaning.Finding) -> Suspicion:
    others = [
        " and ".join(each.words for each in other.changes if each not in finding.meaning.changes)
        for other in finding.equal
    ]
    rivals = list(dict.fromkeys(words for words in others if words))[:3]
    equal = f"; as well explained by: {', or '.join(rivals)}" if rivals else ""
    left = f"{finding.as_written_mm:.3g} mm per axis left as written, {finding.found_mm:.3g} mm so"
    joints = [each.kind for each in finding.meaning.changes if each.joints]
    alone = joints == ["joint_coupling"] and not rivals
    return suspicion(
        change.kind,
        f"{change.words} ({left}{equal})",
        one.lines(np.arange(len(one))),
        change.fix,
        as_written_mm=finding.as_written_mm,
        found_mm=finding.found_mm,
        joints=[joint + 1 for joint in change.joints],
        setting=change.setting,
        **({"joint_map": finding.meaning.matrix.tolist()} if alone and change.joints else {}),
    )


def _turn(one: Cells, change: changes.Change, least: float, before: float, there) -> Suspicion:
    return suspicion(
        change.kind,
        f"{change.words} (seen from the flange they scatter by {np.rad2deg(before):.3g} deg as "
        f"written, by {np.rad2deg(least):.3g} deg so)",
        one.lines(there),
        change.fix,
        as_written_deg=float(np.rad2deg(before)),
        found_deg=float(np.rad2deg(least)),
        setting=change.setting,
    )


def _no_fit(one: Cells, fitted: Fitted, robot: Robot, spread_mm: float) -> Suspicion:
    whole_mm = float(np.sum(np.abs(robot.dh.a_mm)) + np.sum(np.abs(robot.dh.d_mm)))
    unit = ""
    if not _REACH[0] * whole_mm < spread_mm < _REACH[1] * whole_mm:
        unit = (
            f". The points spread over {spread_mm:.3g} mm, links and offsets of {robot.name} add "
            f"up to {whole_mm:.4g} mm: check the unit of the positions too"
        )
    return suspicion(
        "does_not_fit",
        f"no meaning of the numbers that was tried brings {robot.name} nearer than "
        f"{fitted.trial.sigma_mm:.3g} mm per axis",
        one.lines(np.arange(len(one))),
        "check the robot, its joint order, zeros and couplings, and that joints and readings are "
        f"of the same rows{unit}",
        sigma_mm=fitted.trial.sigma_mm,
    )


def _of_other_lengths(one: Cells, fitted: Fitted, robot: Robot) -> list[Suspicion]:
    """An arm that fits with other lengths alone is another one of the same build."""
    found, stated = fitted.trial.arm.model, robot.dh
    lengths = {"a": (found.a_mm, stated.a_mm), "d": (found.d_mm, stated.d_mm)}
    whole_mm = float(np.sum(np.abs(stated.a_mm)) + np.sum(np.abs(stated.d_mm)))
    apart = [
        (abs(new - old), f"{name} of joint {joint} {new:.4g} for {old:.4g} mm")
        for name, pair in lengths.items()
        for joint, (new, old) in enumerate(zip(*pair, strict=True), 1)
    ]
    far = sorted((each for each in apart if each[0] > _OTHER_LENGTHS * whole_mm), reverse=True)
    if not far:
        return []
    return [
        suspicion(
            "does_not_fit",
            f"{robot.name} fits with other lengths only ({', '.join(words for _, words in far)}): "
            "the arm is another one of the same build, or its description is wrong",
            one.lines(np.arange(len(one))),
            "name the robot that was measured, or correct its description",
            largest_mm=float(far[0][0]),
        )
    ]


def _moved_frames(fitted: Fitted) -> Iterator[Suspicion]:
    """Jumps of base and targets; a drift in place of the jumps of a base that drifts."""
    seen = fitted.seen.cells
    drifts = {
        float(session): fitting.drift_mm(fitted, session) for session in np.unique(seen.session)
    }
    for session, drifted in drifts.items():
        if drifted is None:
            continue
        far = ", ".join(f"{value:+.3g}" for value in drifted)
        yield suspicion(
            "drift",
            f"the base frame drifts slowly, by {far} mm (x, y, z) in the order of the file",
            seen.line[seen.session == session],
            "let arm and instrument warm up and measure again; sessions do not help. To use the "
            "file, hold out blocks of time (measurements.fold_by: time_block)",
            drift_mm=[float(value) for value in drifted],
        )
    for jump in fitted.jumps:
        if jump.target is not None or drifts[float(seen.session[jump.row])] is None:
            yield _jump(fitted, jump)


def _jump(fitted: Fitted, jump: Jump) -> Suspicion:
    seen, line = fitted.seen.cells, int(fitted.seen.cells.line[jump.row])
    called = seen.row_names.one(line)
    by = ", ".join(f"{value:+.3g}" for value in jump.shift_mm)
    if jump.target is None:
        what = (
            f"the base frame jumps before {called}, by {by} mm (x, y, z) and "
            f"{1e3 * jump.turn_rad:.3g} mrad"
        )
        fix = "give the rows before and after a session each (column session)"
        kind = "base_jump"
    else:
        name = seen.target_names[seen.target[jump.row]]
        what = f"target {name} moved before {called}, by {by} mm in the flange frame"
        fix, kind = "give the target another name from there on", "target_moved"
    return suspicion(
        kind,
        what,
        seen.lines(jump.rows),
        fix,
        first_line=line,
        shift_mm=[float(value) for value in jump.shift_mm],
        turn_mrad=1e3 * jump.turn_rad,
    )


def _largest(fitted: Fitted) -> list[Suspicion]:
    """Readings that are no outliers, and stand apart from the others all the same."""
    good = np.flatnonzero(~fitted.bad)
    poses, number = np.unique(fitted.seen.cells.pose[good], return_inverse=True)
    worst = np.zeros(len(poses))
    np.maximum.at(worst, number.ravel(), fitted.left_mm[good])
    count = tails.detached(worst)
    if not count:
        return []
    ordered = np.sort(worst)[::-1]
    apart = good[worst[number.ravel()] >= ordered[count - 1]]
    what = (
        f"{count} pose{'s are' if count > 1 else ' is'} off by "
        f"{', '.join(f'{value:.3g}' for value in ordered[:count])} mm, where the next is off by "
        f"{ordered[count]:.3g} mm: the largest error hangs on {'them' if count > 1 else 'it'}"
    )
    fix = "measure them again; exclude slips, keep what repeats: that is the arm"
    return [suspicion("largest_rows", what, fitted.seen.cells.lines(apart), fix)]


def _gross_lines(fitted: Fitted | None) -> list[int]:
    """Lines of readings more than 20 robust spreads off."""
    if fitted is None:
        return []
    off = np.flatnonzero(fitted.left_mm > _GROSS * fitted.trial.sigma_mm)
    return fitted.seen.cells.lines(off)


def _commanded(fitted: Fitted, reading: MeasuredFile, raw: rows.Raw, first, robot: Robot):
    if reading.commanded is not None:
        return commanded.compared(fitted, raw.q, raw.commanded, raw.meaning)
    return commanded.coarse(fitted, raw.q, robot.dh.prismatic)


def _outside(every: Cells, robot: Robot) -> list[Suspicion]:
    """Rows in which a joint is beyond its limits."""
    found = []
    for each in outside_limits(robot, every.q, LIMIT_SLACK):
        worst = each.values[np.argmax(np.abs(each.values))]
        found.append(
            suspicion(
                "outside_limits",
                f"joint {each.joint} reaches {worst:.4g} {each.unit}, its limits are "
                f"{each.allowed}",
                every.line[each.rows],
                "check the rows, or the limits of the robot's description",
            )
        )
    return found


def _scattered(every: Cells, repeats: noise.Repeats) -> list[Suspicion]:
    """Readings far from the others taken at the same configuration."""
    length = np.linalg.norm(repeats.deviation_mm, axis=1)
    off = np.flatnonzero(length > tails.limit(length, 3))
    if not off.size:
        return []
    largest = float(np.nanmax(length[off]))
    return [
        suspicion(
            "outliers",
            f"{off.size} reading{'s' if off.size > 1 else ''} far from the repeats at the same "
            f"configuration, by up to {largest:.3g} mm",
            every.line[off],
            "take them out, or measure them again",
            largest_mm=largest,
        )
    ]


def _once(known: list[Suspicion], lines: int) -> list[Suspicion]:
    """Suspicions without those another makes needless.

    Those of the same kind and of no other rows, and what merely shows (outliers, joints outside
    their limits) in rows of which a fault is known that is not in all ``lines`` of the file.
    """
    faults = [e for e in known if e.kind not in _SYMPTOMS and len(e.lines) < lines]
    named = set().union(*(each.lines for each in faults))
    kept: list[Suspicion] = []
    for each in known:
        rivals = [set(other.lines) for other in kept if other.kind == each.kind]
        # A second jump concerns part of the rows of the first and is another one all the same.
        jump = each.kind in _FROM_THERE_ON
        needless = any(set(each.lines) == o if jump else set(each.lines) <= o for o in rivals)
        if not needless and not (each.kind in _SYMPTOMS and set(each.lines) <= named):
            kept.append(each)
    return kept
