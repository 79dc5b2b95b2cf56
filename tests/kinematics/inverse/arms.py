"""Arms the inverses are tried on, and what every answer is held to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import inverse
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse import grid_of, limits, newton
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.robot import Robot


def made(name, theta_deg, d_mm, a_mm, alpha_deg, ends, prismatic=None) -> Robot:
    """A robot from columns in degrees and mm; ``ends`` are limits in degrees or mm."""
    model = DHModel(
        np.deg2rad(theta_deg), d_mm, a_mm, np.deg2rad(alpha_deg), np.zeros(len(d_mm)), prismatic
    )
    box = np.array(ends, dtype=float)
    box[~model.prismatic] = np.deg2rad(box[~model.prismatic])
    return Robot(name, model, box[:, 0], box[:, 1], np.eye(len(d_mm)), "made up")


TURN = [(-180, 180)] * 6
OFFSET_WRIST = made(  # axis 5 beside axis 4, as on FANUC's CRX
    "offset",
    [0, -90, 0, 0, 0, 0],
    [245, 0, 0, 540, -150, 160],
    [0, 710, 0, 0, 0, 0],
    [-90, 0, -90, 90, -90, 0],
    TURN,
)
GENERAL = made(
    "general",
    [20, -140, 60, 10, 95, -30],
    [200, -150, 120, 280, -90, 160],
    [120, 350, -80, 60, -40, 30],
    [-85, 40, -70, 95, -100, 20],
    TURN,
)
STANFORD = made(
    "stanford",
    [0] * 6,
    [412, 154, 0, 0, 0, 263],
    [0] * 6,
    [-90, 90, 0, -90, 90, 0],
    [(-170, 170), (-170, 170), (200, 1200), (-170, 170), (-110, 110), (-170, 170)],
    [0, 0, 1, 0, 0, 0],
)
SCARA = made(
    "scara",
    [0] * 4,
    [400, 0, 0, 0],
    [325, 275, 0, 0],
    [0, 180, 0, 0],
    [(-130, 130), (-145, 145), (0, 200), (-180, 180)],
    [0, 0, 1, 0],
)
FIVE = made(
    "five",
    [0, -90, 0, 0, 0],
    [290, 0, 0, 302, 72],
    [0, 270, 70, 0, 0],
    [-90, 0, -90, 90, -90],
    [(-165, 165), (-110, 110), (-110, 70), (-160, 160), (-120, 120)],
)
ON_A_TRACK = made(
    "track",
    [90, 0, -90, 0, 0, 0, 0],
    [0, 290, 0, 0, 302, 0, 72],
    [0, 0, 270, 70, 0, 30, 0],
    [90, -90, 0, -90, 90, -90, 0],
    [
        (0, 2000),
        (-165, 165),
        (-110, 110),
        (-110, 70),
        (-160, 160),
        (-120, 120),
        (-180, 180),
    ],
    [1, 0, 0, 0, 0, 0, 0],
)
OFFSET_ELBOW = made(  # seven axes with offsets at elbow and wrist
    "elbow",
    [0] * 7,
    [333, 0, 316, 0, 384, 0, 107],
    [0, 0, 82.5, -82.5, 0, 88, 0],
    [-90, 90, 90, -90, 90, 90, 0],
    [(-166, 166), (-101, 101), (-166, 166), (-176, -4), (-166, 166), (-1, 215), (-166, 166)],
)


def calibrated(arm: Robot, size: float = 0.3, seed: int = 5) -> DHModel:
    """The arm's model off by ``size`` mm and mrad in every parameter."""
    rng, k = np.random.default_rng(seed), arm.dh.joints
    return replace(
        arm.dh,
        theta_offset_rad=arm.dh.theta_offset_rad + rng.normal(0, 1e-3 * size, k),
        d_mm=arm.dh.d_mm + rng.normal(0, size, k),
        a_mm=arm.dh.a_mm + rng.normal(0, size, k),
        alpha_rad=arm.dh.alpha_rad + rng.normal(0, 1e-3 * size, k),
        beta_rad=rng.normal(0, 1e-3 * size, k),
    )


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
