"""Postures of a calibrated arm: each refined onto a wanted pose and verified by the model."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from kinacc.deployment.record import Calibration
from kinacc.errors import InputError
from kinacc.geometry import IDENTITY, Pose, compose, log_so3
from kinacc.kinematics import dh
from kinacc.kinematics.inverse import few_axes, limits, newton
from kinacc.kinematics.inverse import solve as all_branches
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.region import points

POSITION_TOLERANCE_MM = newton.POSITION_TOLERANCE_MM
ROTATION_TOLERANCE_RAD = newton.ROTATION_TOLERANCE_RAD
FEW_AXES_TURN_RAD = 0.05  # of an arm of four or five axes; more is another orientation
SAME_POSTURE_RAD = 0.35  # a calibration moves joints by less, another posture by more
SAME_RAD = 1e-5
_NEAR_START_MM = 1.0  # a posture of the plain arm, as a start on the calibrated one
_STARTS, _FEW_STARTS = 48, 16  # of the search where an arm has no list of branches


class PoseStatus(IntEnum):
    """What became of a wanted pose; joints are given for the first three."""

    CONVERGED = 0
    EXTRAPOLATED = 1
    OTHER_POSTURE = 2
    OUTSIDE_LIMITS = 3
    OUTSIDE_RANGE = 4
    NOT_REACHED = 5


class Judged(NamedTuple):
    """Refined DH joints (m, k), their status, what is left (mm, rad), and how far joints moved."""

    q_dh: np.ndarray
    status: np.ndarray
    off_mm: np.ndarray
    angle_rad: np.ndarray
    movement: np.ndarray


class Goals:
    """Wanted poses of the last DH frame, and what becomes of starts for them.

    ``near`` (n, k): reported joints; ``like``: how the arm travels there and what it carries.
    """

    def __init__(
        self,
        calibration: Calibration,
        goal: Pose,
        near: np.ndarray,
        like: JointState,
        carried: Pose,
    ) -> None:
        self.calibration, self.goal, self.near, self.like = calibration, goal, near, like
        self.has_few_axes = calibration.robot.dh.joints < few_axes.SIX
        # What is brought to the goal and verified there; an arm of few axes turns about its point.
        self.carried = carried if self.has_few_axes else IDENTITY
        self.wanted = compose(goal, self.carried)
        self.turn_tolerance_rad = FEW_AXES_TURN_RAD if self.has_few_axes else ROTATION_TOLERANCE_RAD
        self.model = calibration.model
        self.is_bounded = self.model.domain is not None
        self.plain = self.model.dh
        lower, upper = limits.dh_limits(calibration.robot)
        if self.is_bounded:  # of several turns, one the model speaks of
            low, high = calibration.fitted_range_rad
            cut = np.maximum(lower, low), np.minimum(upper, high)
            lower, upper = np.where(cut[0] < cut[1], cut, (lower, upper))
        self.box = lower, upper

    def judged(self, start: np.ndarray, rows: np.ndarray) -> Judged:
        """Joints refined from ``start`` (m, k) onto the goals ``rows`` (m,), verified forward.

        A start so far from limits or covered range that no refinement brings it back is judged as
        it stands.
        """
        calibration, count = self.calibration, len(start)
        reported = limits.reported_joints(calibration.robot, start)
        reach = limits.travel_unit(calibration.robot) * SAME_POSTURE_RAD
        beyond_limits = ~within_each(calibration, reported, reach).all(axis=1)
        beyond_range = calibration.outside_range(start, reach).any(axis=1) & self.is_bounded
        hopeless = beyond_limits | beyond_range
        status = np.where(beyond_limits, PoseStatus.OUTSIDE_LIMITS, PoseStatus.OUTSIDE_RANGE)
        unknown = np.full(count, np.nan)
        found = Judged(start.copy(), status, unknown, unknown.copy(), self._movement(start, rows))
        worth = np.flatnonzero(~hopeless)
        if len(worth):
            tried = self._tried(start[worth], rows[worth])
            for column, part in zip(found, tried, strict=True):
                column[worth] = part
        return found

    def _tried(self, start: np.ndarray, rows: np.ndarray) -> Judged:
        calibration = self.calibration
        with np.errstate(all="ignore"):  # far outside its range a model may be no number
            q_dh = self._refined(start, rows)
            turned = self.turned(q_dh, rows)
            again = np.flatnonzero((np.abs(turned - q_dh) > 1.0).any(axis=1))
            q_dh[again] = turned[again]
            if len(again) and self.is_bounded:  # errors need not repeat after a turn
                q_dh[again] = self._refined(turned[again], rows[again])
            off, angle = self._left(q_dh, rows)
        hit = (off <= POSITION_TOLERANCE_MM) & (angle <= self.turn_tolerance_rad)
        reported = limits.reported_joints(calibration.robot, q_dh)
        covered = ~calibration.outside_range(q_dh).any(axis=1)
        beyond = PoseStatus.OUTSIDE_RANGE if self.is_bounded else PoseStatus.EXTRAPOLATED
        status = np.where(covered, PoseStatus.CONVERGED, beyond)
        inside = within_each(calibration, reported).all(axis=1)
        status = np.where(inside, status, PoseStatus.OUTSIDE_LIMITS)
        status = np.where(hit, status, PoseStatus.NOT_REACHED)
        return Judged(q_dh, status, off, angle, self._movement(q_dh, rows))

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
        near = robot.dh_joints(self.near[rows])
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
        like = self.like.select(rows)
        kinds = [np.nan_to_num(each) for each in (like.s, like.payload) if each is not None]
        if not kinds or self.model.table is not None:
            return self._onto(self.model, start, rows, None)
        # Directions and payloads differ by row, and a refinement drops rows as they converge.
        found = np.empty_like(start)
        _, first, group = np.unique(
            np.hstack(kinds), axis=0, return_index=True, return_inverse=True
        )
        for number, one in enumerate(first):
            own = np.flatnonzero(group.ravel() == number)
            state = like.select(slice(one, one + 1))
            found[own] = self._onto(self.model, start[own], rows[own], state)
        return found

    def _onto(
        self, model: ErrorModel, start: np.ndarray, rows: np.ndarray, like: JointState | None
    ) -> np.ndarray:
        """Joints (m, k) refined from ``start`` onto the goals ``rows`` (m,), reached or not."""
        wanted = Pose(self.wanted.rotation[rows], self.wanted.position_mm[rows])
        if self.has_few_axes:
            return few_axes.refine(model, wanted, self.carried, start, like)
        return newton.refine(model, wanted, start, like).q_rad

    def _left(self, q_dh: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is left, (m,) mm and (m,) rad, at DH joints (m, k) of goals ``rows``."""
        at = self.model.pose(self.like.select(rows).moved(q_dh))
        at = compose(at, self.carried)
        off = np.linalg.norm(at.position_mm - self.wanted.position_mm[rows], axis=1)
        turned = at.rotation @ np.swapaxes(self.wanted.rotation[rows], 1, 2)
        angle = np.linalg.norm(log_so3(turned), axis=1)
        return np.nan_to_num(off, nan=np.inf), np.nan_to_num(angle, nan=np.inf)

    def _movement(self, q_dh: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Largest movement (m,) of a reported joint from those given; mm count as at one metre."""
        robot = self.calibration.robot
        apart = np.abs(limits.reported_joints(robot, q_dh) - self.near[rows])
        return np.max(apart / limits.travel_unit(robot), axis=1)

    def _searched(self, rows: np.ndarray) -> np.ndarray:
        """Postures (m, starts, k) of the plain arm from starts all over its joint range."""
        robot = self.calibration.robot
        low, high = robot.q_min_rad, robot.q_max_rad
        count = _FEW_STARTS if self.has_few_axes else _STARTS
        share = points("sobol", count, robot.dh.joints)
        starts = robot.dh_joints(low + share * (high - low))
        found = np.full((len(rows), count, robot.dh.joints), np.nan)
        for number, start in enumerate(starts):
            q_dh = self._onto(self.plain, np.tile(start, (len(rows), 1)), rows, None)
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
            seen |= apart.max(axis=1) < SAME_RAD
        return seen


def within_each(
    calibration: Calibration, reported: np.ndarray, slack: np.ndarray | float = 1e-9
) -> np.ndarray:
    """Whether reported joints (n, k) are within the limits, joint by joint."""
    robot = calibration.robot
    return (reported >= robot.q_min_rad - slack) & (reported <= robot.q_max_rad + slack)
