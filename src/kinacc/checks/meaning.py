"""Find what the numbers of a file mean, by trying: units, handedness, signs, couplings.

A meaning is tried by base and target alone, in closed form, on a few configurations; those that do
better than the file as written are then fitted with corrections of the arm, where only a meaning
that leaves less than half is believed. An arm that is far from its description, but described
rightly, is so not mistaken for another.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from kinacc.checks import changes, hand_eye, robust_fit
from kinacc.checks.cells import Cells
from kinacc.checks.changes import Meaning
from kinacc.checks.robust_fit import Seen, Trial
from kinacc.kinematics import dh
from kinacc.kinematics.robot import Robot

_TRIED = "ways to read the columns tried (units, angles, signs)"
_TRIED_ROWS = 80
_FITTED_ROWS = 360
_GOOD = 0.01  # of the points' spread: what an arm as described may leave, uncalibrated
_SURE = 0.003  # of the spread: what leaves no more than this needs no rival
_BETTER = 0.5  # of what the file as written leaves: more than errors of an arm can hide
FAR = 0.02  # of the spread: what leaves more explains nothing, of this arm
_PROMISING = 0.7
_MAJORITY = 0.7  # share of the readings a meaning must explain
_FITTED = 4  # meanings that are fitted in full
_FRONT = 4  # meanings that are changed further
_FEWEST = 8  # configurations
_MOST_TURNS_RAD = 4.0 * np.pi

_RARITY = (
    *("joint_units", "length_units", "joint_sign", "left_handed"),
    *("joint_coupling", "joint_zero", "joint_order"),
)

Progress = Callable[[Iterable, str], Iterable]


@dataclass(frozen=True)
class Finding:
    """What the file means; ``equal`` are other meanings that explain it as well.

    ``as_written_mm`` and ``found_mm``: standard deviation per axis left by the file as written and
    by the meaning found, arm corrected, each in the millimetres it takes the positions for.
    """

    meaning: Meaning
    equal: tuple[Meaning, ...]
    as_written_mm: float
    found_mm: float


def seen_as(cells: Cells, meaning: Meaning) -> Seen:
    """The cells as a meaning has them."""
    known = replace(
        cells,
        position_mm=meaning.positions(cells.position_mm),
        rotation=meaning.rotations(cells.rotation),
    )
    return Seen(known, meaning.joints(cells.q), cells.session, cells.target)


def find(cells: Cells, robot: Robot, written: Trial, progress: Progress) -> Finding:
    """The meaning of merged ``cells`` of which ``written`` is the fit as they stand."""
    spread = _spread(cells.position_mm)
    as_it_is = changes.as_written(robot.joint_map)
    here = Finding(as_it_is, (), written.sigma_mm, written.sigma_mm)
    if len(np.unique(cells.pose)) < _FEWEST or spread == 0.0:
        return here
    # One session: each has its own base, and a meaning holds for all of them.
    largest = np.argmax(np.bincount(cells.session))
    part = cells.select(np.flatnonzero(cells.session == largest))
    few = part.select(hand_eye.thinned(np.arange(len(part)), _TRIED_ROWS))
    misfit = Misfit(few, robot)
    least = misfit(as_it_is)
    good = written.sigma_mm < _GOOD * spread
    wanted = _each_once(_searched(misfit, as_it_is, robot, good, progress))
    better = [(value, each) for value, each in wanted if value < _PROMISING * least]
    if not better:
        return here
    better.sort(key=lambda pair: pair[0])
    # Of meanings that do equally well, the one that changes least comes first.
    best = better[0][0]
    close = [pair for pair in better if pair[0] < 1.5 * best]
    close.sort(key=lambda pair: (*_simplicity(pair[1]), pair[0]))
    many = part.select(hand_eye.thinned(np.arange(len(part)), _FITTED_ROWS))
    fitted = [
        (_left(many, robot, each), each)
        for _, each in progress(close[:_FITTED], "likely ways to read the columns fitted")
    ]
    smallest = min(value for value, _ in fitted)
    if smallest >= _BETTER * _left(many, robot, as_it_is) or smallest > FAR * spread:
        return here
    left, found = next((value, each) for value, each in fitted if value < 1.5 * smallest)
    equal = [e for value, e in fitted if value < 1.5 * smallest and not found.part_of(e)]
    return Finding(found, tuple(equal), written.sigma_mm, left * found.scale)


def _each_once(tried: Iterable[tuple[float, Meaning]]) -> list[tuple[float, Meaning]]:
    """Meanings that differ, each as it was found first: with the fewest changes."""
    found: dict[tuple, tuple[float, Meaning]] = {}
    for value, each in tried:
        found.setdefault(each.numbers, (value, each))
    return list(found.values())


def _simplicity(meaning: Meaning) -> tuple[int, int]:
    """Few changes before many, common ones before rare ones."""
    return len(meaning.changes), sum(_RARITY.index(change.kind) for change in meaning.changes)


def _searched(misfit, as_it_is: Meaning, robot: Robot, good: bool, progress: Progress):
    """Meanings tried with their misfits; the whole search only where the file as written fails."""
    slides = robot.dh.prismatic
    if good:
        for each in progress(
            list(changes.single(as_it_is, slides)),
            _TRIED,
        ):
            yield misfit(each), each
        return
    tried: list[tuple[float, Meaning]] = []
    for rivals in _rounds(misfit, as_it_is, robot, tried):
        found = [(misfit(each), each) for each in progress(rivals, _TRIED)]
        yield from found
        tried += found
        if tried and min(value for value, _ in tried) < _SURE:
            return


def _rounds(misfit, as_it_is: Meaning, robot: Robot, tried: list) -> Iterator[list[Meaning]]:
    """Meanings ever further from the file as written; ``tried`` has those of the rounds before."""
    slides = robot.dh.prismatic
    units = []
    for meaning in changes.of_units(as_it_is, misfit.cells.q, slides, _MOST_TURNS_RAD):
        units += changes.of_scale(meaning, misfit.ratio(meaning))
    roots = units or [as_it_is]
    yield units + [changes.mirrored(each) for each in units]
    yield [each for root in roots[:3] for each in changes.single(root, slides)]
    joints = range(len(slides))
    signs = [some for count in range(2, len(slides) + 1) for some in combinations(joints, count)]
    yield [changes.of_signs(root, some) for root in roots[:3] for some in signs]
    for _ in range(2):
        front = _different(sorted(tried, key=lambda pair: pair[0]))
        yield [each for root in front for each in changes.single(root, slides)]


def _different(ranked: list[tuple[float, Meaning]]) -> list[Meaning]:
    """The best meanings of different misfit: what cannot be told apart counts once."""
    front: list[tuple[float, Meaning]] = []
    for value, each in ranked:
        if not each.mirrored and all(value > 1.02 * other for other, _ in front):
            front.append((value, each))
        if len(front) == _FRONT:
            break
    return [each for _, each in front]


@dataclass(frozen=True)
class Misfit:
    """Misfit of base and target alone, as a share of the points' spread."""

    cells: Cells
    robot: Robot

    def __call__(self, meaning: Meaning) -> float:
        left = np.linalg.norm(self._left(meaning).position_mm, axis=1)
        points = meaning.positions(self.cells.position_mm)
        return float(np.quantile(left, _MAJORITY)) / max(_spread(points), 1e-12)

    def flange(self, meaning: Meaning) -> np.ndarray:
        """Rotations (n, 3, 3) of the flange in the instrument's frame, by the positions alone."""
        return self._left(meaning).flange

    def _left(self, meaning: Meaning) -> robust_fit.Residuals:
        seen = seen_as(self.cells, meaning)
        points = replace(seen.cells, rotation=np.full_like(seen.cells.rotation, np.nan))
        one = Seen(points, seen.q, np.zeros_like(seen.base), seen.target)
        return robust_fit.residuals(hand_eye.found(one, self.robot.dh, draws=0, stretches=()), one)

    def ratio(self, meaning: Meaning) -> float:
        """Spread of the measured points over that of the flange."""
        flange = dh.forward(self.robot.dh, meaning.joints(self.cells.q)).position_mm
        return _spread(meaning.positions(self.cells.position_mm)) / max(_spread(flange), 1e-12)


def _left(cells: Cells, robot: Robot, meaning: Meaning) -> float:
    """Standard deviation per axis left by the corrected arm, in the file's own lengths."""
    seen = seen_as(cells, meaning)
    seen = Seen(seen.cells, seen.q, np.zeros_like(seen.base), seen.target)
    fitted = robust_fit.best(seen, hand_eye.found(seen, robot.dh))
    return fitted.sigma_mm / meaning.scale


def _spread(points: np.ndarray) -> float:
    centred = points - np.median(points, axis=0)
    return float(np.sqrt(np.median(np.sum(centred**2, axis=1))))
