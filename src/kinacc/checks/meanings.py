"""What the numbers of a file mean: units, hand, signs, couplings, zeros and order, by trying.

A meaning is tried by base and target alone on a few configurations. Those that do better than the
file as written are fitted with corrections of the arm, where only a meaning that leaves less than
half is believed: errors of an arm that is far from its description do not hide so much.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy import ndarray

from kinacc.checks import orientations, robust_fit
from kinacc.checks.findings import Finding, finding
from kinacc.checks.readings import Readings, thinned
from kinacc.checks.report import Progress
from kinacc.checks.robust_fit import Trial
from kinacc.kinematics import dh
from kinacc.kinematics.robot import Robot

FAR = 0.02  # of the points' spread: what leaves more explains nothing, of this arm
BAD_RAD = 0.02  # scatter of orientations that no arm as described leaves, calibrated or not
MIRROR = np.array([1.0, -1.0, 1.0])  # any mirror will do: the base frame takes up the rest
# Units of positions: the finding, and the factor to the stated one.
LENGTHS = (
    (finding("length_units", unit="metres", short="m", setting={"length_unit": "m"}), 1e3),
    (finding("length_units/other", unit="centimetres"), 10.0),
    (finding("length_units/other", unit="inches"), 25.4),
    (finding("length_units/small", setting={"length_unit": "mm"}), 1e-3),
)
_WITHIN = 5.0  # times the spread of the flange, or a fifth: what points of this arm spread over
_TRIED = "ways to read the columns tried (units, angles, signs)"
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
_COMMON = (
    *("joint_units", "length_units", "joint_sign", "left_handed"),
    *("joint_coupling", "joint_zero", "joint_order"),
)


@dataclass(frozen=True)
class Meaning:
    """What the numbers of a file mean: DH joints are ``matrix @ (unit * q) + zero``.

    ``matrix`` (k, k), ``unit`` and ``zero`` (k,) act on joints as read; positions are multiplied by
    ``scale`` and, where ``mirrored``, by ``MIRROR``. ``changes`` are its findings.
    """

    matrix: ndarray
    unit: ndarray
    zero: ndarray
    scale: float = 1.0
    mirrored: bool = False
    changes: tuple[Finding, ...] = ()

    def joints(self, q: ndarray) -> ndarray:
        """DH joint values (n, k) of joints as read (n, k)."""
        return (q * self.unit) @ self.matrix.T + self.zero

    def applied(self, read: Readings) -> Readings:
        """The readings as this meaning has them."""
        mirror = MIRROR if self.mirrored else np.ones(3)
        position_mm = read.position_mm * self.scale * mirror
        rotation = read.rotation * np.outer(mirror, mirror)
        return replace(read, q_rad=self.joints(read.q), position_mm=position_mm, rotation=rotation)

    def changed(self, change: Finding, **values: Any) -> Meaning:
        """This meaning with one more change."""
        return replace(self, changes=(*self.changes, change), **values)


def as_written(joint_map: ndarray) -> Meaning:
    """The file means what it says."""
    joints = len(joint_map)
    return Meaning(np.array(joint_map, dtype=float), np.ones(joints), np.zeros(joints))


def of_units(meaning: Meaning, q: ndarray, slides: ndarray) -> Iterator[Meaning]:
    """The meaning, and those with joints (n, k) in another unit that stays within two turns."""
    yield meaning
    largest = float(np.abs(q[:, ~slides]).max(initial=0.0))
    for unit, stated, short, factor in orientations.ANGLE_UNITS:
        few_turns = (np.rad2deg(largest) if short == "rad" else largest) <= _MOST_TURNS_RAD
        if few_turns == (short == "rad") and not slides.all():
            setting = {"joint_unit": short}
            change = finding("joint_units", unit=unit, stated=stated, short=short, setting=setting)
            yield meaning.changed(change, unit=np.where(slides, 1.0, factor))
    for unit, factor in (("metres", 1e3), ("millimetres", 1e-3)) if slides.any() else ():
        change = finding("joint_units/sliding", unit=unit)
        yield meaning.changed(change, unit=np.where(slides, factor, 1.0))


def of_scale(meaning: Meaning, ratio: float) -> Iterator[Meaning]:
    """Positions in a unit that brings their spread, now ``ratio`` times the arm's, within reach."""
    if 1.0 / _WITHIN < ratio < _WITHIN:
        yield meaning
    for change, factor in LENGTHS:
        if 1.0 / _WITHIN < ratio * factor < _WITHIN:
            yield meaning.changed(change, scale=factor)


def of_signs(meaning: Meaning, joints: Iterable[int]) -> Meaning:
    """The meaning with the joints (0-based) counting the other way."""
    signs = np.where(np.isin(np.arange(len(meaning.unit)), list(joints)), -1.0, 1.0)
    changes = [finding("joint_sign", joint=joint + 1) for joint in joints]
    return replace(meaning, matrix=meaning.matrix * signs, changes=(*meaning.changes, *changes))


