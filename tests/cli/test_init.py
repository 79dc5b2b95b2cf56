"""init as a person calls it: two files that check-data and the workflow take at once."""

import shlex

import numpy as np
import pandas as pd
import pytest
from command_line import answer, call
from scipy.spatial.transform import Rotation

from kinacc.checks.contradictions import load
from kinacc.kinematics import robot


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
    told = answer("init", foreign, "--out", tmp_path / "my cell", "--name", "own", "--yes")
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
    call("init", foreign, "--out", tmp_path, *words, "--yes", code=2)
    assert dataset.read_text() == "mine\n"
    call("init", foreign, "--out", tmp_path, *words, "--yes", "--force", code=0)
    assert "datasets:" in dataset.read_text()


def test_what_it_cannot_know_is_asked(foreign, tmp_path):
    # joint unit, length unit, angle unit, orientation, robot
    call("init", foreign, "--out", tmp_path, input="rad\nmm\ndeg\nZYX\nirb120\n", code=0)
    (settings,) = load((next(tmp_path.glob("day*.yaml")),)).values()
    file = settings["measurements"]["file"]
    assert file["orientation"]["convention"] == "ZYX"


def test_without_a_terminal_every_question_names_the_option_that_answers_it(foreign, tmp_path):
    done = call("init", foreign, "--out", tmp_path / "new", input="", code=2)
    refusal = done.output[done.output.index("The questions were not answered") :]
    for option in ("--joint-unit", "--length-unit", "--angle-unit", "--orientation", "--robot"):
        assert f"give {option}, or --yes" in refusal, option
    assert not (tmp_path / "new").exists()
    units = ("--joint-unit", "rad", "--length-unit", "mm", "--angle-unit", "deg")
    done = call(
        "init", foreign, *units, "--orientation", "ZYX", "--out", tmp_path, input="", code=2
    )
    assert "give --robot, or --yes" in done.output
    assert "--orientation" not in done.output


def test_an_unknown_robot_gets_a_template_to_fill_in(tmp_path):
    rows = np.random.default_rng(0).uniform(-50.0, 50.0, (20, 8)).round(3)
    names = [*(f"q{i}_deg" for i in range(1, 6)), "x_mm", "y_mm", "z_mm"]
    pd.DataFrame(rows, columns=names).to_csv(tmp_path / "five.csv", index=False)
    call("init", tmp_path / "five.csv", "--out", tmp_path, "--yes", code=0)
    template = tmp_path / "five.robot.yaml"
    assert "FILL IN" in template.read_text()
    assert robot.load(template).dh.joints == 5


def test_wrong_options_are_named(foreign, tmp_path):
    for words in (("--robot", "iiwa14"), ("--orientation", "ABC"), ("--name", "a b")):
        done = call("init", foreign, "--out", tmp_path, "--yes", *words, code=2)
        assert words[0] in done.output
