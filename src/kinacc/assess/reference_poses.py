"""Reference poses, read again by plan: whether the frame drifted or jumped, and what corrects it.

The first rows of the random order are the reference poses. They are read first, and again at
places of the sequence that are fixed beforehand: at its start, evenly between and at its end. Only
differences between readings of one pose are looked at, so nothing has to be known of its error.

A change has one of a number of shapes over the readings: linear in time, or a step at one of the
gaps between them. Each shape is centred pose by pose, so that the errors of the poses drop out.
What a shape explains is a square of three standard normal components where nothing changed; where
the noise is known up to a factor only, it is taken as a part of the square of all that is left of
the readings. Proofs: docs/alarms.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy

from kinacc.assess.adaptive import Ledger
from kinacc.assess.statement import Reason

POSES = 5  # reference poses of a plan with at least four revisits of each
FALSE_ALARMS = 0.005  # of campaigns without drift or step, all stages together
_EARLIER = 0.2  # of these, spent on the stages before the last
_LEAST_FREEDOM = 6.0  # of readings that have to tell a change and their noise
_BESIDE = 5.0  # times a stage's false alarms, where the readings say their noise themselves
_OF_DRIFT = 0.6  # of the false alarms of a stage, for the linear drift; steps share the rest
_LEAST_ROUNDS = 3  # readings of every reference pose before the first look


@dataclass(frozen=True)
class Schedule:
    """Where in a sequence of ``measurements`` readings the reference poses are read.

    ``row_at``: row of the pose to read at a place (0 = first), for all planned places. Rows 0 to
    ``poses`` - 1, each read ``revisits`` / ``poses`` times again.
    """

    measurements: int
    poses: int
    row_at: Mapping[int, int]

    def left(self, taken: int) -> int:
        """Planned readings that are still to come after so many."""
        return sum(place >= taken for place in self.row_at)

    def visit(self, first: int) -> tuple[int, ...]:
        """Rows in the order in which they are read whatever is read, ``first`` rows being visited.

        Ends where readings decide for the first time.
        """
        rows, unvisited = [], iter(range(self.poses, first))
        for place in range(self.measurements):
            row = self.row_at.get(place)
            if row is None and (row := next(unvisited, None)) is None:
                break
            rows.append(row)
        return tuple(rows)


def schedule(measurements: int, points: int, references: int) -> Schedule:
    """Places of the first readings of the reference poses and of ``references`` revisits.

    A quarter of the revisits follows the first readings, a quarter ends the sequence, the rest
    is spread evenly between: of 20 revisits 5, 10 and 5. Each revisit takes the next pose in turn.
    """
    poses = min(poses_of(references), points)
    start, end = references // 4, -(-references // 4)
    between = references - start - end
    low, high = poses + start, measurements - end
    places = [*range(low)]
    places += [low + (revisit + 1) * (high - low) // (between + 1) for revisit in range(between)]
    places += range(high, measurements)
    return Schedule(measurements, poses, {place: k % poses for k, place in enumerate(places)})


def poses_of(references: int) -> int:
    """Number of reference poses for a number of revisits: four of each, 5 poses at most."""
    return min(POSES, max(references // 4, 1)) if references else 0


class Readings(NamedTuple):
    """Readings of reference poses in their order: place, pose, vector (n, 3), covariance."""

    place: np.ndarray
    row: np.ndarray
    vector_mm: np.ndarray
    covariance_mm2: np.ndarray


def planned_readings(plan: Schedule, ledger: Ledger) -> Readings:
    """Of the readings of a ledger, those planned of reference poses."""
    place = [index for index in plan.row_at if index < ledger.taken]
    rows = np.array([plan.row_at[index] for index in place], dtype=np.intp)
    return Readings(np.array(place), rows, *ledger.at(place))


@dataclass(frozen=True)
class Change:
    """What the references say of a change of the frame.

    ``between``: the readings (from 1) before and after a step; None for a drift. ``change_mm``
    (3,): over the whole campaign, or of the step; ``deviation_mm``: its standard deviation per
    axis, the largest. ``is_found``: beyond what chance shows. ``unseen_mm``: size of the drift over
    the campaign that is found in half of the cases.
    """

    between: tuple[int, int] | None
    change_mm: tuple[float, float, float]
    deviation_mm: float
    is_found: bool
    unseen_mm: float

    @property
    def reason(self) -> Reason:
        """The finding as a reason for stating no bounds."""
        x, y, z = self.change_mm
        size, deviation = math.hypot(x, y, z), self.deviation_mm
        numbers = {"size": size, "x": x, "y": y, "z": z, "deviation": deviation}
        if self.between is None:
            return Reason("drift", numbers)
        return Reason("step", numbers | {"after": self.between[0], "before": self.between[1]})


def stages(plan: Schedule) -> tuple[tuple[int, float], ...]:
    """Numbers of reference readings at which they are looked at, each with its false alarms."""
    total = len(plan.row_at)
    earlier = range(_LEAST_ROUNDS * plan.poses, total, plan.poses)
    share = _EARLIER * FALSE_ALARMS / max(len(earlier), 1)
    return (*((count, share) for count in earlier), (total, FALSE_ALARMS - share * len(earlier)))


def find_change(plan: Schedule, readings: Readings, freedom: float = math.inf) -> Change | None:
    """What the readings show at the last stage reached; found is what any stage found.

    ``freedom``: inf where the noise is as stated. Otherwise it is right up to one factor, and this
    is the number of degrees of freedom of an earlier test that found the factor 1 (0: no test).
    None before the first stage.
    """
    change, is_found = None, False
    for count, error in stages(plan):
        degrees = freedom + 3.0 * (count - plan.poses)
        if count <= len(readings.place) and degrees > _LEAST_FREEDOM:
            first = Readings(*(column[:count] for column in readings))
            change = _at_stage(plan, first, error, freedom)
            is_found = is_found or change.is_found
    return replace(change, is_found=is_found) if change else None


def _at_stage(plan: Schedule, readings: Readings, error: float, freedom: float) -> Change:
    place, row, vectors, covariances = readings
    count = len(place)
    root = np.linalg.cholesky(covariances.mean(axis=0))
    inverse = np.linalg.inv(root)
    # A reading's covariance is at most the mean one over its weight: less weight than due at most.
    weight = 1.0 / np.linalg.eigvalsh(inverse @ covariances @ inverse.T)[:, -1]
    poses = (row[:, None] == np.unique(row)) * np.sqrt(weight)[:, None]
    poses = poses / np.linalg.norm(poses, axis=0)

    def centred(values: np.ndarray) -> np.ndarray:
        """Values (.., n) by the roots of their weights, without the weighted mean of their pose."""
        values = values * np.sqrt(weight)
        return values - (values @ poses) @ poses.T

    # Before and after each gap lies a reading of every pose.
    gaps = np.arange(plan.poses, count - plan.poses + 1)
    shapes = np.vstack([place / plan.measurements, np.arange(count) >= gaps[:, None]])
    shapes, whitened = centred(shapes), centred(inverse @ vectors.T)  # (shapes, n), (3, n)
    length = np.linalg.norm(shapes, axis=1)
    along = shapes / length[:, None] @ whitened.T  # (shapes, 3)
    square, within = np.sum(along**2, axis=1), float(np.sum(whitened**2))
    degrees = 3.0 * (count - plan.poses)
    factor, stands_out = 1.0, True
    if math.isfinite(freedom):
        within, freedom = within + freedom, degrees + freedom
        square, factor = square / within, math.sqrt((within - square.max()) / (freedom - 3.0))
    elif degrees > _LEAST_FREEDOM:
        # Noise larger than stated, or one reading that went wrong, is no change: that has to stand
        # out from the scatter of the readings as well.
        stands_out = bool(
            np.any(square / within > _thresholds(len(shapes), _BESIDE * error, degrees))
        )
    least = _thresholds(len(shapes), error, freedom)
    best = _likelier(square, freedom)
    widest = factor * math.sqrt(float(np.linalg.eigvalsh(root @ root.T)[-1]))
    x, y, z = (root @ along[best] / length[best]).tolist()
    before = gaps[best - 1]
    return Change(
        between=(int(place[before - 1]) + 1, int(place[before]) + 1) if best else None,
        change_mm=(x, y, z),
        deviation_mm=float(widest / length[best]),
        is_found=stands_out and bool(np.any(square > least)),
        unseen_mm=float(widest / length[0] * _half_found(float(least[0]), freedom)),
    )


def _thresholds(shapes: int, error: float, freedom: float) -> np.ndarray:
    """Squares (shapes,) of which one is exceeded with probability ``error`` at most, no change."""
    shares = np.full(shapes, error * (1.0 - _OF_DRIFT) / (shapes - 1))
    shares[0] = error * _OF_DRIFT
    if math.isinf(freedom):
        return scipy.special.chdtri(3.0, shares)
    return 1.0 - scipy.special.betaincinv(0.5 * (freedom - 3.0), 1.5, shares)


def _likelier(square: np.ndarray, freedom: float) -> int:
    """The shape to name: the drift, or the step that fits best where steps are likelier on average.

    So a step, which has many places to fit by chance, is not preferred for their number.
    """
    likely = 0.5 * square if math.isinf(freedom) else -0.5 * freedom * np.log1p(-square)
    steps = likely[1:]
    if likely[0] >= np.logaddexp.reduce(steps) - math.log(steps.size):
        return 0
    return 1 + int(np.argmax(steps))


def _half_found(least: float, freedom: float) -> float:
    """Length of a mean (3,), in standard deviations, whose square exceeds ``least`` half the time.

    Of the linear drift alone: steps only add to what is found.
    """
    if math.isinf(freedom):
        return math.sqrt(float(scipy.special.chndtrinc(least, 3.0, 0.5)))
    ratio = least / (1.0 - least) * (freedom - 3.0) / 3.0
    return math.sqrt(float(scipy.special.ncfdtrinc(3.0, freedom - 3.0, 0.5, ratio)))
