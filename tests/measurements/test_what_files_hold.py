"""All that a measurement file may state beside one pose per row, and the real files as examples."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from read_columns import turns_of
from scipy.spatial.transform import Rotation
from shared_data import ROOT

from kinacc.checks.configuration import load
from kinacc.config.schema import defaults
from kinacc.errors import InputError
from kinacc.kinematics import robot
from kinacc.measurements.reader import UNCERTAINTY, read

ARM = robot.load("ur10")
COUNT = 8


@pytest.fixture
def joints():
    """Columns of joints in degrees."""
    q_deg = np.random.default_rng(3).uniform(-150, 150, (COUNT, 6))
    return {f"q{i + 1}_deg": q_deg[:, i] for i in range(6)}


def points(prefix="", start=0.0):
    return {
        f"{prefix}{axis}_mm": start + np.arange(COUNT) * 7.0 + i for i, axis in enumerate("xyz")
    }


def reading(folder, table, arm=ARM, kind="none", orientation=(), **section):
    path = folder / "poses.csv"
    pd.DataFrame(table).to_csv(path, index=False)
    given = defaults()["measurements"]["file"] | {"path": str(path)} | section
    given["orientation"] = given["orientation"] | {"kind": kind} | dict(orientation)
    return read(given, arm, strict=False)


def refused(folder, columns, **given) -> str:
    with pytest.raises(InputError) as caught:
        reading(folder, columns, **given)
    return str(caught.value)


def test_half_a_point_is_no_reading_of_its_target(tmp_path, joints):
    one = {n: v.astype(object) for n, v in points("mA_").items()}
    one["mA_y_mm"][2] = ""
    found = reading(tmp_path, joints | one | points("mB_"))
    assert found.left_out() == ["1 row holds no reading of mA: line 4"]
    assert not found.columns["repeat"].any()  # two targets of a pose are no repeats
    read_of = {name: found.columns["row"][found.columns["target"] == name] for name in ("mA", "mB")}
    assert 4 not in read_of["mA"]
    assert 4 in read_of["mB"]


@pytest.mark.parametrize(
    ("convention", "axes"), [("ZYX", "zyx"), ("zxy", "zxy"), ("YXZ", "yxz"), ("xzx", "xyz")]
)
def test_euler_angles_by_axis_and_in_order(tmp_path, joints, convention, axes):
    turn = Rotation.random(COUNT, random_state=4)
    angles = turn.as_euler(convention, degrees=True).T
    for names in ([f"e{i}_deg" for i in (1, 2, 3)], [f"r{axis}_deg" for axis in axes]):
        table = joints | points() | dict(zip(names, angles, strict=True))
        orientation = {"convention": convention}
        columns = reading(tmp_path, table, kind="euler", orientation=orientation).columns
        found = turns_of(columns).as_matrix()
        np.testing.assert_allclose(found, turn.as_matrix(), atol=1e-9)


def test_a_stated_standard_deviation_of_zero_says_nothing(tmp_path, joints):
    table = joints | points() | {f"std_{axis}_m": np.full(COUNT, 2e-5) for axis in "xyz"}
    table["std_y_m"][3] = 0.0
    columns = reading(tmp_path, table).columns
    np.testing.assert_allclose(columns["std_x_mm"], 0.02)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(columns["std_y_mm"])), [3])
    table["std_z_m"][6] = -1e-5
    assert "column std_z_m, line 8: standard deviation -1e-05" in refused(tmp_path, table)


def test_sessions_count_their_poses_anew(tmp_path, joints):
    table = joints | points() | {"pose": [*"badabada"], "temp_C": np.full(COUNT, 21.5)}
    table["session"] = ["monday"] * 4 + ["tuesday"] * 4
    columns = reading(tmp_path, table).columns
    np.testing.assert_array_equal(columns["pose"], [0, 1, 2, 1, 3, 4, 5, 4])
    np.testing.assert_array_equal(columns["repeat"], [0, 0, 0, 1, 0, 0, 0, 1])
    assert list(columns["session"][[0, 7]]) == ["monday", "tuesday"]
    assert (columns["temperature_c"] == 21.5).all()


def test_commanded_joints_beside_those_read_back(tmp_path, joints):
    commanded = {name.replace("_deg", "_cmd_deg"): np.round(v) for name, v in joints.items()}
    found = reading(tmp_path, joints | commanded | points())
    expected = np.deg2rad(np.stack(list(commanded.values()), axis=1))
    np.testing.assert_allclose(found.commanded, expected)
    assert found.unused == ()
    del commanded["q3_cmd_deg"]
    assert "column q3_cmd: is missing beside" in refused(tmp_path, joints | commanded | points())


def test_a_sliding_joint_is_read_as_a_length(tmp_path, joints):
    slides = np.arange(6) == 2
    arm = dataclasses.replace(ARM, dh=dataclasses.replace(ARM.dh, prismatic=slides))
    joints["q3_m"] = joints.pop("q3_deg") / 1000.0
    columns = reading(tmp_path, joints | points(), arm=arm).columns
    np.testing.assert_allclose(columns["q3"], joints["q3_m"] * 1000.0)
    np.testing.assert_allclose(columns["q2"], np.deg2rad(joints["q2_deg"]))
    # Its head states its unit, whatever that of the points.
    table = joints | {
        f"{axis.upper()} [in]": values
        for axis, values in zip("xyz", points().values(), strict=True)
    }
    table["Track [mm]"] = 1000.0 * table.pop("q3_m")
    names = {axis: f"{axis.upper()} [in]" for axis in "xyz"} | {"q3": "Track [mm]"}
    columns = reading(tmp_path, table, arm=arm, length_unit="inch", columns=names).columns
    np.testing.assert_allclose(columns["q3"], table["Track [mm]"])
    np.testing.assert_allclose(columns["x_mm"], 25.4 * table["X [in]"])
    table["Track [deg]"] = table.pop("Track [mm]")
    names["q3"] = "Track [deg]"
    with pytest.raises(InputError, match=r"Track \[deg\]: says deg"):
        reading(tmp_path, table, arm=arm, length_unit="inch", columns=names)


def test_pulses_of_motors_are_read_by_the_number_per_degree_of_each(tmp_path, joints):
    read_of = reading(tmp_path, joints | points(), pulses_per_deg=[2.0] * 5 + [-4.0])
    np.testing.assert_allclose(read_of.columns["q6"], np.deg2rad(joints["q6_deg"]) / -4.0)


def example(name: str, dataset: str):
    config = load([ROOT / "config.yaml", ROOT / "examples" / name], folder=ROOT)[dataset]
    file = config["measurements"]["file"]
    return read(file | {"path": str(ROOT / file["path"])}, robot.load(config["robot"]))


def test_a_published_file_is_used_as_its_publisher_wrote_it():
    published = example("ur10_published.yaml", "ur10_published_d")
    plain = example("ur10.yaml", "ur10_d")
    assert published.unused == (
        *("Timestamp", "Goal x", "Goal y", "Goal z", "Goal roll", "Goal pitch", "Goal yaw"),
        *(f"measurement_std_r{axis}" for axis in "xyz"),
    )
    assert set(published.columns) == set(plain.columns)
    for name in set(plain.columns) - {"target", "session"}:
        np.testing.assert_allclose(
            published.columns[name], plain.columns[name], atol=1e-7, err_msg=name
        )
    assert np.isfinite(np.stack([published.columns[name] for name in UNCERTAINTY])).all()


def test_mass_and_centre_of_the_payload_of_every_row(tmp_path, joints):
    mass = {"payload_kg": np.arange(COUNT) % 3}
    centre = {"payload_x_mm": np.full(COUNT, 10.0), "payload_y_m": np.full(COUNT, 0.02)}
    centre |= {"payload_z_cm": np.full(COUNT, -3.0)}
    columns = reading(tmp_path, joints | points() | mass | centre).columns
    np.testing.assert_array_equal(columns["payload_kg"], mass["payload_kg"])
    assert [columns[f"payload_{axis}_mm"][1] for axis in "xyz"] == [10.0, 20.0, -30.0]
    table = joints | points()
    assert "payload_kg: is missing beside the centre" in refused(tmp_path, table | centre)
    del centre["payload_z_cm"]
    assert "payload_z: is missing beside" in refused(tmp_path, table | mass | centre)
    negative = {"payload_kg": np.full(COUNT, -2.5)}
    assert "a mass of -2.5 kg" in refused(tmp_path, table | negative)


def test_a_mass_alone_hangs_at_the_last_frame_and_an_empty_cell_says_nothing(tmp_path, joints):
    table = joints | points() | {"Last": [5, 5, "", 5, 5, 5, 5, 5]}
    columns = reading(tmp_path, table, columns={"payload": "Last"}).columns
    assert columns["payload_z_mm"][0] == 0.0
    assert np.isnan([columns["payload_kg"][2], columns["payload_x_mm"][2]]).all()
