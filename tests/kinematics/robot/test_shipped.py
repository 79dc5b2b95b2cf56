"""Shipped robots against joint frames and axes of published URDFs, and the makers' reach.

``urdf_joints.csv`` has a row per joint: its frame in the frame before (x, y, z, then roll, pitch,
yaw about fixed axes, as in URDF) and its axis; ``base`` is the controller's base frame in the first
link and ``tool0`` the flange in the last one. The sources are named in the robot files; those of
``iiwa14`` and ``meca500`` are the makers' drawings. All count joints as their controllers do, but
for the couplings below. All angles are multiples of 90 deg (the packages round some to 1.571).
"""

from __future__ import annotations

import re
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from oracles.kinematics import frame, turn
from pose_checks import assert_same, of_matrices
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from shared_data import ROOT

from kinacc.kinematics import dh, robot
from kinacc.measurements.intake.write import template_text

URDF = dict(list(pd.read_csv(Path(__file__).with_name("urdf_joints.csv")).groupby("robot")))
# Joint 3 of the URDF turns by J3 + this times J2 of the controller.
COUPLED = {name: 1.0 for name in URDF if name.startswith("fanuc")} | {"irb2400_12_155": -1.0}
COUPLED["fanuc_r2000ic_165f"] = 0.0  # its measured data counts joint 3 from the upper arm
# Reach (mm) as the makers state it: of a frame (5: wrist centre, 6: flange) from axis 1 (0) or the
# foot of axis 2 (1), and the tolerance: rounding, and what limits take off the stretched arm.
# The makers of UR, CRX, TM and Franka state a reach that is no distance between two such points.
REACH = pd.read_csv(Path(__file__).with_name("reach.csv"), index_col="robot")


def by_urdf(name: str, q_rad: np.ndarray) -> np.ndarray:
    """Flanges (n, 4, 4) in the controller's base at controller joints ``q_rad`` (n, k)."""
    turned = q_rad.copy()
    turned[:, 2] += COUPLED.get(name, 0.0) * q_rad[:, 1]
    place = np.eye(4)
    for row in URDF[name].itertuples():
        angles = [row.roll_deg, row.pitch_deg, row.yaw_deg]
        fixed = Rotation.from_euler("xyz", angles, degrees=True)
        in_parent = frame(row.x_mm, row.y_mm, row.z_mm, fixed)
        if row.joint == "base":
            place = np.linalg.inv(in_parent)
            continue
        place = place @ in_parent
        if row.joint != "tool0":
            sign, axis = -1.0 if row.axis.startswith("-") else 1.0, "xyz".index(row.axis[-1])
            place = place @ turn(axis, sign * turned[:, int(row.joint) - 1])
    return place


def assert_published(name: str, arm: robot.Robot, q_rad: np.ndarray) -> None:
    """The arm stands at joints (n, k) as its URDF has it."""
    assert_same(robot.forward(arm, q_rad), of_matrices(by_urdf(name, q_rad)), 1e-6, 1e-9)


def test_every_shipped_robot_is_held_here_and_names_its_source():
    assert set(robot.shipped()) == set(URDF)
    page = (ROOT / "docs" / "robots.md").read_text(encoding="utf-8")
    assert [name for name in URDF if f"`{name}`" not in page] == []
    assert len(URDF) >= 45
    for name in robot.shipped():
        arm = robot.load(name)
        assert arm.name == name
        assert len(arm.source) > 20
        assert date.fromisoformat(arm.date)
        assert arm.dh.joints == len(URDF[name]) - 2
        assert robot.files(name) == []


@pytest.mark.parametrize("name", URDF)
def test_zero_pose_and_others_are_those_of_the_published_model(name):
    arm = robot.load(name)
    poses = np.random.default_rng(1).uniform(arm.q_min_rad, arm.q_max_rad, (20, arm.dh.joints))
    assert_published(name, arm, np.vstack([np.zeros(arm.dh.joints), poses]))


@pytest.mark.parametrize("name", REACH.index)
def test_reach_is_the_makers(name):
    reach, last, about, within = REACH.loc[name]
    arm = robot.load(name)

    def apart(q: np.ndarray) -> np.ndarray:
        frames = dh.chain(arm.dh, q).position_mm
        between = frames[:, int(last)] - frames[:, int(about)]
        return np.linalg.norm(between[:, :2] if about == 0 else between, axis=1)

    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (2000, arm.dh.joints))
    best = minimize(lambda x: -apart(x[None])[0], q[np.argmax(apart(q))], method="Powell")
    assert -best.fun == pytest.approx(reach, abs=within)


def test_the_form_is_the_arm_whose_lengths_are_filled_in():
    name, lengths = "irb4600_60_205", (495, 175, 900, 175, 960, 135)
    lines = template_text("form", 6).splitlines()
    for letter, length in zip("ABCDEF", lengths, strict=True):
        at = next(i for i, line in enumerate(lines) if re.search(f"[da]: {letter}", line))
        key = re.search(f"([da]): {letter}", lines[at])[1]
        lines[at] = lines[at].replace(f"{key}_mm: 100", f"{key}_mm: {length}")
    arm = robot.of_text("\n".join(lines), "form.yaml")
    assert_published(name, arm, np.linspace(-1.0, 1.0, 6)[None])
