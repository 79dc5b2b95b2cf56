"""Shipped robots: what their makers say of reach, zero pose and axes, and measured data."""

from __future__ import annotations

import numpy as np
import pytest
import shared_data
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


# --- measured FANUC -------------------------------------------------------------------------------

POSES = "fanuc_r2000ic/poses.csv"


def unmodelled_rms_mm(signs) -> float:
    """Rms of the three targets when only base and targets are fitted to the readings' means."""
    rows = np.genfromtxt(shared_data.path_of(POSES), delimiter=",", names=True)
    chosen = [rows[rows["config"] == number] for number in np.unique(rows["config"])]
    q = np.deg2rad(
        [[part[f"q{i}_deg"].mean() for i in range(1, 7)] for part in chosen] * np.array(signs)
    )
    measured = np.array(
        [[[part[f"m{t}_{a}_mm"].mean() for a in "xyz"] for t in "ABC"] for part in chosen]
    )
    flange = dh.forward(robot.load("fanuc_r2000ic_165f").dh, q)
    targets, base_rotation, base = np.zeros((3, 3)), np.eye(3), np.zeros(3)
    for _ in range(300):
        seen = np.einsum("nij,tj->nti", flange.rotation, targets) + flange.position_mm[:, None]
        a, b = seen.reshape(-1, 3), measured.reshape(-1, 3)
        u, _, v = np.linalg.svd((a - a.mean(0)).T @ (b - b.mean(0)))
        flip = np.diag([1, 1, np.sign(np.linalg.det(v.T @ u.T))])
        base_rotation = v.T @ flip @ u.T
        base = b.mean(0) - base_rotation @ a.mean(0)
        in_base = np.einsum("ji,ntj->nti", base_rotation, measured - base)
        local = np.einsum("nji,ntj->nti", flange.rotation, in_base - flange.position_mm[:, None])
        targets = local.mean(0)
    seen = np.einsum("nij,tj->nti", flange.rotation, targets) + flange.position_mm[:, None]
    left = measured - (np.einsum("ij,ntj->nti", base_rotation, seen) + base)
    return float(np.sqrt(np.mean(np.sum(left**2, axis=-1))))


@shared_data.needed(POSES)
def test_fanuc_signs_are_those_of_the_measured_arm():
    signs = np.diag(robot.load("fanuc_r2000ic_165f").joint_map)
    right = unmodelled_rms_mm(signs)
    assert right == pytest.approx(0.7, abs=0.1)  # 0.717 leaving one configuration out
    for joint in range(1, 6):
        wrong = signs.copy()
        wrong[joint] *= -1
        assert unmodelled_rms_mm(wrong) > 20 * right
