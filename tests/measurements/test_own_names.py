"""Files that commands are given, in forms of other makers: joints, points and poses."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from measurements.scoring import measured
from pose_checks import assert_same
from scipy.spatial.transform import Rotation

from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.measurements.intake.choices import Undecided
from kinacc.measurements.rows import read_rows

ARM = robot.load("ur10")
SLIDES = ARM.dh.prismatic
Q_DEG = np.random.default_rng(2).uniform(-120, 120, (6, 6)).round(3)
POSE = robot.forward(ARM, np.deg2rad(Q_DEG))
TURNED = Rotation.from_matrix(POSE.rotation)


def table(folder, names, *columns):
    values = np.hstack([np.asarray(each, dtype=float) for each in columns])
    path = folder / "poses.csv"
    pd.DataFrame(values, columns=names).to_csv(path, index=False, float_format="%.9f")
    return path


def test_joints_of_a_program():
    program = measured("kuka_data_list")
    found = read_rows(program.files[0], SLIDES)
    np.testing.assert_allclose(found.joints, program.joints_rad, atol=1e-6)


POSES = {  # names of the axes, their unit in mm, names of the turn, its convention
    "KUKA": ("{} [inch]", 25.4, "ABC", "ZYX"),
    "FANUC": ("{} [inch]", 25.4, "WPR", "xyz"),
    "Kawasaki": ("{} [inch]", 25.4, "OAT", "ZYZ"),
    "roll, pitch, yaw": ("{} [inch]", 25.4, ["Roll [deg]", "Pitch [deg]", "Yaw [deg]"], "xyz"),
    "ours": ("{}_mm", 1.0, ["rx_deg", "ry_deg", "rz_deg"], "XYZ"),
    "nominal": ("Soll {} (m)", 1000.0, [f"Soll q{n}" for n in range(1, 5)], None),
}


@pytest.mark.parametrize("case", POSES)
def test_wanted_poses_in_every_convention_and_by_a_quaternion_with_its_scalar_first(case, tmp_path):
    axis, unit_mm, turn, convention = POSES[case]
    axes = [axis.format(letter) for letter in ("xyz" if case == "ours" else "XYZ")]
    turned = (
        TURNED.as_euler(convention, degrees=True)
        if convention
        else TURNED.as_quat(scalar_first=True)
    )
    path = table(tmp_path, [*axes, *turn], POSE.position_mm / unit_mm, turned)
    assert_same(read_rows(path, SLIDES, "poses").pose, POSE, 1e-5, 1e-6)


def test_what_is_open_is_asked_about(tmp_path):
    small = table(tmp_path, [f"J{n}" for n in range(1, 7)], Q_DEG / 100.0)
    with pytest.raises(Undecided, match="--joint-unit"):
        read_rows(small, SLIDES)
    names = [f"{ball}_{a} [mm]" for ball in ("m1", "m2") for a in "XYZ"]
    several = table(tmp_path, names, POSE.position_mm, POSE.position_mm + 5.0 * POSE.rotation[:, 0])
    with pytest.raises(InputError, match="--take 'm1_X \\[mm\\]' or --take"):
        read_rows(several, SLIDES, "points")
    two = table(tmp_path, [f"{side}_j{n}_deg" for side in ("left", "right") for n in range(1, 7)],
                Q_DEG, Q_DEG + 1.0)  # fmt: skip
    with pytest.raises(InputError, match="--take left_j1_deg or --take right_j1_deg"):
        read_rows(two, SLIDES)
    found = read_rows(two, SLIDES, answers={"take": ["right_j1_deg"]}).joints
    np.testing.assert_allclose(np.rad2deg(found), Q_DEG + 1.0, atol=1e-6)


def test_a_unit_that_contradicts_the_names_is_refused(tmp_path):
    degrees = table(tmp_path, [f"J{n} [deg]" for n in range(1, 7)], Q_DEG)
    with pytest.raises(InputError, match="one unit for all"):
        read_rows(degrees, SLIDES, answers={"joint_unit": "rad"})
