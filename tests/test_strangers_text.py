"""Descriptions from strangers: many data sets are taken, what would eat memory is refused soon."""

from __future__ import annotations

import json

import pytest
from command_line import call
from config.complaints import complaints

from kinacc.config.reading import read
from kinacc.measurements.intake.write import plain_name

ONE = """  arm_{0}:
    robot: ur10
    measurements:
      source: file
      folds: 5
      file:
        path: points.csv
        joint_unit: rad
        length_unit: m
        orientation: {{kind: none}}
        columns: {{q1: j1, q2: j2, q3: j3, q4: j4, q5: j5, q6: j6, x: X, y: Y, z: Z}}
    calibration: {{base_and_tool: estimated, dh: {{fit_to: measurements, hayati_joints: [2, 3]}}}}
    evaluation: {{space: measured}}
"""


def test_a_thousand_data_sets_stand_in_one_file(tmp_path):
    (tmp_path / "own.yaml").write_text("datasets:\n" + "".join(map(ONE.format, range(1000))))
    document = read(tmp_path / "own.yaml")
    assert not document.problems
    assert len(document.data["datasets"]) == 1000


@pytest.mark.parametrize(
    "text",
    [
        "datasets: {own: {robot: mh180}}\nstudy:\n"
        + "".join(f"  key_{i}: 0\n" for i in range(9_000)),
        "datasets:\n"
        + "".join(
            f"  a{i}: {{{', '.join(f'n{i}_{j}: 0' for j in range(90))}}}\n" for i in range(100)
        ),
        "datasets: {own: {robot: mh180, measurements: {source: file, file: {path: x.csv,"
        " exclude: [" + "{lines: [7], reason: a}," * 2_000 + "]}}}}\n",
    ],
    ids=["one section", "every data set", "rows excluded"],
)
def test_thousands_of_faults_are_not_all_looked_into(tmp_path, text):
    (tmp_path / "own.yaml").write_text(text)
    assert len(complaints(tmp_path / "own.yaml")) <= 101


def test_a_file_of_a_long_name_is_described_under_a_shorter_one():
    assert plain_name(f"{'a' * 200}.csv") == "a" * 100


def test_a_campaign_of_too_many_values_is_refused_before_they_are_made(tmp_path):
    (tmp_path / "campaign.json").write_text('{"format": [' + "[]," * 6_000_000 + "[]]}")
    done = call("campaign", "status", tmp_path, code=2)
    assert "campaign.json: holds too many values; allowed: at most 5,000,000" in done.output


def test_rows_in_a_file_of_json_without_end_are_refused(tmp_path):
    path = tmp_path / "joints.json"
    path.write_text(json.dumps({"rows": []}) + " " * 100_000_000)
    done = call("plan-poses", "ur10", "--poses", 9, "--candidates", path, code=2)
    assert "joints.json: is too large; allowed: at most 100 MB" in done.output
