"""The commands that use a calibration, as a person calls them: answers, files, mistakes."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import call, small_study

from kinacc.kinematics import robot


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of a small synthetic study, made by the workflow's own stages."""
    return small_study(tmp_path_factory.mktemp("study"))


def test_predict_and_compensate_undo_each_other(folder, tmp_path):
    joints, poses, back = (tmp_path / name for name in ("joints.csv", "poses.csv", "back.csv"))
    q_deg = np.random.default_rng(0).uniform(-20, 20, (12, 6))
    q_deg[:, 4] += 60.0
    names = ",".join(f"q{i}_deg" for i in range(1, 7))
    np.savetxt(joints, q_deg, delimiter=",", header=names, comments="")
    made = call("predict", folder, joints, "--robot", "mh180", "--model", "dh", "-o", poses)
    assert made.exit_code == 0, made.output
    rows = list(csv.DictReader(poses.open()))
    assert len(rows) == 12
    for name in ("x_mm", "std_position_mm", "std_orientation_mrad", "unexplained_mm",
                 "undetermined_mm", "status"):  # fmt: skip
        assert rows[0][name]
    done = call("compensate", folder, poses, "--robot", "mh180", "--model", "dh", "-o", back)
    assert done.exit_code == 0, done.output
    rows = list(csv.DictReader(back.open()))
    assert all(row["status"].startswith("converged") for row in rows)
    assert max(float(row["solver_residual_mm"]) for row in rows) <= 1e-6
    found = np.array([[float(row[f"q{i}_deg"]) for i in range(1, 7)] for row in rows])
    assert np.abs(found - q_deg).max() < 1e-6


def test_a_program_is_corrected_and_files_are_kept(folder, tmp_path):
    program, out = tmp_path / "program.csv", tmp_path / "out.csv"
    program.write_text("q1_rad;q2_rad;q3_rad;q4_rad;q5_rad;q6_rad\n0,1;0,2;-0,1;0,2;1,0;0,3\n")
    words = ("compensate", folder, "--program", program, "--robot", "mh180", "-o", out)
    assert call(*words).exit_code == 0
    before = out.read_text()
    again = call(*words)
    assert again.exit_code == 2
    assert "--force" in again.output
    assert out.read_text() == before
    assert call(*words, "--force").exit_code == 0


def test_poses_without_joints_say_why_and_fail_the_command(folder):
    done = call("compensate", folder, "--robot", "mh180", "--pose", "9000,0,0,1,0,0,0", "--json")
    assert done.exit_code == 1
    content = json.loads(done.stdout)
    assert content["rows"][0]["q1_deg"] is None
    assert "not reached" in content["rows"][0]["status"]


def test_every_mistake_in_a_file_is_named(folder, tmp_path):
    bad = tmp_path / "bad.csv"
    bad.write_text("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,x_mm\n1,2,3,x,5,6\n")
    done = call("predict", folder, bad, "--robot", "mh180")
    assert done.exit_code == 2
    assert "q6_deg or q6_rad" in done.output
    poses = tmp_path / "poses.csv"
    poses.write_text("x_mm,y_mm,z_mm,qw,qx,qy,qz\n1,2,3,0.5,0,0,0\n")
    done = call("compensate", folder, poses, "--robot", "mh180")
    assert done.exit_code == 2
    assert "length 0.5" in done.output
    radians = tmp_path / "radians.csv"
    radians.write_text(",".join(f"q{i}_rad" for i in range(1, 7)) + "\n20,30,10,0,60,0\n")
    done = call("predict", folder, radians, "--robot", "mh180")
    assert done.exit_code == 2
    assert "q1_deg" in done.output
    assert "Traceback" not in done.output


def test_export_writes_every_form(folder, tmp_path):
    done = call("export", folder, "--robot", "mh180", "--out", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    files = [Path(name).name for name in json.loads(done.stdout)["files"]]
    assert sorted(files) == ["mh180.csv", "mh180.json", "mh180.urdf", "mh180.yaml",
                             "mh180_tables.md", "mh180_tables.tex"]  # fmt: skip
    left_open = json.loads((tmp_path / "mh180.json").read_text())["undetermined"]
    (known,) = json.loads(call("summary", folder, "--json").output).values()
    assert len(left_open) == len(known["unidentifiable"] + known["poorly_determined"]) > 0
    assert f"Left open by the poses: {left_open[0]}" in (tmp_path / "mh180_tables.md").read_text()
    compared = call("compare", tmp_path / "mh180.yaml", folder, "--robot", "mh180", "--json")
    assert compared.exit_code == 0, compared.output
    assert json.loads(compared.stdout)["shifts"][0]["largest_mm"] < 1e-9


def test_compare_says_that_robots_differ_and_refuses_what_cannot_be_compared():
    other = call("compare", "irb120", "meca500", "--json")
    assert other.exit_code == 0, other.output
    assert json.loads(other.stdout)["verdict"] == "different robots"
    assert call("compare", "mh180", "iiwa14").exit_code == 2


def test_plan_poses_writes_joints_a_controller_can_read(tmp_path):
    out, picture = tmp_path / "plan.csv", tmp_path / "index.svg"
    done = call("plan-poses", "ur10", "--poses", "12", "--candidates", "120", "--hayati", "2,3",
                "-o", out, "--picture", picture)  # fmt: skip
    assert done.exit_code == 0, done.output
    rows = list(csv.DictReader(out.open()))
    assert [row["order"] for row in rows] == [str(i) for i in range(1, 13)]
    assert len({row["candidate"] for row in rows}) == 12
    assert picture.stat().st_size > 5000
    again = call("plan-poses", "ur10", "--poses", "12", "--candidates", out, "--json")
    assert again.exit_code == 0, again.output
    content = json.loads(again.stdout)
    assert content["poses"] == 12
    assert content["undetermined"]


def test_results_say_which_robot_they_were_made_with(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # no configuration here
    words = ("predict", folder.resolve(), "--joints-deg", "0,0,0,0,60,0")
    told = call(*words)
    assert told.exit_code == 0, told.output
    assert told.output == call(*words, "--robot", "mh180").output
    other = tmp_path / "signs.yaml"
    text = robot.as_yaml(robot.load("mh180")).replace("limits_rad", "sign: -1, limits_rad", 1)
    other.write_text(text)
    refused = call(*words, "--robot", other)
    assert refused.exit_code == 2
    (folder / "robot.parquet").rename(tmp_path / "robot.parquet")
    try:
        assert "--robot" in call(*words).output
    finally:
        (tmp_path / "robot.parquet").rename(folder / "robot.parquet")
