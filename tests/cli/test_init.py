"""init as a person calls it: two files that check-data and the workflow take at once."""

import shlex

import numpy as np
import pandas as pd
import pytest
from command_line import answer, call
from scipy.spatial.transform import Rotation

from kinacc.checks.configuration import load
from kinacc.kinematics import robot
from kinacc.measurements.intake.write import shipped_text


@pytest.fixture
def foreign(tmp_path):
    """A `;` file with decimal commas of an IRB 120: radians, ZYX angles, names of its own."""
    q = np.round(np.random.default_rng(0).uniform(-1.0, 1.0, (40, 6)), 6)
    pose = robot.forward(robot.load("irb120"), q)
    turn = Rotation.from_matrix(pose.rotation).as_euler("xyz", degrees=True)
    rows = np.column_stack([q, np.round(pose.position_mm, 4), np.round(turn, 5)])
    names = [*(f"axis {i}" for i in range(1, 7)), *"XYZ", "Rx", "Ry", "Rz"]
    path = tmp_path / "day 1 (it's late).csv"
    pd.DataFrame(rows, columns=names).to_csv(path, sep=";", decimal=",", index=False)
    return path


def test_a_foreign_file_is_described_and_the_check_that_is_printed_passes(foreign, tmp_path):
    told = answer("init", foreign, "--out", tmp_path / "my cell", "--name", "own")
    dataset = tmp_path / "my cell" / "own.yaml"
    check, _ = told["next"]
    assert f"#     {check}\n" in dataset.read_text(encoding="utf-8")
    settings = load((dataset,))["own"]
    file = settings["measurements"]["file"]
    assert (file["delimiter"], file["decimal"], file["joint_unit"]) == (";", ",", "rad")
    # XYZ was assumed; trying finds the same rotations by either of their two names.
    assert file["orientation"]["convention"] in ("ZYX", "xyz")
    assert robot.load(settings["robot"]).name == "irb120"
    call(*shlex.split(check)[1:], code=0)


def test_nothing_is_overwritten_unless_forced(foreign, tmp_path):
    words = ("--robot", "irb120", "--name", "a", "--joint-unit", "rad", "--orientation", "ZYX")
    dataset = tmp_path / "a.yaml"
    dataset.write_text("mine\n")
    call("init", foreign, "--out", tmp_path, *words, code=2)
    assert dataset.read_text() == "mine\n"
    call("init", foreign, "--out", tmp_path, *words, "--force", code=0)
    assert "datasets:" in dataset.read_text()
    # A robot file of the name that the data set would have stays, also where it is forced.
    dataset.write_text(shipped_text("irb120"), encoding="utf-8")
    call("init", foreign, "--out", tmp_path, *words, "--robot", dataset, "--force", code=2)
    assert robot.load(dataset).dh.joints == 6


def test_an_unknown_robot_gets_a_template_to_fill_in(tmp_path):
    rows = np.random.default_rng(0).uniform(-50.0, 50.0, (20, 8)).round(3)
    names = [*(f"q{i}_deg" for i in range(1, 6)), "x_mm", "y_mm", "z_mm"]
    pd.DataFrame(rows, columns=names).to_csv(tmp_path / "five.csv", index=False)
    call("init", tmp_path / "five.csv", "--out", tmp_path, code=0)
    template = tmp_path / "five.robot.yaml"
    assert "FILL IN" in template.read_text()
    assert robot.load(template).dh.joints == 5


def test_wrong_options_are_named(foreign, tmp_path):
    for words in (("--robot", "iiwa14"), ("--orientation", "ABC"), ("--name", "a b")):
        done = call("init", foreign, "--out", tmp_path, *words, code=2)
        assert words[0] in done.output
