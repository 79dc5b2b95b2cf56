"""Someone asks Snakemake for one stage of one robot by its name, again when new data has come."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from whole_project import ROOT, write_poses

from kinacc.workflow.catalogue import STAGES
from kinacc.workflow.plan import planned

CONFIG = """\
measurements: {folds: 2, synthetic: {poses: 60}}
calibration: {vec: {order: 2}}
study: {noise_mm: [0.1], repetitions: 4, measurements: 20}
histories: {simulations_searched: 20}
choices: {names: [outlier_rule]}
figures: {formats: [svg]}
datasets:
  mh180: {robot: mh180}
  tracker:
    robot: mh180
    measurements: {source: file, file: {path: poses.csv, orientation: {kind: quaternion}}}
    evaluation: {space: measured}
"""


def snakemake(folder: Path, *targets: str, options: tuple[str, ...] = ()) -> str:
    """What Snakemake prints in a folder with a configuration; fails the test where it does."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), "-c1"]
    done = subprocess.run(
        [*command, "--nocolor", *options, "--configfile", "robots.yaml", "--", *targets],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert not done.returncode, done.stdout + done.stderr
    return done.stdout + done.stderr


def listed(folder: Path) -> dict[str, str]:
    """Names of targets, each with what Snakemake says of it."""
    text = snakemake(folder, options=("--list-target-rules",))
    return dict(re.findall(r"^(\w+)(?: \((.*)\))?$", text, re.M))


def made(folder: Path) -> dict[str, dict[str, float]]:
    """When each stage that has run was recorded, by data set."""
    found: dict[str, dict[str, float]] = {}
    for path in (folder / "results").glob("*/records/*.json"):
        found.setdefault(path.parts[-3], {})[path.stem] = path.stat().st_mtime_ns
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "robots.yaml").write_text(CONFIG)
    write_poses(tmp_path / "poses.csv")
    return tmp_path


def test_every_stage_of_every_robot_is_listed_with_what_it_does_and_can_be_planned(folder):
    names = listed(folder)
    plan = planned([folder / "robots.yaml"])
    of_robots = {
        f"{dataset}_{stage.name}": stage.message
        for dataset in plan.datasets
        for stage in plan.stages(dataset).values()
        if not stage.scattered
    }
    assert {"mh180_dh", "tracker_dh", "tracker_data_check", "tracker_report"} <= {*of_robots}
    assert not {"mh180_data_check", "compliance"} & {*names}  # no robot here goes through it
    assert names | of_robots == names
    assert all(names.values())
    text = snakemake(folder, *names, options=("--dry-run",))
    jobs = Counter(re.findall(r"^(\w+) +\d+$", text, re.M))
    assert {*of_robots} <= {*jobs}


def test_one_stage_and_what_it_needs_and_nothing_else_again_after_new_data(folder):
    snakemake(folder, "tracker_dh")
    before = made(folder)
    needed = {"measurements", "data_check", "vec"}  # nothing is fitted to data unchecked
    assert {name: {*each} for name, each in before.items()} == {"tracker": {*needed, "dh"}}

    lines = (folder / "poses.csv").read_text().splitlines()
    (folder / "poses.csv").write_text("\n".join(lines[:-1]) + "\n")
    snakemake(folder, "tracker_vec")
    after = made(folder)
    assert {*after} == {"tracker"}
    again = {name for name, when in after["tracker"].items() if when != before["tracker"][name]}
    assert again == needed


def test_of_many_robots_every_name_is_listed_and_one_is_planned(folder):
    one = (folder / "robots.yaml").read_text().partition("  tracker:\n")
    robots = "".join(f"  arm_{i}:\n{one[2]}" for i in range(21))
    (folder / "robots.yaml").write_text(f"{one[0]}{robots}")
    names = listed(folder)
    assert names["arm_20_dh"] == names["mh180_dh"] == STAGES["dh"].message
    text = snakemake(folder, "arm_20_dh", options=("--dry-run",))
    assert {*re.findall(r"^Job \d+: (\w+):", text, re.M)} == {"arm_20"}
