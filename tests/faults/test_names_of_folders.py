"""Folders and files whose names hold what programs take for something else."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import world
from whole_project import PARTS, ROOT

NAME = "a {clone} of 'ours' \"$HOME\" größe {"


def test_a_clone_in_a_folder_with_braces_runs_and_a_measured_file_with_them_is_refused(
    tmp_path, monkeypatch
):
    clone = tmp_path / NAME
    clone.mkdir()
    for name in PARTS:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, clone / name)
        else:
            shutil.copy(ROOT / name, clone / name)
    monkeypatch.chdir(clone)
    monkeypatch.setenv("PYTHONPATH", str(clone / "src"))
    world.inputs(clone)
    words = ["-c1", "--configfile", "own.yaml", "--", "results/own/measurements.parquet"]
    done = _run("snakemake", *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert Path("results/own/measurements.parquet").is_file()

    Path("{data}").mkdir()
    Path("poses.csv").rename("{data}/poses.csv")
    path = Path("own.yaml")
    path.write_text(path.read_text().replace("path: poses.csv", 'path: "{data}/poses.csv"'))
    done = _run("kinacc", "calibrate", "own.yaml")
    assert done.returncode == 2
    assert "{data}/poses.csv: has braces in its name" in done.stderr
    assert "Traceback" not in done.stderr


def _run(module: str, *words: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", module, *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)
