"""Single readings that are off: which of the known faults would explain each of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from kinacc.checks import robust_fit, turns
from kinacc.checks.changes import Change, Meaning
from kinacc.checks.fitting import Fitted
from kinacc.checks.robust_fit import Seen
from kinacc.checks.suspicion import Suspicion, suspicion
from kinacc.kinematics import dh
from kinacc.measurements.layout import Layout
from kinacc.measurements.orientation import rotations

_CHANCE = 0.01  # that a wrong explanation fits


@dataclass(frozen=True)
class Raw:
    """What the cells were read from: joints ``q`` (n, k) and orientations ``turns`` as written.

    ``commanded`` (n, k) joints, None where the file has none; ``earlier`` (n,) the line of an equal
    earlier reading, 0 where there is none.
    """

    q: np.ndarray
    turns: np.ndarray
    layout: Layout
    meaning: Meaning
    commanded: np.ndarray | None
    earlier: np.ndarray


def found(fitted: Fitted, raw: Raw) -> list[Suspicion]:
    """Suspicions of all bad readings, one per kind of explanation; the rest are outliers."""
    bad = np.flatnonzero(fitted.bad)
    if not bad.size:
        return []
    open_rows = bad
    suspicions = []
    for change, seen in _explanations(fitted, raw, bad):
        left = robust_fit.residuals(fitted.trial.arm, seen)
        fits = _within(left, fitted)
        rows = np.intersect1d(open_rows, bad[fits])
        if rows.size:
            suspicions.append(_of(fitted, change, rows))
            open_rows = np.setdiff1d(open_rows, rows)
    stale = open_rows[raw.earlier[open_rows] > 0]
    if stale.size:
        what = (
            f"{_count(stale, 'reading')} equal to an earlier one in every digit, and "
            f"{'do' if stale.size > 1 else 'does'} not fit the joints"
        )
        fix = "the instrument was not read anew: take the rows out"
        suspicions.append(suspicion("repeated_reading", what, fitted.seen.cells.lines(stale), fix))
        open_rows = np.setdiff1d(open_rows, stale)
    if open_rows.size:
        suspicions += _outliers(fitted, open_rows)
    return suspicions


def _within(left: robust_fit.Residuals, fitted: Fitted) -> np.ndarray:
    good = np.linalg.norm(left.position_mm, axis=1) <= fitted.limit_mm
    angle = np.linalg.norm(left.turn_rad, axis=1)
    return good & ~(angle > fitted.limit_rad)


def _of(fitted: Fitted, change: Change, rows: np.ndarray) -> Suspicion:
    lines = fitted.seen.cells.lines(rows)
    what = f"in {_count(lines, 'row')} {change.words}"
    largest = float(fitted.left_mm[rows].max())
    return suspicion(change.kind, what, lines, change.fix, largest_error_mm=largest)


def _explanations(fitted: Fitted, raw: Raw, rows: np.ndarray) -> Iterator[tuple[Change, Seen]]:
    """Every known fault undone in the readings ``rows``."""
    seen = fitted.seen.select(rows)
    q, meaning = raw.q[rows], raw.meaning
    turning = meaning.unit == 1.0
    for factor, words in ((180.0 / np.pi, "radians"), (np.pi / 180.0, "degrees")):
        change = Change("joint_units", f"the joints are in {words}", "convert the joints")
        yield change, replace(seen, q=meaning.joints(q * np.where(turning, factor, 1.0)))
    for factor, words in ((1e3, "metres"), (1e-3, "micrometres"), (25.4, "inches")):
        change = Change("length_units", f"the positions are in {words}", "convert the positions")
        yield change, _moved(seen, factor * seen.cells.position_mm)
    if raw.commanded is not None:
        change = Change(
            "commanded_joints",
            "the commanded joints fit and those read back do not",
            "see which of the two columns are the joints measured at",
        )
        yield change, replace(seen, q=meaning.joints(raw.commanded[rows]))
    yield from _turned(seen, raw, rows)
    for axis, name in enumerate("xyz"):
        mirror = np.where(np.arange(3) == axis, -1.0, 1.0)
        change = Change("left_handed", f"{name} has the wrong sign", f"negate {name}")
        moved = _moved(seen, seen.cells.position_mm * mirror)
        yield change, moved
        both = replace(moved.cells, rotation=seen.cells.rotation * np.outer(mirror, mirror))
        yield change, replace(moved, cells=both)
    for one in np.unique(fitted.seen.target):
        number = fitted.seen.cells.target[fitted.seen.target == one][0]
        others = seen.cells.target != number
        name = seen.cells.target_names[number]
        change = Change("target_swapped", f"target {name} was taken for another", "exchange them")
        if others.any():
            yield change, _only(replace(seen, target=np.full_like(seen.target, one)), others)
    for joint in range(q.shape[1]):
        signs = np.where(np.arange(q.shape[1]) == joint, -1.0, 1.0)
        change = Change(
            "joint_sign", f"joint {joint + 1} has the wrong sign", f"negate joint {joint + 1}"
        )
        yield change, replace(seen, q=meaning.joints(q * signs))
    for joint in range(1, q.shape[1]):
        for other in {joint - 1, 1} - {joint}:
            for sign, word in ((1.0, "minus"), (-1.0, "plus")):
                coupled = q.copy()
                coupled[:, joint] += sign * coupled[:, other]
                change = Change(
                    "joint_coupling",
                    f"joint {joint + 1} is given {word} joint {other + 1}",
                    "uncouple the joint, or state the coupling in the robot's joint_map",
                )
                yield change, replace(seen, q=meaning.joints(coupled))


def _only(seen: Seen, rows: np.ndarray) -> Seen:
    """The readings with those outside ``rows`` made to fit nothing."""
    position = np.where(rows[:, None], seen.cells.position_mm, np.inf)
    return _moved(seen, position)


def _moved(seen: Seen, position_mm: np.ndarray) -> Seen:
    return replace(seen, cells=replace(seen.cells, position_mm=position_mm))


def _turned(seen: Seen, raw: Raw, rows: np.ndarray) -> Iterator[tuple[Change, Seen]]:
    """The readings with their orientations read in other ways."""
    there = seen.cells.turned
    if not there.any():
        return
    numbers = raw.turns[rows][there]
    for way in turns.simple(raw.layout, numbers):
        rotation = seen.cells.rotation.copy()
        rotation[there] = way.read(numbers)
        yield way.change, replace(seen, cells=replace(seen.cells, rotation=rotation))


def as_written(raw: Raw, rows: np.ndarray) -> np.ndarray:
    """Orientations (m, 3, 3) of ``rows`` as the layout has them."""
    return rotations(raw.turns[rows], raw.layout)


def _outliers(fitted: Fitted, rows: np.ndarray) -> list[Suspicion]:
    """What no fault explains; told apart where one joint standing elsewhere explains it."""
    joint, off = _one_joint(fitted, rows)
    suspicions = []
    cells = fitted.seen.cells
    for each in np.unique(joint[joint >= 0]):
        of = rows[joint == each]
        largest = np.rad2deg(np.abs(off[joint == each]).max())
        suspicions.append(
            suspicion(
                "commanded_joints",
                f"in {_count(cells.lines(of), 'row')} joint {each + 1} alone explains what is "
                f"off, by up to {largest:.3g} deg: commanded instead of read back, or not at rest",
                cells.lines(of),
                "take the joints read back when the instrument was read",
                joint=int(each + 1),
                largest_deg=float(largest),
            )
        )
    rest = rows[joint < 0]
    if rest.size:
        worst = rest[np.argmax(fitted.left_mm[rest])]
        called = cells.row_names.one(cells.line[worst])
        angle = fitted.left_rad[rest].max()
        turned = f" and {1e3 * angle:.3g} mrad" if angle > fitted.limit_rad else ""
        suspicions.append(
            suspicion(
                "outliers",
                f"{_count(rest, 'reading')} too far from where all others put the arm: up to "
                f"{fitted.left_mm[worst]:.3g} mm{turned} at {called}, where "
                f"{fitted.limit_mm:.3g} mm is the most to be expected",
                cells.lines(rest),
                "measure them again; take out slips, keep what repeats: that is the arm",
                largest_mm=float(fitted.left_mm[worst]),
                limit_mm=fitted.limit_mm,
            )
        )
    return suspicions


def _one_joint(fitted: Fitted, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint (m,) whose displacement alone explains a reading, -1 where none, and by how much."""
    seen, arm = fitted.seen.select(rows), fitted.trial.arm
    left = robust_fit.residuals(arm, seen)
    jacobian = dh.joint_jacobian(arm.model, seen.q)
    base = arm.base.rotation[seen.base]
    swing = np.einsum("nij,nj->ni", left.flange, arm.targets.position_mm[seen.target])
    axes = base @ jacobian[:, 3:]
    moves = base @ jacobian[:, :3] + np.cross(axes, swing[:, :, None], axis=1)
    scale = fitted.limit_rad if np.isfinite(fitted.limit_rad) else np.inf
    best, size, least = np.full(len(rows), -1), np.zeros(len(rows)), np.full(len(rows), np.inf)
    turned = seen.cells.turned
    for joint in range(jacobian.shape[2]):
        direction = np.concatenate(
            [moves[:, :, joint] / fitted.limit_mm, axes[:, :, joint] / scale * turned[:, None]], 1
        )
        error = np.concatenate(
            [left.position_mm / fitted.limit_mm, np.nan_to_num(left.turn_rad) / scale], axis=1
        )
        weight = np.maximum(np.sum(direction**2, axis=1), 1e-12)
        by = -np.sum(direction * error, axis=1) / weight
        rest = np.linalg.norm(error + by[:, None] * direction, axis=1)
        # A line is hit by chance with the share of directions that pass so near it.
        free = np.where(turned, 5, 2)
        chance = jacobian.shape[2] * (1.0 / np.maximum(np.linalg.norm(error, axis=1), 1.0)) ** free
        good = (rest < 1.0) & (rest < least) & (chance < _CHANCE)
        best[good], size[good], least[good] = joint, by[good], rest[good]
    return best, size


def _count(items: np.ndarray, word: str) -> str:
    return f"{len(items)} {word}{'s' if len(items) != 1 else ''}"
