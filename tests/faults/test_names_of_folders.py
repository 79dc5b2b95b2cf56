"""Folders and files whose names hold what programs take for something else."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import world
from whole_project import PARTS, ROOT

NAME = "a {clone} of 'ours' \"$HOME\" größe {"


def test_a_clone_and_a_measured_file_in_folders_with_braces_run(tmp_path, monkeypatch):
    clone = tmp_path / NAME
    clone.mkdir()
    for name in PARTS:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, clone / name)
        else:
            shutil.copy(ROOT / name, clone / name)
    monkeypatch.chdir(clone)
    world.inputs(clone)
    (clone / "{data}").mkdir()
    (clone / "poses.csv").rename(clone / "{data}" / "po{s}es.csv")
    path = clone / "own.yaml"
    path.write_text(path.read_text().replace("path: poses.csv", 'path: "{data}/po{s}es.csv"'))
    monkeypatch.setenv("PYTHONPATH", str(clone / "src"))
    words = ["-c1", "--configfile", "own.yaml", "--", "results/own/measurements.parquet"]
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert Path("results/own/measurements.parquet").is_file()
