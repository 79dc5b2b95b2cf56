"""A robot file named in a configuration is watched for changes."""

from __future__ import annotations

from pathlib import Path

from test_urdf import UR10, text_of

from kinacc.workflow.data_sets import digests, read_data_sets

PAPER = Path(__file__).parents[3] / "config.yaml"


def own(tmp_path: Path, robot: Path) -> list[Path]:
    data = tmp_path / "data.csv"
    data.write_text("q1_deg,x_mm\n0,0\n")
    file = tmp_path / "own.yaml"
    file.write_text(
        f"datasets:\n  own:\n    robot: {robot}\n    measurements:\n      source: file\n"
        f"      file: {{path: {data}}}\n    evaluation: {{space: measured}}\n"
    )
    return [PAPER, file]


def test_a_urdf_named_by_a_yaml_is_an_input_too(tmp_path):
    (tmp_path / "arm.urdf").write_text(text_of(UR10))
    arm = tmp_path / "arm.yaml"
    arm.write_text("urdf: arm.urdf\n")
    files = read_data_sets(own(tmp_path, arm)).robot_files("own")
    assert files == {"robot_file": str(arm), "urdf_file": str(tmp_path / "arm.urdf")}
    before = digests(files)
    (tmp_path / "arm.urdf").write_text(text_of(UR10).replace("0.1273", "0.1274"))
    assert digests(files) != before
