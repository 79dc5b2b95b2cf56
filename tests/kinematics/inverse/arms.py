"""Arms the inverses are tried on, and what every answer is held to."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import inverse, robot
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse import grid_of, limits, newton
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.robot import Robot

_TEXTS = Path(__file__).with_name("arms.yaml").read_text().split("---\n")
OFFSET_WRIST, GENERAL, STANFORD, SCARA, FIVE, ON_A_TRACK, OFFSET_ELBOW = (
    robot.of_text(text, "arms.yaml") for text in _TEXTS
)


def calibrated(arm: Robot, size: float = 0.3) -> DHModel:
    """The arm's model off by ``size`` mm and mrad in every parameter."""
    off = np.random.default_rng(5).normal(0, size, (5, arm.dh.joints)).T
    return arm.dh.with_parameters(arm.dh.start + (off * [1e-3, 1, 1, 1e-3, 1e-3]).ravel())


def joints_within(arm: Robot, count: int, seed: int = 6) -> np.ndarray:
    """Joints within limits and one turn; joint 1 of seven axes on the grid."""
    rng = np.random.default_rng(seed)
    low, high = limits.dh_limits(arm)
    low = np.where(arm.dh.prismatic, low, np.maximum(low, -np.pi))
    high = np.where(arm.dh.prismatic, high, np.minimum(high, np.pi))
    q = rng.uniform(low, high, (count, arm.dh.joints))
    if arm.dh.joints == 7:
        q[:, 0] = rng.choice(grid_of(arm), count)
    return q


def apart(arm: Robot, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Largest difference (...) of joints (..., k): rad but for whole turns, or metres."""
    gap = first - second
    turns = gap - 2 * np.pi * np.rint(gap / (2 * np.pi))
    return np.abs(np.where(arm.dh.prismatic, gap / 1e3, turns)).max(axis=-1)


def pick(pose: Pose, rows) -> Pose:
    return Pose(pose.rotation[rows], pose.position_mm[rows])


def assert_verified(model: ErrorModel, pose: Pose, solved: inverse.Solutions) -> None:
    """Every joint given returns to its pose within 1e-6 mm and 1e-9 rad."""
    rows, columns = np.nonzero(np.isfinite(solved.q_rad[..., 0]))
    error = newton.pose_error(pick(pose, rows), model.pose(JointState(solved.q_rad[rows, columns])))
    assert len(rows)
    assert np.linalg.norm(error[:, :3], axis=1).max() < 1e-6
    assert np.linalg.norm(error[:, 3:], axis=1).max() < 1e-9


def share_missed(arm: Robot, q: np.ndarray, solved: inverse.Solutions) -> float:
    """Share of joints (n, k) that are in no branch of their pose."""
    found = np.isfinite(solved.q_rad[..., 0])
    distance = np.where(found, apart(arm, solved.q_rad, q[:, None]), np.inf)
    return float(np.mean(distance.min(axis=1) > 1e-4))
