"""Joint values at which a calibrated arm puts its tool where it is wanted, verified one by one.

Every posture of the plain arm is refined onto the wanted pose on the calibrated model; of those
that the model returns to the pose within tolerance the nearest to the given joints is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinacc.deployment.record import Calibration
from kinacc.errors import input_error
from kinacc.geometry import Pose, compose, invert, log_so3
from kinacc.kinematics.inverse import few_axes, limits, newton, solve
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.region import points

POSITION_TOLERANCE_MM = newton.POSITION_TOLERANCE_MM
ROTATION_TOLERANCE_RAD = newton.ROTATION_TOLERANCE_RAD
FEW_AXES_TURN_RAD = 0.05  # of an arm of four or five axes; more is another orientation
SAME_POSTURE_RAD = 0.35  # a calibration moves joints by less, another posture by more
SAME_RAD = 1e-5
_SAME_TURN_RAD = 1e-9  # a joint so far beyond its limit stays on its turn
_NEAR_START_MM = 1.0  # a posture of the plain arm, as a start on the calibrated one
_STARTS = 16  # of the search of an arm of four or five axes, which has no list of branches


class PoseStatus(IntEnum):
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
    seen to return to the pose within POSITION_TOLERANCE_MM and ROTATION_TOLERANCE_RAD. An arm of
    four or five axes has the position alone within tolerance, and the nearest orientation it can
    take there, at most FEW_AXES_TURN_RAD away. ``status`` (n,): a ``PoseStatus``.
    ``position_error_mm`` and ``rotation_error_rad`` (n,): what is left at the best joints found.
    ``offending`` (n, k): joints outside limits or covered range. ``change`` (n, k): joints less
    those given as near, NaN without those.
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
    """Joints at which a calibrated arm puts a point at wanted poses.

    Of all postures within the joint limits the one nearest to ``near_rad`` is taken; where that is
    not given, the one nearest to zero among those the data cover. The largest movement counts.

    Parameters
    ----------
    wanted
        (n, ...) poses in ``frame``, mm.
    near_rad
        (n, k) or (k,) reported joints, rad (mm where a joint slides).
    s
        (n, k) directions the joints will travel in, for a VEC model that knows them.
    frame
        ``base`` of the robot, or ``instrument``.
    point
        A target by name or ``flange``; the tool where not given.
    payload
        (n, 4) as in ``JointState``.

    Returns
    -------
    Compensation

    Raises
    ------
    InputError
        For an unknown frame or point, and for poses that are no numbers.
    """
    known = np.isfinite(wanted.position_mm).all(axis=1)
    known &= np.isfinite(wanted.rotation).all(axis=(1, 2))
    if not known.all():
        shown = ", ".join(str(row) for row in np.flatnonzero(~known)[:5])
        raise input_error("wanted poses", f"no number in row {shown}", "finite poses")
    robot, every = calibration.robot, np.arange(len(wanted.position_mm))
    carried, origin = calibration.point(point), calibration.origin(frame)
    goal = compose(invert(origin), compose(wanted, invert(carried)))
    near = np.broadcast_to(0.0 if near_rad is None else near_rad, (len(every), robot.dh.joints))
    like = JointState(robot.dh_joints(near), s, payload)
    arm = _Goals(calibration, goal, near, like, carried)
    more, tried = every, []
    if near_rad is not None:
        tried = [arm.judged(like.q_rad, every)]
        close = tried[0]["movement"] <= SAME_POSTURE_RAD
        more = every[~(close & (tried[0]["status"] <= PoseStatus.EXTRAPOLATED))]
    table = pd.concat([*tried, arm.judged(*arm.postures(more))], ignore_index=True)
    hit, status = table["status"] != PoseStatus.NOT_REACHED, table["status"]
    nearest = table[hit].groupby("row")["movement"].min().reindex(every, fill_value=np.inf)
    # Beside joints that are given an extrapolated posture is as good as another.
    table["class"] = np.array([0, near_rad is None, 2, 2, 2, 3])[status]
    table["cost"] = table["movement"].where(hit, table["off_mm"])
    best = table.sort_values(["class", "cost"]).drop_duplicates("row").set_index("row")
    best = best.reindex(every)
    status = best["status"].fillna(PoseStatus.NOT_REACHED)
    if near_rad is not None:
        farther = (status <= PoseStatus.EXTRAPOLATED) & (best["movement"] > nearest + SAME_RAD)
        status = status.mask(farther, PoseStatus.OTHER_POSTURE)
    status = status.to_numpy(int)
    q_dh = best[[*range(robot.dh.joints)]].to_numpy(float)
    reported = limits.reported_joints(robot, q_dh)
    outside = np.where(
        (status == PoseStatus.OUTSIDE_LIMITS)[:, None],
        limits.outside(reported, (robot.q_min_rad, robot.q_max_rad)),
        calibration.outside_range(q_dh),
    )
    q_rad = np.where((status <= PoseStatus.OTHER_POSTURE)[:, None], reported, np.nan)
    return Compensation(
        q_rad,
        status,
        best["off_mm"].fillna(np.inf).to_numpy(),
        best["angle_rad"].fillna(np.inf).to_numpy(),
        outside & (status != PoseStatus.NOT_REACHED)[:, None],
        q_rad - (np.nan if near_rad is None else near),
    )


@dataclass(frozen=True)
class _Goals:
    """Wanted poses ``goal`` (n, ...) of the last DH frame, and what becomes of starts for them.

    ``near`` (n, k): reported joints; ``like``: how the arm travels there and what it carries.
    """

    calibration: Calibration
    goal: Pose
    near: np.ndarray
    like: JointState
    point: Pose

    @property
    def has_few_axes(self) -> bool:
        return self.calibration.robot.dh.joints < few_axes.SIX

    def judged(self, start: np.ndarray, rows: np.ndarray) -> pd.DataFrame:
        """Joints refined from ``start`` (m, k) onto the goals ``rows`` (m,), verified forward.

        Columns: row, status, what is left, the largest movement of a joint, and joints 0 ..
        A start so far from limits or covered range that no refinement brings it back is judged as
        it stands, with nothing known of what is left.
        """
        calibration, robot, model = self.calibration, self.calibration.robot, self.calibration.model
        is_bounded, within = model.domain is not None, (robot.q_min_rad, robot.q_max_rad)
        reach = robot.dh.travel_unit * SAME_POSTURE_RAD
        far = limits.outside(limits.reported_joints(robot, start), within, reach)
        if is_bounded:
            far |= calibration.outside_range(start, reach)
        worth = ~far.any(axis=1)
        goals, q_dh = rows[worth], start.copy()
        off, angle = np.full((2, len(start)), np.nan)
        with np.errstate(all="ignore"):  # far outside its range a model may be no number
            refined = self._refined(model, start[worth], goals)
            turned = self._turned(refined, goals)
            again = (np.abs(turned - refined) > 1.0).any(axis=1)
            # Errors need not repeat after a turn.
            refined[again] = self._refined(model, turned[again], goals[again])
            off[worth], angle[worth] = self._left(model, refined, goals)
        q_dh[worth] = refined
        turn_rad = FEW_AXES_TURN_RAD if self.has_few_axes else ROTATION_TOLERANCE_RAD
        reported = limits.reported_joints(robot, q_dh)
        status = np.select(
            [
                (off > POSITION_TOLERANCE_MM) | (angle > turn_rad),
                limits.outside(reported, within).any(axis=1),
                ~calibration.outside_range(q_dh).any(axis=1),
            ],
            [PoseStatus.NOT_REACHED, PoseStatus.OUTSIDE_LIMITS, PoseStatus.CONVERGED],
            PoseStatus.OUTSIDE_RANGE if is_bounded else PoseStatus.EXTRAPOLATED,
        )
        apart = np.abs(reported - self.near[rows]) / robot.dh.travel_unit
        table = pd.DataFrame(q_dh).assign(row=rows, status=status, off_mm=off, angle_rad=angle)
        return table.assign(movement=np.max(apart, axis=1))

    def postures(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Starts (m, k) in every posture of the plain arm at goals ``rows``, and their goals."""
        robot, plain = self.calibration.robot, self.calibration.model.dh
        if not self.has_few_axes:
            result = solve(robot, plain, self.goal.select(rows)).q_rad
            local, branch = np.nonzero(np.isfinite(result).all(axis=2))
            return self._turned(result[local, branch], rows[local]), rows[local]
        share = points("sobol", _STARTS, robot.dh.joints)
        starts = robot.dh_joints(robot.q_min_rad + share * (robot.q_max_rad - robot.q_min_rad))
        local = np.repeat(rows, _STARTS)
        q_dh = self._refined(plain, np.tile(starts, (len(rows), 1)), local)
        near = self._left(plain, q_dh, local)[0] <= _NEAR_START_MM
        return self._turned(q_dh[near], local[near]), local[near]

    def _turned(self, q_dh: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Joints on the turns within limits, and range of a bounded model, near the given ones."""
        calibration = self.calibration
        covered = None if calibration.model.domain is None else calibration.fitted_range_rad
        near = self.like.q_rad[rows]
        return limits.take_turns(calibration.robot, q_dh, covered, near, _SAME_TURN_RAD)

    def _refined(self, model: ErrorModel, start: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Joints (m, k) refined from ``start`` onto the goals ``rows`` (m,), reached or not."""
        goal, like = self.goal.select(rows), self.like.select(rows)
        if self.has_few_axes:
            goal = compose(goal, self.point)
            return few_axes.refine(model, goal, self.point, start, like)
        return newton.refine(model, goal, start, like).q_rad

    def _left(
        self, model: ErrorModel, q_dh: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is left, (m,) mm and (m,) rad, at DH joints (m, k) of goals ``rows``.

        Of the last DH frame, or of the point about which an arm of few axes turns.
        """
        end, goal = model.pose(self.like.select(rows).moved(q_dh)), self.goal.select(rows)
        if self.has_few_axes:
            end, goal = compose(end, self.point), compose(goal, self.point)
        off, angle = distance(end, goal)
        return np.nan_to_num(off, nan=np.inf), np.nan_to_num(angle, nan=np.inf)


def distance(first: Pose, second: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Distance (...,) in mm and angle (...,) in rad between poses (..., 3)."""
    turn = log_so3(first.rotation @ np.swapaxes(second.rotation, -1, -2))
    gap_mm = np.linalg.norm(first.position_mm - second.position_mm, axis=-1)
    return gap_mm, np.linalg.norm(turn, axis=-1)
