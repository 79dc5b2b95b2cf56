"""A robot file named in a configuration is watched for changes."""

from __future__ import annotations

from test_urdf import UR10, text_of

from kinacc.workflow.data_sets import read_data_sets


def test_a_urdf_named_by_a_yaml_is_an_input_too(tmp_path):
    arm, urdf, data, config = (
        tmp_path / name for name in ("arm.yaml", "arm.urdf", "data.csv", "own.yaml")
    )
    arm.write_text("urdf: arm.urdf\n")
    urdf.write_text(text_of(UR10))
    data.write_text("q1_deg,x_mm\n0,0\n")
    config.write_text(
        f"datasets: {{own: {{robot: {arm}, measurements: {{source: file, file: {{path: {data}}}}}, "
        "evaluation: {space: measured}}}\n"
    )
    files = read_data_sets([config]).robot_files("own")
    assert files == {"robot_file": str(arm), "urdf_file": str(urdf)}
