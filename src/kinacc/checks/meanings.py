"""What the numbers of a file mean, by trying changes on all readings.

A meaning is tried by base and target alone on a few configurations. Those that do better than the
file as written are fitted with corrections of the arm, where only a meaning that leaves less than
half is believed: errors of an arm that is far from its description do not hide so much.

A target is rigidly on the flange: seen from the flange every orientation of it is the same. How far
they scatter tells the right reading of the orientations from a wrong one, without any fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, product
from typing import TypeVar

import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation

from kinacc.calibration.frames import stacked
from kinacc.checks import changes, robust_fit
from kinacc.checks.changes import Change
from kinacc.checks.findings import Finding
from kinacc.checks.readings import Readings, thinned
from kinacc.checks.robust_fit import Trial
from kinacc.config.measured import Orientation
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import dh
from kinacc.kinematics.robot import Robot
from kinacc.progress import with_progress

FAR = 0.02  # of the points' spread: what leaves more explains nothing, of this arm
BAD_RAD = 0.02  # scatter of orientations that no arm as described leaves, calibrated or not
_WITHIN = 5.0  # times the spread of the flange, or a fifth: what points of this arm spread over
_TRIED_ROWS, _TURNED_ROWS, _FITTED_ROWS = 80, 120, 360
_GOOD = 0.01  # of the points' spread: what an arm as described may leave, uncalibrated
_SURE = 0.003  # of the spread: what leaves no more than this needs no rival
_SHOWN = 0.005  # of the spread: misfits below are the arm's own
_BETTER = 0.5  # of what the file as written leaves: more than errors of an arm can hide
_PROMISING = 0.7
_AS_GOOD = 1.5  # times the least misfit
_MAJORITY = 0.7  # share of the readings a meaning must explain
_FITTED = 4  # meanings that are fitted in full
_FRONT = 4  # meanings that are changed further
_FEWEST = 8  # configurations
_MOST_TURNS_RAD = 4.0 * np.pi
_LARGEST_RAD = 0.35  # scatter of a right reading, the arm being off by what it may be
_ORIENTATIONS = 300
_COMMON = (
    *("joint_units", "length_units", "joint_sign", "left_handed"),
    *("joint_coupling", "joint_zero", "joint_order"),
)

Changes = tuple[Change, ...]
_T = TypeVar("_T")


@dataclass(frozen=True)
class Meaning:
    """Readings as ``changes`` have them, and what base and target alone leave of them.

    ``flange`` (n, 3, 3) turns of the flange in the instrument's frame; ``misfit`` a share of the
    points' spread.
    """

    changes: Changes
    read: Readings
    flange: ndarray
    misfit: float

    @property
    def scatter_rad(self) -> float:
        """Scatter of the orientations seen from the flange, placed by the positions alone."""
        return scatter(self.flange, self.read)


def read_as(few: Readings, robot: Robot, ways: Sequence[Changes]) -> list[Meaning]:
    """The meanings of a few readings under each of ``ways``: changes one after the other."""
    read = [changed(few, applied) for applied in ways]
    by_arm = stacked([dh.forward(robot.dh, item.q_rad) for item in read])
    found = base_and_target(few, by_arm, np.stack([item.position_mm for item in read]))
    return [Meaning(*item) for item in zip(ways, read, *found, strict=True)]


def base_and_target(few: Readings, by_arm: Pose, position_mm: ndarray) -> tuple[ndarray, ndarray]:
    """Base and target alone, fitted to each of B sets of flanges and positions (B, n, 3).

    Turns (B, n, 3, 3) of the flange in the instrument's frame, and misfits (B,) as shares of the
    points' spread.
    """
    measured = Pose(np.full_like(few.rotation, np.nan), position_mm)
    every = np.ones(position_mm.shape[:2])
    _, *base, points, _ = robust_fit.placed(few, measured, by_arm, every)
    flange = compose(Pose(*(part[:, None] for part in base)), by_arm)
    if len(few.target_names) > 1:  # a part of the readings may be of another target than they say
        there = compose(invert(flange), measured).position_mm
        for target in np.unique(few.target):
            points[:, target] = np.median(there[:, few.target == target], axis=1)
    length = robust_fit.distances(few.target, measured, by_arm, Pose(*base), points)
    share = np.quantile(length, _MAJORITY, axis=1) / np.maximum(spread_mm(position_mm), 1e-12)
    return flange.rotation, share


def changed(read: Readings, applied: Iterable[Change]) -> Readings:
    """The readings after changes, one after the other."""
    for change in applied:
        read = change.of(read)
    return read


def find(read: Readings, robot: Robot, written: Trial) -> tuple[Readings, list[Finding]]:
    """The merged readings as they are meant, and the changes as findings of all lines.

    ``written`` is the fit of the readings as they stand.
    """
    # One session: each has its own base, and a meaning holds for all of them.
    part = largest_session(read, np.arange(len(read)))
    spread = float(spread_mm(part.position_mm))
    if len(np.unique(part.pose)) < _FEWEST or spread == 0.0:
        return read, []
    few = part.select(thinned(np.arange(len(part)), _TRIED_ROWS))
    (here,) = read_as(few, robot, [()])
    tried = _searched(here, robot, written.sigma_mm < _GOOD * spread)
    best = min(item.misfit for item in tried)
    if not best < _PROMISING * here.misfit:
        return read, []
    limit = min(_AS_GOOD * best, _PROMISING * here.misfit)
    # Of meanings that do equally well, the one that changes least comes first.
    close = sorted((item for item in tried if item.misfit < limit), key=_simplicity)
    many = part.select(thinned(np.arange(len(part)), _FITTED_ROWS))
    fitted = []
    for item in with_progress(close[:_FITTED], "likely ways to read the columns fitted"):
        meant = changed(many, item.changes)
        sigma_mm = robust_fit.best(meant, robust_fit.start(meant, robot.dh)).sigma_mm
        fitted.append((sigma_mm / spread_mm(meant.position_mm), sigma_mm, item.changes))
    least = min(share for share, _, _ in fitted)
    if least >= _BETTER * written.sigma_mm / spread or least > FAR:
        return read, []
    (_, found_mm, applied), *others = (item for item in fitted if item[0] < _AS_GOOD * least)
    known = {change.finding.what for change in applied}
    rivals = [{change.finding.what for change in rival} for _, _, rival in others]
    equal = next(
        (" and ".join(sorted(rival - known)) for rival in rivals if not known <= rival), ""
    )
    numbers = {"as_written_mm": written.sigma_mm, "found_mm": found_mm}
    detail = " ({as_written_mm:.3g} mm per axis as written, {found_mm:.3g} mm so{equal})"
    findings = []
    for change in applied:
        values = {**numbers, "equal": equal and f"; as well explained by: {equal}"}
        # Of a coupling that alone explains the readings, a robot file can be written.
        if "joint_map" in change.finding.values and (equal or len(applied) > 1):
            values["joint_map"] = None
        findings.append(change.finding.of_lines(read.lines(), detail, **values))
    return changed(read, applied), findings


def find_by_turns(
    read: Readings, robot: Robot, least_rad: float
) -> tuple[Readings, Finding] | None:
    """One change of the joints that brings the orientations together; None where none does.

    A joint near the target turns it without moving it much. ``least_rad`` is what other readings
    of the orientations leave: a change of the joints is preferred where it does about as well.
    """
    part = largest_session(read, np.flatnonzero(read.has_rotation))
    few = part.select(thinned(np.arange(len(part)), _TURNED_ROWS))
    single = ((change,) for change in changes.joint_changes(robot))
    here, *rivals = read_as(few, robot, [(), *single])
    limit = _AS_GOOD * max(here.misfit, _SHOWN)
    tried = [(item.scatter_rad, item) for item in rivals if item.misfit < limit]
    if not tried:
        return None
    least, value, best = _likeliest(tried)
    if least > min(_BETTER * here.scatter_rad, _AS_GOOD * least_rad):
        return None
    return changed(read, best.changes), of_turns(best.changes, read, here.scatter_rad, value)[0]


def find_orientations(
    read: Readings, stated: Orientation, flange: ndarray
) -> tuple[Changes, float, float]:
    """The best way to read the orientations, and its scatter and that as written, rad.

    As written unless another way scatters less than half, and little. ``flange`` (n, 3, 3) in the
    instrument's frame.
    """
    rows = np.flatnonzero(read.has_rotation)
    rows = rows[:: max(len(rows) // _ORIENTATIONS, 1)]
    few, flange = read.select(rows), flange[rows]
    here = scatter(flange, few)
    single = ((change,) for change in changes.orientations(stated))
    for ways in (single, product(changes.conventions(stated), changes.reversals())):
        tried = [(scatter(flange, changed(few, way)), way) for way in ways]
        least, value, way = _likeliest(tried)
        if least < min(_BETTER * here, _LARGEST_RAD):
            return way, value, here
    return (), here, here


def _likeliest(tried: list[tuple[float, _T]]) -> tuple[float, float, _T]:
    """The least scatter, and the first that does about as well: common changes come first."""
    least = min(value for value, _ in tried)
    return least, *next(pair for pair in tried if pair[0] < _AS_GOOD * least)


def of_turns(
    applied: Changes, read: Readings, before_rad: float, least_rad: float
) -> list[Finding]:
    """Findings of changes that bring orientations together, by their scatters."""
    detail = " (seen from the flange they scatter by {as_written_deg:.3g} deg as written, by "
    detail += "{found_deg:.3g} deg so)"
    degrees = np.rad2deg([before_rad, least_rad]).tolist()
    values = dict(zip(("as_written_deg", "found_deg"), degrees, strict=True))
    lines = read.lines(read.has_rotation)
    return [change.finding.of_lines(lines, detail, **values) for change in applied]


def scatter(flange: ndarray, read: Readings) -> float:
    """Angle within which most orientations agree, seen from the flange, each target by itself.

    ``flange`` (n, 3, 3) in the instrument's frame; no orientation is missing.
    """
    turns = np.swapaxes(flange, 1, 2) @ read.rotation
    angles = [
        _angles(Rotation.from_matrix(turns[read.target == n])) for n in np.unique(read.target)
    ]
    return float(np.quantile(np.concatenate(angles), _MAJORITY))


def _angles(turns: Rotation) -> ndarray:
    """Angles (n,) of rotations to their robust mean."""
    rows = np.arange(len(turns))
    for _ in range(5):
        angle = np.atleast_1d((turns[rows].mean().inv() * turns).magnitude())
        rows = np.argsort(angle)[: max(int(_MAJORITY * len(angle)), 1)]
    return angle


def spread_mm(points: ndarray) -> ndarray:
    """Root of the median squared distance of points (..., n, 3) from their middle."""
    centred = points - np.median(points, axis=-2, keepdims=True)
    return np.sqrt(np.median(np.sum(centred**2, axis=-1), axis=-1))


def largest_session(read: Readings, rows: ndarray) -> Readings:
    """The readings ``rows`` of the session with most of them."""
    part = read.select(rows)
    largest = np.argmax(np.bincount(part.session))
    part = part.select(part.session == largest)
    names = (read.session_names[largest],)
    return replace(part, session=np.zeros_like(part.session), session_names=names)


def _simplicity(meaning: Meaning) -> tuple[int, int, float]:
    """Few changes before many, common ones before rare ones, then the better."""
    kinds = [_COMMON.index(change.finding.kind) for change in meaning.changes]
    return len(kinds), sum(kinds), meaning.misfit


def _searched(here: Meaning, robot: Robot, good: bool) -> list[Meaning]:
    """Meanings tried, ever further from the file as written (``here``) until one fits.

    Only single changes of the joints where the file as written is ``good``.
    """
    tried = {_numbers(here.read): here}
    single = [(change,) for change in changes.joint_changes(robot)]
    for rivals in [single] if good else _rounds(here, robot, tried):
        ways: dict[bytes, Changes] = {}
        for applied in rivals:  # a meaning that comes again keeps the fewest changes
            ways.setdefault(_numbers(changed(here.read, applied)), applied)
        new = {numbers: ways[numbers] for numbers in ways if numbers not in tried}
        if new:
            tried.update(zip(new, read_as(here.read, robot, [*new.values()]), strict=True))
        if not good and min(item.misfit for item in tried.values()) < _SURE:
            break
    return [*tried.values()]


def _numbers(read: Readings) -> bytes:
    """Equal for meanings that are the same."""
    return np.round(np.hstack([read.q_rad, read.position_mm]), 6).tobytes()


def _rounds(here: Meaning, robot: Robot, tried: dict[bytes, Meaning]) -> Iterator[list[Changes]]:
    """Meanings by the number of their changes; ``tried`` has those of the rounds before."""
    units = [*_units(here, robot)]
    yield [*units, *((*applied, changes.left_handed()) for applied in units)]
    roots = (units or [()])[:3]
    single = [*changes.joint_changes(robot)]
    yield [(*root, change) for root in roots for change in single]
    signs = changes.joint_signs(robot)
    several = chain.from_iterable(combinations(signs, n) for n in range(2, len(signs) + 1))
    yield [(*root, *some) for some in several for root in roots]
    front: list[Meaning] = []
    for item in sorted(tried.values(), key=lambda item: item.misfit):
        mirrored = any(change.finding.kind == "left_handed" for change in item.changes)
        # Meanings that cannot be told apart count once.
        apart = all(item.misfit > 1.02 * second.misfit for second in front)
        if apart and not mirrored and len(front) < _FRONT:
            front.append(item)
    yield [(*item.changes, change) for item in front for change in single]


def _units(here: Meaning, robot: Robot) -> Iterator[Changes]:
    """Units of joints within two turns, and of positions that spread as those of this arm may."""
    for applied in ((), *((change,) for change in changes.joint_units(robot))):
        read = changed(here.read, applied)
        largest = np.abs(read.q[:, ~robot.dh.prismatic]).max(initial=0.0)
        reach_mm = max(spread_mm(dh.forward(robot.dh, read.q_rad).position_mm), 1e-12)
        for more in ((), *((change,) for change in changes.length_units())):
            share = spread_mm(changed(read, more).position_mm) / reach_mm
            if (largest <= _MOST_TURNS_RAD or not applied) and 1.0 / _WITHIN < share < _WITHIN:
                yield (*applied, *more)
