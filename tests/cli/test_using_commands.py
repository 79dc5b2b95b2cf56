"""The commands that use a calibration, as a person calls them: answers, files, mistakes."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

from command_line import answer, call


def test_export_writes_every_form(study, tmp_path):
    told = answer("export", study, "--out", tmp_path)
    files = [Path(name).name for name in told["files"]]
    assert sorted(files) == ["mh180.csv", "mh180.json", "mh180.urdf", "mh180.yaml",
                             "mh180_tables.md", "mh180_tables.tex"]  # fmt: skip
    left_open = json.loads((tmp_path / "mh180.json").read_text())["undetermined"]
    (known,) = answer("summary", study).values()
    assert len(left_open) == len(known["unidentifiable"] + known["poorly_determined"]) > 0
    assert f"Left open by the poses: {left_open[0]}" in (tmp_path / "mh180_tables.md").read_text()
    assert answer("compare", tmp_path / "mh180.yaml", study)["shifts"][0]["largest_mm"] < 1e-9


def test_arms_of_six_and_seven_joints_are_not_compared():
    call("compare", "mh180", "iiwa14", code=2)


def test_frames_are_not_asked_for_where_the_input_is_closed(study, tmp_path):
    (tmp_path / "w.src").write_text("PTP {X 1,Y 2,Z 3,A 0,B 0,C 0}\n")
    command = f'"{sys.executable}" -m kinacc compensate "{study}" --program w.src <&-'
    assert subprocess.run(["sh", "-c", command], cwd=tmp_path).returncode == 2


def test_an_orientation_in_two_forms_is_refused(study, tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text("x_mm,y_mm,z_mm,qw,qx,qy,qz,rx_deg,ry_deg,rz_deg\n9,0,8,1,0,0,0,0,90,0\n")
    assert "do not tell the orientation" in call("compensate", study, path, code=2).output


def test_what_campaign_start_names_next_runs_as_printed(study, tmp_path):
    folder = tmp_path / "my arm's check"
    done = call("campaign", "start", folder, "--calibration", study, "--model", "dh",
                "--candidates", 5, "--budget", 5, "--noise-mm", 0.05, code=0)  # fmt: skip
    line = re.search(r"^Next: kinacc (.*)$", done.output, re.MULTILINE)[1]
    shown = call(*shlex.split(line), code=0)
    assert "reading 1 of 5" in shown.output
