"""Measurement files: what is read as what, and every fault named with its place."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from read_columns import joints_of, points_of, turns_of
from scipy.spatial.transform import Rotation

from kinacc.config.schema import defaults
from kinacc.errors import InputError
from kinacc.kinematics import dh, robot
from kinacc.measurements.reader import read

ARM = robot.load("ur10")
SECTION = defaults()["measurements"]["file"] | {"source": "the tracker of hall 3"}


@pytest.fixture
def truth():
    """Joints (rad), flange positions (mm) and rotations of twelve poses."""
    q_rad = np.random.default_rng(5).uniform(-2.5, 2.5, (12, 6))
    return q_rad, dh.forward(ARM.dh, q_rad)


@pytest.fixture
def good(truth):
    """A good file's columns, in degrees, millimetres and intrinsic XYZ angles."""
    q_rad, pose = truth
    columns = {f"q{i + 1}_deg": np.rad2deg(q_rad[:, i]) for i in range(6)}
    columns |= dict(zip(("x_mm", "y_mm", "z_mm"), pose.position_mm.T, strict=True))
    euler = Rotation.from_matrix(pose.rotation).as_euler("XYZ", degrees=True)
    return columns | dict(zip(("rx_deg", "ry_deg", "rz_deg"), euler.T, strict=True))


def written(folder, columns, name="poses.csv"):
    path = folder / name
    pd.DataFrame(columns).to_csv(path, index=False)
    return str(path)


def problems_of(folder, table, **section) -> str:
    with pytest.raises(InputError) as caught:
        read(SECTION | {"path": written(folder, table)} | section, ARM)
    return str(caught.value)


def assert_is_truth(columns, truth):
    q_rad, pose = truth
    np.testing.assert_allclose(joints_of(columns), q_rad, atol=1e-12)
    np.testing.assert_allclose(points_of(columns), pose.position_mm, atol=1e-9)
    np.testing.assert_allclose(turns_of(columns).as_matrix(), pose.rotation, atol=1e-9)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_quaternions_of_either_sign_by_name_and_in_a_stated_order(tmp_path, good, truth, order):
    turned = Rotation.from_matrix(truth[1].rotation).as_quat(scalar_first=order == "wxyz")
    turned *= np.where(np.arange(12) % 2, 1.0, -1.0)[:, None]
    orientation = SECTION["orientation"] | {"kind": "quaternion", "order": order}
    path = str(tmp_path / "poses.parquet")
    for names in ([f"q{part}" for part in order], [f"quat{i}" for i in range(1, 5)]):
        pd.DataFrame(good | dict(zip(names, turned.T, strict=True))).to_parquet(path)
        columns = read(SECTION | {"path": path, "orientation": orientation}, ARM).columns
        assert_is_truth(columns, truth)
        assert (columns["qw"] >= 0).all()


def test_a_missing_file_says_where_the_data_comes_from(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.csv.*the tracker of hall 3"):
        read(SECTION | {"path": str(tmp_path / "nowhere.csv")}, ARM)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the file is empty"),
        ("q1_deg,x_mm\n", "no rows"),
        ("q1_deg;x_mm\n1;2\n", "delimiter to ';'"),
        ("a,b,a\n1,2,3\n", "column names given twice: a"),
        ("a,b\n1,2\n\n1,2,3\n", "line 4: 3 cells under 2 column names"),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path, text, said):
    path = tmp_path / "poses.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read(SECTION | {"path": str(path)}, ARM)
    assert said in str(caught.value)


def test_all_missing_columns_are_named_at_once(tmp_path, good):
    for name in ("q3_deg", "x_mm", "rz_deg"):
        del good[name]
    text = problems_of(tmp_path, good)
    for name in ("q3_deg or q3_rad", "x_mm or x_m", "rz_deg or rz_rad"):
        assert f"column {name}: is missing" in text


def test_a_quantity_in_two_units_has_to_say_the_same(tmp_path, good, truth):
    alike = good | {"x_m": np.round(good["x_mm"] / 1000, 6)}
    reading = read(SECTION | {"path": written(tmp_path, alike)}, ARM)
    assert_is_truth(reading.columns, truth)
    assert reading.unused == ("x_m",)
    off = alike["x_m"].copy()
    off[3] += 2e-6
    said = "column x_mm or x_m: is given in two units that do not say the same"
    assert said in problems_of(tmp_path, good | {"x_m": off})


def test_a_quaternion_that_is_not_a_unit(tmp_path, good):
    columns = good | {"qw": np.ones(12), "qx": np.zeros(12), "qy": np.zeros(12)}
    columns["qz"] = np.where(np.arange(12) == 4, 0.1, 0.0)
    turn = SECTION["orientation"] | {"kind": "quaternion"}
    text = problems_of(tmp_path, columns, orientation=turn)
    assert "line 6: quaternion of length 1.00499" in text


def test_a_file_without_orientations_is_told_from_a_missing_column(tmp_path, good):
    bare = {name: column for name, column in good.items() if name[0] != "r"}
    text = problems_of(tmp_path, bare)
    assert text.count("\n") == 1
    assert "column rx, ry, rz" in text
    assert "orientation.kind" in text
    assert "rz_deg or rz_rad" in problems_of(tmp_path, {**bare, "rx_deg": good["rx_deg"],
                                                        "ry_deg": good["ry_deg"]})  # fmt: skip


ROWS = np.arange(12)
FAULTS = {
    "bad cells": (
        lambda good: (
            good
            | {
                "q2_deg": np.where(ROWS == 3, "no", "1"),
                "z_mm": np.where(ROWS % 6 == 1, "inf", good["z_mm"].astype(str)),
            }
        ),
        "column z_mm, lines 3, 9: not a finite number: 'inf', 'inf'",
    ),
    "degrees": (
        lambda good: {re.sub(r"^(q\d)_deg", r"\1_rad", name): good[name] for name in good},
        "the column looks like degrees",
    ),
    "a limit": (
        lambda good: good | {"q5_deg": np.where(ROWS == 2, 361.0, 0.0)},
        "column q5_deg, line 4: 361 is outside the joint limits",
    ),
    "a direction": (
        lambda good: good | {"s4": np.full(12, 2)},
        "column s4, lines 2-13: 2; allowed: -1, 0 or 1",
    ),
    "a pose twice": (
        lambda good: good | {"pose": 0 * ROWS, "repeat": np.minimum(ROWS, 10)},
        "line 13: pose 0, repeat 10 is given again",
    ),
    "a pose of 301 digits": (
        lambda good: good | {"pose": np.where(ROWS == 3, 1e300, ROWS)},
        "column pose, line 5: 1e+300; allowed: whole numbers",
    ),
    "a seventh joint": (
        lambda good: good | {"q7_deg": np.zeros(12)},
        "q7 is there, the robot has 6 joints",
    ),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_named_with_its_place(tmp_path, good, case):
    change, said = FAULTS[case]
    assert said in problems_of(tmp_path, change(good))


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ({"columns": {"q1": "base_joint"}}, "column base_joint: is not there"),
        ({"columns": {"q1": "q2_deg"}}, "column q2_deg: is taken for 2 quantities, q1 among them"),
    ],
)
def test_settings_that_do_not_fit_the_file_are_named(tmp_path, good, section, said):
    assert said in problems_of(tmp_path, good, **section)