def coupled(meaning: Meaning, joint: int, second: int, sign: float) -> Meaning:
    """The meaning with a joint of the file counted from another one (0-based)."""
    coupling = np.eye(len(meaning.unit))
    coupling[joint, second] = sign
    matrix = meaning.matrix @ coupling + 0.0
    rows = (f"[{', '.join(f'{value:g}' for value in row)}]" for row in matrix)
    change = finding(
        "joint_coupling",
        joint=joint + 1,
        other=second + 1,
        sign="plus" if sign > 0 else "minus",
        map=f"[{', '.join(rows)}]",
    )
    return meaning.changed(change, matrix=matrix)


def single(meaning: Meaning, slides: ndarray) -> Iterator[Meaning]:
    """Every meaning one change of the joints away: signs, couplings, zeros, order."""
    joints = range(len(slides))
    signed = {item.values["joint"] for item in meaning.changes if item.kind == "joint_sign"}
    yield from (of_signs(meaning, (joint,)) for joint in joints if joint + 1 not in signed)
    for joint, second in permutations(joints, 2):
        if not slides[[joint, second]].any():
            yield from (coupled(meaning, joint, second, sign) for sign in (1.0, -1.0))
    for joint in joints[1:-1]:  # of the first and last, base and tool take it up
        for zero_deg in () if slides[joint] else (90.0, -90.0, 180.0):
            zero = meaning.zero + np.deg2rad(zero_deg) * (np.array(joints) == joint)
            change = finding("joint_zero", joint=joint + 1, zero_deg=zero_deg)
            yield meaning.changed(change, zero=zero)
    for joint, second in combinations(joints, 2):
        if slides[joint] == slides[second]:
            order = np.array(joints)
            order[[joint, second]] = second, joint
            change = finding("joint_order", joint=joint + 1, other=second + 1)
            yield meaning.changed(change, matrix=meaning.matrix[:, order])


@dataclass(frozen=True)
class Misfit:
    """Misfit of base and target alone, as a share of the points' spread."""

    read: Readings
    robot: Robot

    def __call__(self, meaning: Meaning) -> float:
        remaining = np.linalg.norm(self._left(meaning).position_mm, axis=1)
        points = meaning.applied(self.read).position_mm
        return float(np.quantile(remaining, _MAJORITY)) / max(spread_mm(points), 1e-12)

    def turns(self, meaning: Meaning) -> float:
        """Scatter of the orientations seen from the flange, placed by the positions alone, rad."""
        rotation = meaning.applied(self.read).rotation
        return orientations.scatter(self._left(meaning).flange, rotation, self.read.target)

    def ratio(self, meaning: Meaning) -> float:
        """Spread of the measured points over that of the flange."""
        observed = meaning.applied(self.read)
        flange = dh.forward(self.robot.dh, observed.q_rad).position_mm
        return spread_mm(observed.position_mm) / max(spread_mm(flange), 1e-12)

    def _left(self, meaning: Meaning) -> robust_fit.Residuals:
        observed = meaning.applied(self.read)
        observed = replace(observed, rotation=np.full_like(observed.rotation, np.nan))
        begin = robust_fit.start(observed, self.robot.dh, draws=0, stretches=())
        return robust_fit.residuals(begin, observed)


def find(
    read: Readings, robot: Robot, written: Trial, progress: Progress
) -> tuple[Meaning, tuple[Finding, ...]]:
    """The meaning of merged ``read``, and its changes as findings of all lines.

    ``written`` is the fit of the readings as they stand.
    """
    spread = spread_mm(read.position_mm)
    here = as_written(robot.joint_map)
    if len(np.unique(read.pose)) < _FEWEST or spread == 0.0:
        return here, ()
    # One session: each has its own base, and a meaning holds for all of them.
    part = _largest_session(read, np.arange(len(read)))
    misfit = Misfit(part.select(thinned(np.arange(len(part)), _TRIED_ROWS)), robot)
    least = misfit(here)
    tried: dict[tuple[Any, ...], tuple[float, Meaning]] = {}
    for value, item in _searched(misfit, here, written.sigma_mm < _GOOD * spread, progress):
        # A meaning that comes again keeps the fewest changes.
        numbers = (item.matrix.tobytes(), item.unit.tobytes(), item.zero.tobytes())
        tried.setdefault((*numbers, item.scale, item.mirrored), (value, item))
    best = min(value for value, _ in tried.values())
    if not best < _PROMISING * least:
        return here, ()
    limit = min(_AS_GOOD * best, _PROMISING * least)
    close = [pair for pair in tried.values() if pair[0] < limit]
    # Of meanings that do equally well, the one that changes least comes first.
    close.sort(key=lambda pair: (*_simplicity(pair[1]), pair[0]))
    many = part.select(thinned(np.arange(len(part)), _FITTED_ROWS))
    fitted = [
        (_left_mm(many, robot, item), item)
        for _, item in progress(close[:_FITTED], "likely ways to read the columns fitted")
    ]
    smallest = min(value for value, _ in fitted)
    if smallest >= _BETTER * _left_mm(many, robot, here) or smallest > FAR * spread:
        return here, ()
    (remaining, results), *others = (e for e in fitted if e[0] < _AS_GOOD * smallest)
    texts = {change.what for change in results.changes}
    rivals = []
    for _, item in others:
        parts = [change.what for change in item.changes]
        if not texts <= {*parts}:
            rivals.append(" and ".join(text for text in parts if text not in texts))
    rivals = list(dict.fromkeys(filter(None, rivals)))[:3]
    detail = " ({as_written_mm:.3g} mm per axis as written, {found_mm:.3g} mm so{equal})"
    equal = f"; as well explained by: {', or '.join(rivals)}" if rivals else ""
    alone = len(results.changes) == 1 and results.changes[0].kind == "joint_coupling" and not rivals
    more = {"joint_map": results.matrix.tolist()} if alone else {}
    findings = [
        change.of_lines(
            read.lines(),
            detail,
            as_written_mm=written.sigma_mm,
            found_mm=remaining * results.scale,
            equal=equal,
            **more,
        )
        for change in results.changes
    ]
    return results, tuple(findings)


