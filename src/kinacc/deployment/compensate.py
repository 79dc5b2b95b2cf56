"""Joint values at which a calibrated arm puts its tool where it is wanted, verified one by one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinacc.deployment.postures import (
    SAME_POSTURE_RAD,
    SAME_RAD,
    Goals,
    Judged,
    PoseStatus,
    within_each,
)
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import dh
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.model import JointState


class Compensation(NamedTuple):
    """Joints that reach n wanted poses.

    ``q_rad`` (n, k): reported joints (mm where a joint slides), NaN unless the forward model was
    seen to return to the pose within the tolerances of ``postures``. An arm of four or five axes
    has the position alone within tolerance, and the nearest orientation it can take there, at most
    ``postures.FEW_AXES_TURN_RAD`` away.
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
    payload: np.ndarray | None = None,
) -> Compensation:
    """Joints at which ``calibration`` puts ``point`` at ``wanted`` (n, ...) in ``frame``.

    Of all postures within the joint limits the one nearest to ``near_rad`` (n, k) or (k,),
    reported joints, is taken; where that is not given, the one nearest to zero among those the
    data cover. The largest joint movement counts. ``s`` (n, k): directions the joints will travel
    in, for a VEC model that knows them; ``payload`` (n, 4) as in a ``JointState``.
    Raises InputError for an unknown frame or point, and for poses that are no numbers.
    """
    _require_numbers(wanted)
    robot, count = calibration.robot, len(wanted.position_mm)
    carried, origin = calibration.point(point), calibration.origin(frame)
    goal = compose(invert(origin), compose(wanted, invert(carried)))
    given = near_rad is not None
    near = np.zeros(robot.dh.joints) if near_rad is None else np.atleast_2d(near_rad)
    near = np.broadcast_to(near, (count, robot.dh.joints))
    like = JointState(robot.dh_joints(near), None if s is None else np.asarray(s), payload)
    arm = Goals(calibration, goal, near, like, carried)
    best = _Best.none(count, robot.dh.joints, given)
    if given:
        every = np.arange(count)
        best.offer(arm.judged(robot.dh_joints(near), every), every)
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
    end = dh.forward(robot.dh, robot.dh_joints(np.atleast_2d(q_rad)))
    return compose(robot.base, compose(end, calibration.programmed_point(point)))


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
        status = np.full(count, PoseStatus.NOT_REACHED)
        blank = np.full((count, joints), np.nan)
        return cls(blank, status, far.copy(), far.copy(), far.copy(), far.copy(), given)

    def settled(self) -> np.ndarray:
        """True (n,) where no other posture can be better, as they are offered nearest first."""
        if not self.given:
            return self.status == PoseStatus.CONVERGED
        return (self.status <= PoseStatus.EXTRAPOLATED) & (self.movement <= SAME_POSTURE_RAD)

    def offer(self, found: Judged, rows: np.ndarray) -> None:
        """Keep what is better: usable before not, then near before far, then what is left."""
        hit = found.status != PoseStatus.NOT_REACHED
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
        missed = status == PoseStatus.NOT_REACHED
        within = np.where(missed, np.minimum(off_mm, 1e8), np.minimum(movement, 99.0))
        usable = status <= PoseStatus.EXTRAPOLATED
        within = within + np.where(
            (status == PoseStatus.EXTRAPOLATED) & (not self.given), 200.0, 0.0
        )
        return np.where(missed, 1e6, np.where(usable, 0.0, 1e3)) + within


def _outcome(calibration: Calibration, best: _Best, near: np.ndarray, given: bool) -> Compensation:
    status = best.status.copy()
    other = (status <= PoseStatus.EXTRAPOLATED) & (best.movement > best.nearest + SAME_RAD) & given
    status[other] = PoseStatus.OTHER_POSTURE
    reported = limits.reported_joints(calibration.robot, best.q_dh)
    said = status <= PoseStatus.OTHER_POSTURE
    outside = np.where(
        (status == PoseStatus.OUTSIDE_LIMITS)[:, None],
        ~within_each(calibration, reported),
        calibration.outside_range(best.q_dh),
    )
    q_rad = np.where(said[:, None], reported, np.nan)
    return Compensation(
        q_rad,
        status,
        best.off_mm,
        best.angle_rad,
        outside & (status != PoseStatus.NOT_REACHED)[:, None],
        q_rad - near if given else np.full(q_rad.shape, np.nan),
    )
