"""What a run on a cluster would do, told without one."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from single_node import plugin_needed
from whole_project import ROOT


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
