"""check-data as a person and a program call it: what is said, and the exit code."""

import json
import re

import numpy as np
import pytest
from command_line import call

ROBOT = "irb120"


@pytest.fixture
def configuration(tmp_path):
    """Writes a measured file of a nominal arm, with a change of its text, and its data set."""
    from kinacc.kinematics import robot

    arm = robot.load(ROBOT)
    q_deg = np.round(np.random.default_rng(0).uniform(-60, 60, (20, 6)), 3)
    point = robot.forward(arm, np.deg2rad(q_deg)).position_mm
    usual = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]

    def write(change=lambda rows: rows, names=usual):
        rows = change(np.round(np.column_stack([q_deg, point]), 4))
        path = tmp_path / "poses.csv"
        np.savetxt(path, rows, fmt="%.10g", delimiter=",", header=",".join(names), comments="")
        config = tmp_path / "data.yaml"
        config.write_text(
            f"datasets: {{cell: {{robot: {ROBOT}, measurements: {{source: file, file: {{path: "
            f"{path}, orientation: {{kind: none}}}}}}, calibration: {{base_and_tool: "
            "estimated, vec: {order: 0}}, evaluation: {space: measured}}}\n"
        )
        return config

    return write


def test_a_good_file_is_described_and_passes(configuration):
    done = call("check-data", configuration())
    assert done.exit_code == 0, done.output
    for words in ("poses: 20", "joint coverage", "limits -165 to 165", "nothing suspicious"):
        assert words in done.output


def test_suspicions_name_their_lines_and_end_with_1(configuration):
    def shifted(rows):
        rows[[4, 11], 6] += 30.0
        return rows

    config = configuration(shifted)
    done = call("check-data", config)
    assert done.exit_code == 1
    assert "outliers" in done.output
    assert "lines 6, 13" in done.output
    told = json.loads(call("check-data", config, "--json").stdout)
    assert told["verdict"] == "suspicions"
    assert told["datasets"][0]["suspicions"][0]["lines"] == [6, 13]
    assert told["datasets"][0]["facts"]["poses"] == 20


def test_the_picture_is_drawn_once(configuration, tmp_path):
    def shifted(rows):
        rows[4, 6] += 30.0
        return rows

    config, picture = configuration(shifted), tmp_path / "checked.svg"
    assert call("check-data", config, "--picture", picture).exit_code == 1
    assert picture.read_bytes().startswith(b"<?xml")
    assert call("check-data", config, "--picture", picture).exit_code == 2
    assert call("check-data", config, "--picture", picture, "--force").exit_code == 1


@pytest.mark.parametrize("flag", [[], ["--json"]])
def test_what_cannot_be_used_ends_with_2(configuration, tmp_path, flag):
    config = configuration(lambda rows: rows[:3])
    done = call("check-data", config, *flag)
    assert done.exit_code == 2
    assert "at least 6" in done.output
    (tmp_path / "poses.csv").unlink()
    done = call("check-data", config, *flag)
    assert done.exit_code == 2
    assert "Parquet" in done.output
    if flag:
        assert json.loads(done.stdout)["verdict"] == "unusable"


def test_repeats_scatter_by_the_number_a_campaign_is_held_to(configuration):
    def read_five_times(rows):
        rng = np.random.default_rng(1)
        again = np.repeat(rows, 5, axis=0)
        own = np.column_stack([again, np.repeat(np.arange(20), 5)])
        own[:, 6:9] += rng.normal(size=(100, 3)) * (0.1, 0.1, 0.01)
        second = own[:, 6:9] + (30.0, 0.0, 0.0) + rng.normal(size=(100, 3)) * 0.001
        return np.column_stack([own, second])

    names = [*(f"q{i}_deg" for i in range(1, 7)), "a_x_mm", "a_y_mm", "a_z_mm", "pose"]
    config = configuration(read_five_times, [*names, "b_x_mm", "b_y_mm", "b_z_mm"])
    done = call("check-data", config)
    told = json.loads(call("check-data", config, "--json").stdout)["datasets"][0]["facts"]
    spread = np.array(told["noise"]["std_mm"])
    assert f"repeats scatter by {np.sqrt(np.mean(spread**2)):.3g} mm per axis" in done.output


def test_the_limit_of_the_quick_fit_is_explained_on_its_line(configuration):
    said = re.search(r"most_expected_mm: .*", call("check-data", configuration()).output)[0]
    assert re.fullmatch(r"most_expected_mm: \S+ \(a reading farther off is an outlier\)", said)


def test_only_measured_data_sets_can_be_checked(tmp_path):
    config = tmp_path / "synthetic.yaml"
    config.write_text("datasets: {mh180: {robot: mh180}}\n")
    done = call("check-data", config)
    assert done.exit_code == 2


def test_help_has_an_example():
    shown = call("check-data", "--help").output
    assert "Example:" in shown
    assert "kinacc check-data " in shown


def test_the_noise_of_poses_read_again_is_said_axis_by_axis_and_of_which_frame(configuration):
    def read_again(rows):
        again = rows.copy()
        again[:, 6] += 0.03
        return np.vstack([rows, again])

    config = configuration(read_again)
    said = re.search(r"std_mm: (.*)", call("check-data", config).output)[1]
    number = r"\d[\d.e-]*"
    assert re.fullmatch(rf"x {number}, y {number}, z {number} \(axes of the instrument\)", said)
    told = json.loads(call("check-data", config, "--json").stdout)["datasets"][0]["facts"]
    spread = told["noise"]["std_mm"]
    assert said.startswith(f"x {spread[0]:.3g}, y {spread[1]:.3g}, z {spread[2]:.3g} ")
