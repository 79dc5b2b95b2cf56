"""Joint values at which a calibrated arm puts its tool where it is wanted, verified one by one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from kinacc.calibrated.record import Calibration
from kinacc.errors import InputError, Problem
from kinacc.geometry import IDENTITY, Pose, compose, invert, log_so3
from kinacc.inverse import few_axes, limits, newton
from kinacc.inverse import solve as all_branches
from kinacc.inverse.onto_model import Functions, functions_of
from kinacc.models import dh
from kinacc.models.vec import VECModel
from kinacc.region import points

POSITION_TOLERANCE_MM = newton.POSITION_TOLERANCE_MM
ROTATION_TOLERANCE_RAD = newton.ROTATION_TOLERANCE_RAD
FEW_AXES_TURN_RAD = 0.05  # of an arm of four or five axes; more is another orientation
_SAME_POSTURE_RAD = 0.35  # a calibration moves joints by less, another posture by more
_SAME_RAD = 1e-5
_NEAR_START_MM = 1.0  # a posture of the plain arm, as a start on the calibrated one
_STARTS, _FEW_STARTS = 48, 16  # of the search where an arm has no list of branches
_MM_PER_RAD = 1000.0  # a sliding joint's travel counts like an arc at one metre


class Status(IntEnum):
    """What became of a wanted pose; joints are given for the first three."""

    CONVERGED = 0
    EXTRAPOLATED = 1
    OTHER_POSTURE = 2
    OUTSIDE_LIMITS = 3
    OUTSIDE_RANGE = 4
    NOT_REACHED = 5


class Compensation(NamedTuple):
    """Joints that reach n wanted poses.

    ``q_rad`` (n, k): reported joints (mm where a joint slides), NaN unless the forward model was
    seen to return to the pose within ``POSITION_TOLERANCE_MM`` and ``ROTATION_TOLERANCE_RAD``. An
    arm of four or five axes has the position alone within tolerance, and the nearest orientation it
    can take there, at most ``FEW_AXES_TURN_RAD`` away.
    ``status`` (n,): a ``Status``. ``position_error_mm`` and ``rotation_error_rad`` (n,): what is
    left at the best joints found. ``offending`` (n, k): joints outside limits or covered range.
    ``change`` (n, k): joints less those given as near, NaN without those.
    """

    q_rad: np.ndarray
    status: np.ndarray
    position_error_mm: np.ndarray
    rotation_error_rad: np.ndarray
    offending: np.ndarray
    change: np.ndarray


def compensate(
    calibration: Calibration,
    wanted: Pose,
    near_rad: np.ndarray | None = None,
    s: np.ndarray | None = None,
    frame: str = "base",
    point: str | None = None,
) -> Compensation:
    """Joints at which ``calibration`` puts ``point`` at ``wanted`` (n, ...) in ``frame``.

    Of all postures within the joint limits the one nearest to ``near_rad`` (n, k) or (k,),
    reported joints, is taken; where that is not given, the one nearest to zero among those the
    data cover. The largest joint movement counts. ``s`` (n, k): directions the joints will travel
    in, for a VEC model that knows them.
    Raises InputError for an unknown frame or point, and for poses that are no numbers.
    """
    _require_numbers(wanted)
    robot, count = calibration.robot, len(wanted.position_mm)
    carried, origin = calibration.point(point), calibration.origin(frame)
    goal = compose(invert(origin), compose(wanted, invert(carried)))
    given = near_rad is not None
    near = np.zeros(robot.dh.joints) if near_rad is None else np.atleast_2d(near_rad)
    near = np.broadcast_to(near, (count, robot.dh.joints))
    arm = _Arm(calibration, goal, near, s, carried)
    best = _Best.none(count, robot.dh.joints, given)
    if given:
        every = np.arange(count)
        best.offer(arm.judged(near @ robot.joint_map.T, every), every)
    rows = np.flatnonzero(~best.settled())
    for start, own in arm.postures(rows) if len(rows) else ():
        wanting = ~best.settled()[own]
        if wanting.any():
            best.offer(arm.judged(start[wanting], own[wanting]), own[wanting])
    return _outcome(calibration, best, near, given)


def _require_numbers(wanted: Pose) -> None:
    known = np.isfinite(wanted.position_mm).all(axis=1)
    known &= np.isfinite(wanted.rotation).all(axis=(1, 2))
    if not known.all():
        shown = ", ".join(str(row) for row in np.flatnonzero(~known)[:5])
        raise InputError(Problem("wanted poses", f"no number in row {shown}", "finite poses"))


def programmed(calibration: Calibration, q_rad: np.ndarray, point: str | None = None) -> Pose:
    """Where the nominal arm would put ``point`` in its base at reported joints (n, k)."""
    robot = calibration.robot
    end = dh.forward(robot.dh, np.atleast_2d(q_rad) @ robot.joint_map.T)
    return compose(robot.base, compose(end, calibration.programmed_point(point)))


class _Judged(NamedTuple):
    """Refined DH joints (m, k), their status, what is left (mm, rad), and how far joints moved."""

    q_dh: np.ndarray
    status: np.ndarray
    off_mm: np.ndarray
    angle_rad: np.ndarray
    movement: np.ndarray


class _Arm:
    """Wanted poses of the last DH frame, and what becomes of starts for them."""

    def __init__(
        self,
        calibration: Calibration,
        goal: Pose,
        near: np.ndarray,
        s: np.ndarray | None,
        carried: Pose,
    ) -> None:
        self.calibration, self.goal, self.near, self.s = calibration, goal, near, s
        self.has_few_axes = calibration.robot.dh.joints < few_axes.SIX
        # What is brought to the goal and verified there; an arm of few axes turns about its point.
        self.carried = carried if self.has_few_axes else IDENTITY
        self.wanted = compose(goal, self.carried)
        self.turn_tolerance_rad = FEW_AXES_TURN_RAD if self.has_few_axes else ROTATION_TOLERANCE_RAD
        self.model = calibration.model
        self.is_vec = isinstance(self.model, VECModel)
        self.plain = self.model.dh if self.is_vec else self.model
        lower, upper = limits.dh_limits(calibration.robot)
        if self.is_vec:  # of several turns, one the model speaks of
            low, high = calibration.fitted_range_rad
            cut = np.maximum(lower, low), np.minimum(upper, high)
            lower, upper = np.where(cut[0] < cut[1], cut, (lower, upper))
        self.box = lower, upper

    def judged(self, start: np.ndarray, rows: np.ndarray) -> _Judged:
        """Joints refined from ``start`` (m, k) onto the goals ``rows`` (m,), verified forward.

        A start so far from limits or covered range that no refinement brings it back is judged as
        it stands.
        """
        calibration, count = self.calibration, len(start)
        reported = limits.reported_joints(calibration.robot, start)
        reach = np.where(calibration.robot.dh.prismatic, _MM_PER_RAD, 1.0) * _SAME_POSTURE_RAD
        beyond_limits = ~_within_each(calibration, reported, reach).all(axis=1)
        beyond_range = calibration.outside_range(start, reach).any(axis=1) & self.is_vec
        hopeless = beyond_limits | beyond_range
        status = np.where(beyond_limits, Status.OUTSIDE_LIMITS, Status.OUTSIDE_RANGE)
        unknown = np.full(count, np.nan)
        found = _Judged(start.copy(), status, unknown, unknown.copy(), self._movement(start, rows))
        worth = np.flatnonzero(~hopeless)
        if len(worth):
            tried = self._tried(start[worth], rows[worth])
            for column, part in zip(found, tried, strict=True):
                column[worth] = part
        return found

    def _tried(self, start: np.ndarray, rows: np.ndarray) -> _Judged:
        calibration = self.calibration
        with np.errstate(all="ignore"):  # far outside its range a VEC model is no number
            q_dh = self._refined(start, rows)
            turned = self.turned(q_dh, rows)
            again = np.flatnonzero((np.abs(turned - q_dh) > 1.0).any(axis=1))
            q_dh[again] = turned[again]
            if len(again) and self.is_vec:  # another turn is another place of a Chebyshev series
                q_dh[again] = self._refined(turned[again], rows[again])
            off, angle = self._left(q_dh, rows)
        hit = (off <= POSITION_TOLERANCE_MM) & (angle <= self.turn_tolerance_rad)
        reported = limits.reported_joints(calibration.robot, q_dh)
        covered = ~calibration.outside_range(q_dh).any(axis=1)
        beyond = Status.OUTSIDE_RANGE if self.is_vec else Status.EXTRAPOLATED
        status = np.where(covered, Status.CONVERGED, beyond)
        inside = _within_each(calibration, reported).all(axis=1)
        status = np.where(inside, status, Status.OUTSIDE_LIMITS)
        status = np.where(hit, status, Status.NOT_REACHED)
        return _Judged(q_dh, status, off, angle, self._movement(q_dh, rows))

    def postures(self, rows: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Starts (m, k) in every posture of the plain arm at goals ``rows``, nearest first.

        Each with the goals it is for.
        """
        goal = Pose(self.goal.rotation[rows], self.goal.position_mm[rows])
        found = None
        if not self.has_few_axes:
            with suppress(InputError):
                found = all_branches(self.calibration.robot, self.plain, goal).q_rad
        if found is None:
            found = self._searched(rows)
        movement = np.full(found.shape[:2], np.inf)
        for number in range(found.shape[1]):
            there = np.flatnonzero(np.isfinite(found[:, number]).all(axis=1))
            found[there, number] = self.turned(found[there, number], rows[there])
            movement[there, number] = self._movement(found[there, number], rows[there])
        order = np.argsort(movement, axis=1, kind="stable")
        for place in range(found.shape[1]):
            chosen = order[:, place]
            own = np.arange(len(rows))
            there = np.isfinite(movement[own, chosen])
            there &= ~self._seen_before(found, movement, order, place)
            if there.any():
                yield found[own, chosen][there], rows[there]

    def turned(self, q_dh: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Revolute joints on the turn nearest to the given joints that lies within the box."""
        robot = self.calibration.robot
        lower, upper = self.box
        near = self.near[rows] @ robot.joint_map.T
        turn = 2.0 * np.pi * ~robot.dh.prismatic
        base = q_dh + turn * np.rint((near - q_dh) / (2.0 * np.pi))
        best, lowest = base, np.full(base.shape, np.inf)
        for number in (0, -1, 1, -2, 2):
            angle = base + number * turn
            outside = (angle < lower - 1e-9) | (angle > upper + 1e-9)
            cost = np.abs(angle - near) + 100.0 * outside
            better = cost < lowest - 1e-9
            best, lowest = np.where(better, angle, best), np.where(better, cost, lowest)
        return best

    def _refined(self, start: np.ndarray, rows: np.ndarray) -> np.ndarray:
        if self.s is None or not self.is_vec:
            return self._onto(functions_of(self.model, None), start, rows)
        # Travel directions differ by row, and a refinement drops rows as they converge.
        found = np.empty_like(start)
        directions, group = np.unique(self.s[rows], axis=0, return_inverse=True)
        for number, direction in enumerate(directions):
            own = np.flatnonzero(group.ravel() == number)
            found[own] = self._onto(functions_of(self.model, direction), start[own], rows[own])
        return found

    def _onto(self, of: Functions, start: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Joints (m, k) refined from ``start`` onto the goals ``rows`` (m,), reached or not."""
        wanted = Pose(self.wanted.rotation[rows], self.wanted.position_mm[rows])
        if self.has_few_axes:
            slides = self.calibration.robot.dh.prismatic
            return few_axes.refine(of.forward, of.jacobian, wanted, self.carried, start, slides)
        return newton.refine(of.forward, of.jacobian, wanted, start).q_rad

    def _left(self, q_dh: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is left, (m,) mm and (m,) rad, at DH joints (m, k) of goals ``rows``."""
        at = self.calibration.forward(q_dh, None if self.s is None else self.s[rows])
        at = compose(at, self.carried)
        off = np.linalg.norm(at.position_mm - self.wanted.position_mm[rows], axis=1)
        turned = at.rotation @ np.swapaxes(self.wanted.rotation[rows], 1, 2)
        angle = np.linalg.norm(log_so3(turned), axis=1)
        return np.nan_to_num(off, nan=np.inf), np.nan_to_num(angle, nan=np.inf)

    def _movement(self, q_dh: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Largest movement (m,) of a reported joint from those given; mm count as at one metre."""
        robot = self.calibration.robot
        apart = np.abs(limits.reported_joints(robot, q_dh) - self.near[rows])
        return np.max(apart / np.where(robot.dh.prismatic, _MM_PER_RAD, 1.0), axis=1)

    def _searched(self, rows: np.ndarray) -> np.ndarray:
        """Postures (m, starts, k) of the plain arm from starts all over its joint range."""
        robot = self.calibration.robot
        low, high = robot.q_min_rad, robot.q_max_rad
        count = _FEW_STARTS if self.has_few_axes else _STARTS
        share = points("sobol", count, robot.dh.joints)
        starts = (low + share * (high - low)) @ robot.joint_map.T
        found = np.full((len(rows), count, robot.dh.joints), np.nan)
        functions = functions_of(self.plain, None)
        for number, start in enumerate(starts):
            q_dh = self._onto(functions, np.tile(start, (len(rows), 1)), rows)
            at = compose(dh.forward(self.plain, q_dh), self.carried)
            off = np.linalg.norm(at.position_mm - self.wanted.position_mm[rows], axis=1)
            reached = off <= _NEAR_START_MM
            found[reached, number] = q_dh[reached]
        return found

    @staticmethod
    def _seen_before(
        found: np.ndarray, movement: np.ndarray, order: np.ndarray, place: int
    ) -> np.ndarray:
        """Whether the posture at ``place`` of the order is one of those before it, (m,)."""
        if place == 0:
            return np.zeros(len(found), dtype=bool)
        own = np.arange(len(found))
        seen = np.zeros(len(found), dtype=bool)
        for earlier in range(place):
            apart = np.abs(found[own, order[:, place]] - found[own, order[:, earlier]])
            seen |= apart.max(axis=1) < _SAME_RAD
        return seen


@dataclass
class _Best:
    """The best posture so far of every wanted pose."""

    q_dh: np.ndarray
    status: np.ndarray
    off_mm: np.ndarray
    angle_rad: np.ndarray
    movement: np.ndarray
    nearest: np.ndarray  # movement to the nearest posture, usable or not
    given: bool  # whether joints were given that the posture should be near to

    @classmethod
    def none(cls, count: int, joints: int, given: bool) -> _Best:
        far = np.full(count, np.inf)
        status = np.full(count, Status.NOT_REACHED)
        blank = np.full((count, joints), np.nan)
        return cls(blank, status, far.copy(), far.copy(), far.copy(), far.copy(), given)

    def settled(self) -> np.ndarray:
        """True (n,) where no other posture can be better, as they are offered nearest first."""
        if not self.given:
            return self.status == Status.CONVERGED
        return (self.status <= Status.EXTRAPOLATED) & (self.movement <= _SAME_POSTURE_RAD)

    def offer(self, found: _Judged, rows: np.ndarray) -> None:
        """Keep what is better: usable before not, then near before far, then what is left."""
        hit = found.status != Status.NOT_REACHED
        self.nearest[rows] = np.where(
            hit, np.minimum(self.nearest[rows], found.movement), self.nearest[rows]
        )
        old = self._cost(self.status[rows], self.movement[rows], self.off_mm[rows])
        new = self._cost(found.status, found.movement, found.off_mm)
        better = new < old - 1e-9
        chosen = rows[better]
        self.q_dh[chosen] = found.q_dh[better]
        self.status[chosen] = found.status[better]
        self.off_mm[chosen] = found.off_mm[better]
        self.angle_rad[chosen] = found.angle_rad[better]
        self.movement[chosen] = found.movement[better]

    def _cost(self, status: np.ndarray, movement: np.ndarray, off_mm: np.ndarray) -> np.ndarray:
        missed = status == Status.NOT_REACHED
        within = np.where(missed, np.minimum(off_mm, 1e8), np.minimum(movement, 99.0))
        usable = status <= Status.EXTRAPOLATED
        within = within + np.where((status == Status.EXTRAPOLATED) & (not self.given), 200.0, 0.0)
        return np.where(missed, 1e6, np.where(usable, 0.0, 1e3)) + within


def _outcome(calibration: Calibration, best: _Best, near: np.ndarray, given: bool) -> Compensation:
    status = best.status.copy()
    other = (status <= Status.EXTRAPOLATED) & (best.movement > best.nearest + _SAME_RAD) & given
    status[other] = Status.OTHER_POSTURE
    reported = limits.reported_joints(calibration.robot, best.q_dh)
    said = status <= Status.OTHER_POSTURE
    outside = np.where(
        (status == Status.OUTSIDE_LIMITS)[:, None],
        ~_within_each(calibration, reported),
        calibration.outside_range(best.q_dh),
    )
    q_rad = np.where(said[:, None], reported, np.nan)
    return Compensation(
        q_rad,
        status,
        best.off_mm,
        best.angle_rad,
        outside & (status != Status.NOT_REACHED)[:, None],
        q_rad - near if given else np.full(q_rad.shape, np.nan),
    )


def _within_each(
    calibration: Calibration, reported: np.ndarray, slack: np.ndarray | float = 1e-9
) -> np.ndarray:
    robot = calibration.robot
    return (reported >= robot.q_min_rad - slack) & (reported <= robot.q_max_rad + slack)
