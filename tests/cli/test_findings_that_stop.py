"""A finding that stops the workflow: commands to exclude its rows or to go on all the same."""

import shlex
import shutil
from pathlib import Path

import pandas as pd
import pytest
from command_line import answer, call
from tracked_arm import init_seen, tracked

from kinacc.checks.configuration import load


def printed(*words, code=0):
    return call(*words, code=code).output


@pytest.fixture(scope="module")
def described(tmp_path_factory):
    """A file of which lines 6 and 7 are 25 mm off, as init describes it."""
    folder = tmp_path_factory.mktemp("described")
    arm = tracked(poses=60)
    arm.point[4:6] += [0.0, 25.0, 0.0]
    init_seen(folder, arm)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return folder, next_commands(printed("check-data", "seen.yaml", code=1))


@pytest.fixture
def two_slips(described, tmp_path, monkeypatch):
    """Commands after the check, in a copy of the file and its description."""
    monkeypatch.chdir(shutil.copytree(described[0], tmp_path / "cell"))
    return described[1]


def next_commands(text):
    return [shlex.split(line) for line in text.split("next:")[1].splitlines()[1:]]


def test_the_command_after_outliers_excludes_their_rows_and_keeps_the_rest_of_the_file(two_slips):
    before = Path("seen.yaml").read_text()
    (words, accepting) = two_slips
    assert words[1:3] == ["exclude", "seen.yaml"]
    assert accepting[1:] == ["check-data", "seen.yaml", "--accept", "outliers", "--reason", ".."]
    call(*words[1:], code=0)
    after = Path("seen.yaml").read_text()
    section = load(["seen.yaml"])["seen"]["measurements"]["file"]
    assert section["exclude"] == [{"lines": [6, 7], "reason": ".."}]
    kept = [line for line in after.splitlines() if line in before.splitlines()]
    assert kept == before.splitlines()
    (following,) = next_commands(printed("check-data", "seen.yaml"))
    assert following == ["kinacc", "calibrate", "seen.yaml"]


def test_the_command_that_goes_on_all_the_same_accepts_the_finding(two_slips):
    *_, words = two_slips
    call(*[word.replace("..", "the arm jumps there") for word in words[1:]], code=1)
    accepted = load(["seen.yaml"])["seen"]["data_check"]["accept"]
    assert accepted == {"outliers": "the arm jumps there"}


def test_lines_that_are_excluded_already_or_none_leave_the_file_as_it_is(two_slips):
    call("exclude", "seen.yaml", "--lines", "6", "--reason", "first", code=0)
    before = Path("seen.yaml").read_bytes()
    for lines in ("6", "9999", "abc", "", "5-3"):
        words = ("exclude", "seen.yaml", "--lines", lines, "--reason", "x")
        assert "Traceback" not in printed(*words, code=2)
        assert Path("seen.yaml").read_bytes() == before


def test_rows_outside_the_limits_stop_the_workflow_until_they_are_excluded(two_slips):
    path, robot = Path("seen.yaml"), Path("seen.robot.yaml")
    robot.write_text(robot.read_text().replace("[-360", "[-70", 1))
    path.write_text(path.read_text().replace(load([path])["seen"]["robot"], robot.name))
    before = path.read_bytes()
    call("check-data", path, "--accept", "outside_limits", "--reason", "x", code=2)
    assert path.read_bytes() == before
    *excluding, _ = next_commands(printed("check-data", path, code=1))
    for words in excluding:
        call(*words[1:], code=0)
    assert next_commands(printed("check-data", path)) == [["kinacc", "calibrate", "seen.yaml"]]
    beyond = pd.read_csv("seen.csv")["q1_deg"] < -70.0
    lines, _ = (item["lines"] for item in load([path])["seen"]["measurements"]["file"]["exclude"])
    assert lines == [*beyond.index[beyond] + 2]


def test_frames_held_fixed_far_from_the_readings_stop_the_workflow(two_slips):
    text = Path("seen.yaml").read_text()
    Path("seen.yaml").write_text(text.replace("base_and_tool: estimated", "base_and_tool: fixed"))
    (told,) = answer("check-data", "seen.yaml", code=1)["datasets"]
    found = {item["kind"]: item for item in told["suspicions"]}["fixed_frames"]
    assert (found["level"], found["apart_mm"] > 1000.0) == ("stops", True)
