"""Results whose files or settings changed after them are named as outdated, in one line."""

import json
import sys

import pytest
from command_line import call
from preloaded import python
from stages_by_hand import run_stages
from tracked_arm import init_seen, quickened, tracked

from kinacc.workflow.start import run_workflow

COMMANDS = {
    "predict": ("predict", "results/seen", "--joints-deg", "10,-80,70,20,30,40", "--json"),
    "export": ("export", "results/seen", "--out", "out", "--force", "--json"),
    "summary": ("summary", "results/seen", "--json"),
    "report": ("report", "results/seen"),
}


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """A folder with a calibration; the workflow itself read its files, stages by hand fitted it."""
    folder = tmp_path_factory.mktemp("cell")
    init_seen(folder, tracked(poses=60))
    quickened(folder / "seen.yaml")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "executable", python())
        assert run_workflow("results/seen/measurements.parquet", ["seen.yaml"], 1) == 0
        run_stages(("vec", "dh", "residuals", "summary"), ["seen.yaml"])
    return folder


@pytest.fixture
def cell(calibrated, monkeypatch):
    """The folder of a calibration, whose files are as they were after the test."""
    monkeypatch.chdir(calibrated)
    kept = {path: path.read_bytes() for path in calibrated.glob("seen.*")}
    yield calibrated
    for path, content in kept.items():
        path.write_bytes(content)


def outdated(name):
    """Lines on outdated results that a command prints; its JSON agrees with them."""
    done = call(*COMMANDS[name], code=0)
    lines = [line for line in done.stderr.splitlines() if "outdated" in line]
    if "--json" in COMMANDS[name]:
        answer = json.loads(done.stdout)
        assert bool(answer.get("seen", answer).get("outdated")) == bool(lines)
    return lines


@pytest.mark.parametrize("name", COMMANDS)
def test_a_measured_file_that_changed_is_named_in_one_line(cell, name):
    path = cell / "seen.csv"
    path.write_text(f"{path.read_text()}\n")
    (line,) = outdated(name)
    assert "seen.csv" in line
    assert line.endswith("run kinacc calibrate seen.yaml")


def test_a_changed_setting_or_robot_file_is_named_and_a_comment_is_not(cell):
    path, robot = cell / "seen.yaml", cell / "seen.robot.yaml"
    text = path.read_text()
    path.write_text(f"# looked at again\n{text}")
    assert outdated("summary") == []
    path.write_text(text.replace("folds: 2", "folds: 3"))
    (line,) = outdated("summary")
    assert "seen.yaml" in line
    path.write_text(text)
    robot.write_text(f"{robot.read_text()}# another\n")
    (line,) = outdated("summary")
    assert "seen.robot.yaml" in line
