"""What a run on a cluster would do, told without one."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys

import pytest
from single_node import ABSENT, plugin_needed
from whole_project import ROOT, SMALL, write_poses


def dry_run(folder, profile, *options):
    """What Snakemake says of the paper's study on a cluster, started from an empty folder."""
    plugin_needed(profile)
    command = [sys.executable, "-m", "snakemake", "-n", "--snakefile", ROOT / "Snakefile"]
    command += ["--profile", ROOT / "profiles" / profile, *options]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "src"), *sys.path])}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.parametrize("profile", ["slurm", "kubernetes"])
def test_the_papers_study_would_be_two_jobs(tmp_path, profile):
    said = dry_run(tmp_path, profile)
    assert sorted(re.findall(r"Group job (\w+)", said)) == ["calibration", "examples"]
    assert "This was a dry-run" in said


def test_results_go_to_a_volume_and_measured_files_stay_where_they_are(tmp_path):
    plugin_needed("kubernetes")
    if shutil.which("rsync") is None:
        pytest.skip(f"{ABSENT}no rsync, by which the storage plugin copies files")
    (tmp_path / "small.yaml").write_text(SMALL)
    write_poses(tmp_path / "own data" / "poses.csv")
    volume = tmp_path / "volume"
    command = [sys.executable, "-m", "snakemake", "-c1", "--snakefile", ROOT / "Snakefile"]
    command += ["--default-storage-provider", "fs", "--default-storage-prefix", volume]
    command += ["--configfile", ROOT / "config.yaml", "small.yaml"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "src"), *sys.path])}
    done = subprocess.run(
        # A model is read from a table, which is held to a record: both come from the volume.
        [*command, "--", "results/own/data_check.parquet", "results/own/dh_model.parquet"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (volume / "results" / "own" / "data_check.parquet").is_file()
    assert (volume / "results" / "own" / "dh_model.parquet").is_file()
    assert not (tmp_path / "results").exists()
