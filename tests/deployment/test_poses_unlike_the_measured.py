"""A measured UR10 whose flange pointed one way: what its poses left open, wherever it is used."""

from __future__ import annotations

import csv

import pytest
import shared_data
from command_line import call
from oracles import small_study

from kinacc.kinematics import robot

SERIES = shared_data.place("ur10_tmac/series_D.csv")
SETTINGS = f"""
datasets:
  arm:
    robot: ur10
    measurements: {{source: file, file: {{path: {SERIES}}}, folds: 5, validation_fold: 0}}
    calibration:
      base_and_tool: estimated
      vec: {{order: 2}}
      dh: {{fit_to: measurements, hayati_joints: auto}}
"""
MEASURED = "53.5,-102.7,87.07,15.63,53.53,-90"
TURNED_AWAY = "53.5,-102.7,87.07,15.63,13.53,-90"
TOLD = "tool z"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("series")
    config = place / "config.yaml"
    config.write_text(SETTINGS, encoding="utf-8")
    stages = ("measurements", "vec", "dh", "residuals")
    return small_study.run_stages(config, "arm", place / "results", stages)


def test_every_exported_file_says_what_is_left_open(folder, tmp_path):
    shown = call("export", folder, "--out", tmp_path)
    assert shown.exit_code == 0, shown.output
    (warned,) = [line for line in shown.stderr.splitlines() if line.startswith("warning")]
    assert TOLD in warned
    files = sorted(tmp_path.iterdir())
    assert len(files) == 6
    for path in files:
        text = " ".join(path.read_text(encoding="utf-8").split())
        assert TOLD in text, path.name
    # They are read as before.
    assert robot.load(str(tmp_path / "arm.yaml")).dh.joints == 6
    assert robot.load(str(tmp_path / "arm.urdf")).dh.joints == 6
    with open(tmp_path / "arm.csv", newline="", encoding="utf-8") as file:
        assert [row["joint"] for row in csv.DictReader(file)] == list("123456")
