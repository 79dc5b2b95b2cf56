"""The scorer of measured files itself: it accepts what is true and names every harm done to it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from measurements.files_as_they_come import FILES
from measurements.measured_file import Measured
from measurements.scoring import REACHED_MM, difference, expected, reach_mm
from measurements.simulated_arms import ARMS, flange, nominal_rows
from scipy.spatial.transform import Rotation

XYZ = ["x_mm", "y_mm", "z_mm"]
STD = ["std_x_mm", "std_y_mm", "std_z_mm"]


def arm_of(name: str, measured: Measured) -> str:
    """Name of the simulated arm behind a file."""
    coupled = ("fanuc_program", "fanuc_log_wpr", "fanuc_cartesian_program", "tracker_points_alone")
    if "fanuc" in measured.robot:
        return "fanuc" if name in coupled else "fanuc_uncoupled"
    return "kr10" if measured.robot.endswith("kr10.yaml") else measured.robot


def read_perfectly(name: str, measured: Measured, results: Path) -> pd.DataFrame:
    """Artefacts as a reader leaves them that makes no mistake; returns the readings."""
    found = expected(measured)
    _, poses = np.unique(measured.joints_rad, axis=0, return_inverse=True)
    found["pose"] = poses.ravel()[found["reading"]]
    found["repeat"] = found.groupby(["pose", "target"]).cumcount()
    found[["qw", "qx", "qy", "qz"]] = np.nan
    if measured.rotations is not None:
        turns = Rotation.from_matrix(measured.rotations[found["reading"]])
        found[["qx", "qy", "qz", "qw"]] = turns.as_quat(canonical=True)
    arm = ARMS[arm_of(name, measured)]
    keys = ("theta_offset_deg", "d_mm", "a_mm", "alpha_deg")
    rows = [dict(zip(keys, map(float, row), strict=True)) for row in arm.rows]
    text = yaml.safe_dump({"dh": rows, "joint_map": arm.joint_map.tolist()})
    pd.DataFrame({"name": ["arm"], "description": [text]}).to_parquet(results / "robot.parquet")
    found.to_parquet(results / "measurements.parquet")
    return found


@pytest.mark.parametrize("name", FILES)
def test_what_is_true_of_a_file_is_accepted(name: str, tmp_path: Path) -> None:
    measured = FILES[name](tmp_path)
    assert all(path.stat().st_size for path in measured.files)
    if not measured.points_mm:
        return
    read_perfectly(name, measured, tmp_path)
    unasked = "sigma" in measured.must_ask
    assert ("without asking" in difference(measured, tmp_path)) == unasked
    assert unasked or difference(measured, tmp_path) == ""


@pytest.mark.parametrize("name", FILES)
def test_the_points_of_a_file_belong_to_its_joints(name: str, tmp_path: Path) -> None:
    measured = FILES[name](tmp_path)
    arm = ARMS[arm_of(name, measured)]
    turned, moved = flange(nominal_rows(arm), measured.joints_rad @ arm.joint_map.T)
    for points in measured.points_mm.values():
        made = ~np.isnan(points[:, 0])
        assert reach_mm(turned[made], moved[made], points[made]) < REACHED_MM
        mirrored = points * [1, 1, -1]
        assert reach_mm(turned[made], moved[made], mirrored[made]) > REACHED_MM


def swapped(found: pd.DataFrame) -> None:
    found[["x_mm", "y_mm"]] = found[["y_mm", "x_mm"]].to_numpy()


def moved_a_little(found: pd.DataFrame) -> None:
    found.loc[found.index[7], "z_mm"] += 0.01


def other_joints(found: pd.DataFrame) -> None:
    found["q3"] = -found["q3"]


def next_row(found: pd.DataFrame) -> None:
    found[XYZ] = np.roll(found[XYZ].to_numpy(), 1, axis=0)


def one_target(found: pd.DataFrame) -> None:
    found["target"] = "tool"
    found["repeat"] = found.groupby("pose").cumcount()


def every_row_a_pose(found: pd.DataFrame) -> None:
    found["pose"] = range(len(found))
    found["repeat"] = 0


def turned_the_other_way(found: pd.DataFrame) -> None:
    found["qw"] = -found["qw"]


def no_deviations(found: pd.DataFrame) -> None:
    found[STD] = np.nan


def deviations_twice(found: pd.DataFrame) -> None:
    found[STD] *= 2


HARMS = [
    ("units_row", swapped),
    ("units_row", moved_a_little),
    ("units_row", other_joints),
    ("units_row", next_row),
    ("spherical_in_gon", other_joints),
    ("spherical_in_gon", next_row),
    ("spherical_in_gon", swapped),
    ("reflector_changed_halfway", one_target),
    ("one_row_per_reflector", one_target),
    ("several_readings_of_a_point", every_row_a_pose),
    ("kuka_log_abc", turned_the_other_way),
    ("expanded_uncertainty_said", deviations_twice),
    ("expanded_uncertainty_said", no_deviations),
    ("spatial_analyzer_uncertainties", no_deviations),
]


@pytest.mark.parametrize(("name", "harm"), HARMS)
def test_a_harm_is_seen(name: str, harm: Callable[[pd.DataFrame], None], tmp_path: Path) -> None:
    measured = FILES[name](tmp_path)
    found = read_perfectly(name, measured, tmp_path)
    harm(found)
    found.to_parquet(tmp_path / "measurements.parquet")
    assert difference(measured, tmp_path) != ""


def test_a_row_without_a_reading_must_not_arrive(tmp_path: Path) -> None:
    measured = FILES["no_readings_as_written"](tmp_path)
    found = read_perfectly("no_readings_as_written", measured, tmp_path)
    more = pd.concat([found, found.iloc[:1].assign(x_mm=9999.0, y_mm=9999.0, z_mm=9999.0)])
    more.to_parquet(tmp_path / "measurements.parquet")
    assert "36 readings instead of 35" in difference(measured, tmp_path)


def test_an_arm_without_its_coupling_is_seen(tmp_path: Path) -> None:
    measured = FILES["fanuc_log_wpr"](tmp_path)
    read_perfectly("fanuc_log_wpr", measured, tmp_path)
    arm = pd.read_parquet(tmp_path / "robot.parquet")
    described = yaml.safe_load(arm["description"][0])
    described["joint_map"] = ARMS["fanuc_uncoupled"].joint_map.tolist()
    arm["description"] = yaml.safe_dump(described)
    arm.to_parquet(tmp_path / "robot.parquet")
    assert "misses the points" in difference(measured, tmp_path)
