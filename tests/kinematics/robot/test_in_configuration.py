"""A robot file of any kind named in a configuration: accepted, checked, and watched for changes."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_urdf import SCARA, UR10, text_of

from kinacc.checks.contradictions import load
from kinacc.errors import InputError
from kinacc.workflow.data_sets import digests, read_data_sets

PAPER = Path(__file__).parents[3] / "config.yaml"


def own(tmp_path: Path, robot: Path, more: str = "") -> list[Path]:
    data = tmp_path / "data.csv"
    data.write_text("q1_deg,x_mm\n0,0\n")
    file = tmp_path / "own.yaml"
    file.write_text(
        f"datasets:\n  own:\n    robot: {robot}\n    measurements:\n      source: file\n"
        f"      file: {{path: {data}}}\n    evaluation: {{space: measured}}\n{more}"
    )
    return [PAPER, file]


def test_settings_are_held_to_the_joints_of_a_urdf(tmp_path):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(text_of(SCARA))
    more = "    calibration: {dh: {hayati_joints: [2, 6]}}\n"
    with pytest.raises(InputError) as refusal:
        load(own(tmp_path, urdf, more))
    assert "has no joint 6; allowed: 1 to 4" in str(refusal.value)


def test_a_urdf_file_is_a_robot_and_its_content_an_input(tmp_path):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(text_of(UR10))
    data = read_data_sets(own(tmp_path, urdf))
    files = data.robot_files("own")
    assert files == {"robot_file": str(urdf)}
    before = digests(files)
    urdf.write_text(text_of(UR10).replace("0.1273", "0.1274"))
    assert digests(files) != before


def test_a_urdf_named_by_a_yaml_is_an_input_too(tmp_path):
    (tmp_path / "arm.urdf").write_text(text_of(UR10))
    arm = tmp_path / "arm.yaml"
    arm.write_text("urdf: arm.urdf\n")
    files = read_data_sets(own(tmp_path, arm)).robot_files("own")
    assert files == {"robot_file": str(arm), "urdf_file": str(tmp_path / "arm.urdf")}
