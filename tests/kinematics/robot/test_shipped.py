"""Shipped robots: what their makers say of reach, zero pose and axes, and measured data."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from kinacc.geometry import exp_so3, rotation_y
from kinacc.kinematics import dh, robot

X, Y, Z = np.eye(3)
FORWARD = rotation_y(np.pi / 2)  # flange axis ahead, its x axis down
UPSIDE = np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]])  # flange axis ahead, its x axis up
# Zero pose of the flange (mm, rotation) and the axes about which a positive joint turns there.
ZERO = {
    "mh180": ((1775, 0, 1450), UPSIDE, (Z, Y, -Y, -X, -Y, -X)),
    "ur10": (
        (-1184.3, -256.141, 11.6),
        np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
        (Z, -Y, -Y, -Y, -Z, -Y),
    ),
    "irb120": ((374, 0, 630), FORWARD, (Z, Y, Y, X, Y, X)),
    "fanuc_r2000ic_165f": ((1807, 0, 1970), UPSIDE, (Z, Y, -Y, -X, -Y, -X)),
    "tx2_90l": ((50, 50, 1628), np.eye(3), (Z, Y, Y, Z, Y, Z)),
    "meca500": ((190, 0, 308), FORWARD, (Z, Y, Y, X, Y, X)),
    "iiwa14": ((0, 0, 1306), np.eye(3), (Z, Y, Z, -Y, Z, Y, Z)),
}
# Largest distance (mm) of a frame from axis 1 (0) or the foot of axis 2 (1) as the makers state
# it. The mh180's is that of its own lengths; FANUC's is what the limits leave.
REACH = {
    "mh180": (325 + 1150 + np.hypot(300, 1225), 5, 0, 0.1),
    "irb120": (580, 5, 0, 1),
    "fanuc_r2000ic_165f": (2655, 5, 0, 40),
    "tx2_90l": (1200, 6, 0, 2),
    "ur10": (np.hypot(1300, 163.941), 5, 0, 1),  # the maker counts in the arm's plane
    "meca500": (330, 6, 1, 1),
    "iiwa14": (820, 6, 1, 1),
}


def test_every_shipped_robot_is_tested_here_and_says_where_it_comes_from():
    assert set(robot.shipped()) == set(ZERO)
    for name in robot.shipped():
        arm = robot.load(name)
        assert arm.name == name
        assert len(arm.source) > 20
        assert len(arm.date) == 10
        assert arm.dh.joints in (6, 7)
        assert (arm.q_min_rad < 0).all()
        assert (arm.q_max_rad > 0).all()
        assert robot.files(name) == []


@pytest.mark.parametrize("name", ZERO)
def test_zero_pose_is_the_makers(name):
    position, rotation, _ = ZERO[name]
    arm = robot.load(name)
    pose = robot.forward(arm, np.zeros(arm.dh.joints))
    assert np.abs(pose.position_mm[0] - position).max() < 1e-9
    assert np.abs(pose.rotation[0] - rotation).max() < 1e-12


@pytest.mark.parametrize("name", ZERO)
def test_positive_joints_turn_about_the_makers_axes(name):
    arm = robot.load(name)
    for joint, axis in enumerate(ZERO[name][2]):
        q = np.zeros((2, arm.dh.joints))
        q[1, joint] = 0.3
        turn = robot.forward(arm, q).rotation
        assert np.abs(turn[1] @ turn[0].T - exp_so3(0.3 * axis)).max() < 1e-12


def farthest(name: str, frame: int, about: int) -> float:
    """Largest distance of a frame from axis 1, or from another frame, whatever the joints."""
    arm = robot.load(name)

    def apart(q: np.ndarray) -> np.ndarray:
        frames = dh.chain(arm.dh, q).position_mm
        between = frames[:, frame] - frames[:, about]
        return np.linalg.norm(between[:, :2] if about == 0 else between, axis=1)

    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (5000, arm.dh.joints))
    start = q[np.argmax(apart(q))]
    return -minimize(lambda x: -apart(x[None])[0], start, method="Powell").fun


@pytest.mark.parametrize("name", REACH)
def test_reach_is_the_makers(name):
    reach, frame, about, within = REACH[name]
    assert farthest(name, frame, about) == pytest.approx(reach, abs=within)