def find_by_turns(
    read: Readings, robot: Robot, here: Meaning, least_rad: float
) -> tuple[Meaning, Finding] | None:
    """One change of the joints that brings the orientations together; None where none does.

    A joint near the target turns it without moving it much. ``least_rad`` is what other readings
    of the orientations leave: a change of the joints is preferred where it does about as well.
    """
    part = _largest_session(read, np.flatnonzero(read.has_rotation))
    misfit = Misfit(part.select(thinned(np.arange(len(part)), _TURNED_ROWS)), robot)
    limit = _AS_GOOD * max(misfit(here), _SHOWN)
    rivals = [item for item in single(here, robot.dh.prismatic) if misfit(item) < limit]
    tried = [(misfit.turns(item), item) for item in rivals]
    least = min((value for value, _ in tried), default=np.inf)
    if not least <= min(orientations.BETTER * misfit.turns(here), _AS_GOOD * least_rad):
        return None
    # The common changes come first: of those that do about as well, the first.
    value, results = next(pair for pair in tried if pair[0] < _AS_GOOD * least)
    texts = orientations.change_finding(
        results.changes[-1], read, read.has_rotation, misfit.turns(here), value
    )
    return results, texts


def _largest_session(read: Readings, rows: ndarray) -> Readings:
    """The readings ``rows`` of the session with most of them."""
    part = read.select(rows)
    largest = np.argmax(np.bincount(part.session))
    part = part.select(part.session == largest)
    names = (read.session_names[largest],)
    return replace(part, session=np.zeros_like(part.session), session_names=names)


def _simplicity(meaning: Meaning) -> tuple[int, int]:
    """Few changes before many, common ones before rare ones."""
    return len(meaning.changes), sum(_COMMON.index(change.kind) for change in meaning.changes)


def _searched(
    misfit: Misfit, here: Meaning, good: bool, progress: Progress
) -> Iterator[tuple[float, Meaning]]:
    """Meanings tried with their misfits, ever further from the file as written until one fits.

    Only single changes of the joints where the file as written is ``good``.
    """
    slides = misfit.robot.dh.prismatic
    tried: list[tuple[float, Meaning]] = []
    rounds = [single(here, slides)] if good else _rounds(misfit, here, tried)
    for rivals in rounds:
        results = [(misfit(item), item) for item in progress(list(rivals), _TRIED)]
        yield from results
        tried += results
        if not good and min((value for value, _ in tried), default=np.inf) < _SURE:
            return


def _rounds(
    misfit: Misfit, here: Meaning, tried: list[tuple[float, Meaning]]
) -> Iterator[Iterable[Meaning]]:
    """Meanings by the number of their changes; ``tried`` has those of the rounds before."""
    slides = misfit.robot.dh.prismatic
    units = [
        scaled
        for item in of_units(here, misfit.read.q, slides)
        for scaled in of_scale(item, misfit.ratio(item))
    ]
    change = finding("left_handed")
    yield units + [item.changed(change, mirrored=True) for item in units]
    roots = (units or [here])[:3]
    yield [item for root in roots for item in single(root, slides)]
    joints = range(len(slides))
    signs = [some for count in joints[1:] for some in combinations(joints, count + 1)]
    yield [of_signs(root, some) for root in roots for some in signs]
    for _ in range(2):
        front: list[tuple[float, Meaning]] = []
        for value, item in sorted(tried, key=lambda pair: pair[0]):
            # Meanings that cannot be told apart count once.
            apart = all(value > 1.02 * second for second, _ in front)
            if apart and not item.mirrored and len(front) < _FRONT:
                front.append((value, item))
        yield [item for _, root in front for item in single(root, slides)]


def _left_mm(read: Readings, robot: Robot, meaning: Meaning) -> float:
    """Standard deviation per axis left by the corrected arm, in the file's own lengths."""
    observed = meaning.applied(read)
    return robust_fit.best(observed, robust_fit.start(observed, robot.dh)).sigma_mm / meaning.scale


def spread_mm(points: ndarray) -> float:
    """Root of the median squared distance of points (n, 3) from their middle."""
    centred = points - np.median(points, axis=0)
    return float(np.sqrt(np.median(np.sum(centred**2, axis=1))))
