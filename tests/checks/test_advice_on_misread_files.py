"""What check-data advises on files whose numbers mean something else than they say."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from kinacc.cli.group import main
from kinacc.kinematics import robot
from kinacc.measurements.intake.write import shipped_text

SERIES_D = Path(__file__).parents[2] / "examples" / "data" / "ur10_tmac" / "series_D.csv"
POSES = 60
NOISE_MM = 0.2


def measured(name, target_mm, off_mm=0.0):
    """Joints in deg and points in mm of a target on the flange, as a tracker has them.

    The arm's links and offsets are off their description by up to ``off_mm``.
    """
    arm, rng = robot.load(name), np.random.default_rng(1)
    lengths = {n: getattr(arm.dh, n) for n in ("a_mm", "d_mm")}
    lengths = {n: old + rng.uniform(-off_mm, off_mm, old.shape) for n, old in lengths.items()}
    arm = replace(arm, dh=replace(arm.dh, **lengths))
    low, high = np.maximum(arm.q_min_rad, -2.0), np.minimum(arm.q_max_rad, 2.0)
    q = rng.uniform(0.9 * low, 0.9 * high, (POSES, arm.dh.joints))
    pose = robot.forward(arm, q)
    point = pose.position_mm + pose.rotation @ np.array(target_mm)
    seen = Rotation.from_euler("xyz", [0.1, 0.2, 1.5]).apply(point) + np.array([2000, -900, 300])
    return np.rad2deg(q), seen + rng.normal(0, NOISE_MM, seen.shape)


def advice(tmp_path, q_deg, point, name):
    """Lines of check-data's answer, of a file read as degrees and millimetres."""
    names = [*(f"q{i + 1}_deg" for i in range(q_deg.shape[1])), "x_mm", "y_mm", "z_mm"]
    rows = [",".join(f"{v:.7f}" for v in row) for row in np.hstack([q_deg, point])]
    (tmp_path / "m.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    file = {"path": "m.csv", "orientation": {"kind": "none"}}
    dataset = {
        "robot": name,
        "measurements": {"source": "file", "file": file},
        "calibration": {"base_and_tool": "estimated"},
        "evaluation": {"space": "measured"},
    }
    (tmp_path / "m.yaml").write_text(yaml.safe_dump({"datasets": {"m": dataset}}))
    done = CliRunner().invoke(main, ["check-data", str(tmp_path / "m.yaml")])
    return done.output


def of_kind(text, kind):
    return next(line for line in text.splitlines() if line.startswith(f"  - {kind}:"))


def left_mm(line):
    """What is left per axis as written, and as it is meant."""
    number = r"([-+.\de]+) mm"
    found = re.search(rf"\({number} per axis as written, {number} so", line)
    return float(found[1]), float(found[2])


def test_what_metres_leave_is_said_in_millimetres(tmp_path):
    q, point = measured("ur10", [30, -20, 150])
    line = of_kind(advice(tmp_path, q, point / 1000.0, "ur10"), "length_units")
    assert "metres" in line
    assert left_mm(line)[1] == pytest.approx(NOISE_MM, rel=0.3)


def test_no_explanation_is_named_twice_and_none_undoes_itself(tmp_path):
    q, point = measured("irb120", [30, 0, 100], off_mm=8.0)
    q[:, 5] *= -1.0
    line = of_kind(advice(tmp_path, q, point / 1000.0, "irb120"), "joint_sign")
    rivals = line.partition("explained by: ")[2].rstrip(")").split(", or ")
    assert len(rivals) == len(set(rivals)) == 1
    assert "joint 5" in rivals[0]


def test_a_coupling_of_joints_2_and_3_is_not_explained_by_joint_6(tmp_path):
    q, point = measured("irb120", [0, 0, 100])
    q[:, 2] -= q[:, 1]
    text = advice(tmp_path, q, point, "irb120")
    line = of_kind(text, "joint_coupling")
    assert "joint_map: [[" in text
    assert "[0, 1, 1, 0, 0, 0]" in text
    assert "joint 3 is joint 3 plus joint 2" in line
    assert "joint 6" not in line


def test_with_the_wrong_robot_no_unit_is_blamed(tmp_path):
    q, point = measured("irb120", [30, -20, 150])
    text = advice(tmp_path, q, point, "ur10")
    assert "length_units" not in text
    assert "centimetres" not in text
    assert "check the robot" in text
    assert "unit of the positions" not in text


def test_with_the_wrong_robot_and_metres_the_unit_is_to_be_checked_too(tmp_path):
    q, point = measured("irb120", [30, -20, 150])
    text = advice(tmp_path, q, point / 1000.0, "ur10")
    assert "does_not_fit" in text
    assert "check the unit of the positions too" in text


def test_the_joint_map_that_is_advised_mends_the_coupling(tmp_path):
    q, point = measured("irb120", [30, -20, 100])
    q[:, 2] -= q[:, 1]
    text = advice(tmp_path, q, point, "irb120")
    line = re.search(r"write (joint_map: \[.*\]) into the robot file", text)[1]
    own = tmp_path / "own.yaml"
    own.write_text(f"{shipped_text('irb120')}\n{line}\n", encoding="utf-8")
    text = advice(tmp_path, q, point, str(own))
    assert "joint_coupling" not in text
    assert "does_not_fit" not in text


def test_sound_rows_that_alone_show_a_movement_are_no_slips(tmp_path):
    # Every fifth pose of a measured UR10 whose joint 4 has moved by 1 mrad: no other pose is near
    # the last two, and without them nothing tells where they are to within 0.3 m.
    names, *rows = SERIES_D.read_text().splitlines()
    table = np.array([row.split(",") for row in rows[1:300:5]], dtype=float)
    table[:, names.split(",").index("q4_deg")] += np.rad2deg(1e-3)
    text = [",".join(map(str, row)) for row in table.tolist()]
    (tmp_path / "d.csv").write_text("\n".join([names, *text]) + "\n")
    (tmp_path / "d.yaml").write_text("""\
datasets:
  d:
    robot: ur10
    measurements:
      source: file
      file: {path: d.csv, joint_unit: deg, orientation: {kind: euler, convention: XYZ}}
    calibration: {base_and_tool: estimated, dh: {fit_to: measurements}}
    evaluation: {space: measured}
""")
    done = CliRunner().invoke(main, ["check-data", str(tmp_path / "d.yaml")])
    assert "outliers" not in done.output
    assert done.exit_code == 0
