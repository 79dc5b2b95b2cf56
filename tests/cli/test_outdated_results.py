"""Results whose files or settings changed after them are named as outdated, in one line."""

import json

import pytest
from click.testing import CliRunner
from tracked_arm import table, tracked

from kinacc.cli.group import main

JOINTS = "10,-80,70,20,30,40"


def call(*words, code=0):
    done = CliRunner().invoke(main, [str(each) for each in words])
    assert done.exit_code == code, done.output
    return done


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cell")
    arm = tracked(poses=60)
    names = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    (folder / "seen.csv").write_text(table(names, arm.q, arm.point))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        call("init", "seen.csv", "--robot", "ur10", "--yes")
        path = folder / "seen.yaml"  # models that are fitted in a second
        text = path.read_text().replace("order: auto", "order: 1").replace("folds: 5", "folds: 2")
        path.write_text(text)
        call("calibrate", "seen.yaml", "--cores", "1")
    return folder


@pytest.fixture
def cell(calibrated, monkeypatch):
    """The folder of a calibration, whose files are as they were after the test."""
    monkeypatch.chdir(calibrated)
    kept = {path: path.read_bytes() for path in calibrated.glob("seen.*")}
    yield calibrated
    for path, content in kept.items():
        path.write_bytes(content)


def commands(cell):
    return {
        "predict": ("predict", "results/seen", "--joints-deg", JOINTS, "--json"),
        "compensate": ("compensate", "results/seen", "--pose", "500,-400,600,0,1,0,0", "--json"),
        "export": ("export", "results/seen", "--out", "out", "--force", "--json"),
        "summary": ("summary", "results/seen", "--json"),
        "report": ("report", "results/seen"),
    }


def said(cell, name):
    words = commands(cell)[name]
    done = CliRunner().invoke(main, list(words))
    assert done.exit_code in (0, 1), done.output  # 1: a row without joints
    lines = [line for line in done.stderr.splitlines() if "outdated" in line]
    if "--json" in words:
        answer = json.loads(done.stdout)
        assert bool(answer.get("seen", answer).get("outdated")) == bool(lines)
    return lines


NAMES = ("predict", "compensate", "export", "summary", "report")


@pytest.mark.parametrize("name", NAMES)
def test_a_measured_file_that_changed_is_named_in_one_line(cell, name):
    text = (cell / "seen.csv").read_text()
    (cell / "seen.csv").write_text(f"{text}\n")
    (line,) = said(cell, name)
    assert "seen.csv" in line


def test_a_changed_setting_or_robot_file_is_named_and_a_comment_is_not(cell):
    path = cell / "seen.yaml"
    text = path.read_text()
    path.write_text(f"# looked at again\n{text}")
    assert said(cell, "summary") == []
    path.write_text(text.replace("folds: 2", "folds: 3"))
    (line,) = said(cell, "summary")
    assert "seen.yaml" in line
    path.write_text(text)
    robot = cell / "seen.robot.yaml"
    robot.write_text(f"{robot.read_text()}# another\n")
    (line,) = said(cell, "summary")
    assert "seen.robot.yaml" in line
