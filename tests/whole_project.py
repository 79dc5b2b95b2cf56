"""Whole-workflow runs on a small study, in a copy of the project whose path has a space in it."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import shared_work
import yaml
from measured_files import write_readings
from preloaded import commands, python
from scipy.spatial.transform import Rotation
from shared_data import ROOT

from kinacc.config.values import overlay
from kinacc.kinematics import dh, robot

CONFIGS = ("config.yaml", "small.yaml")
PARTS = ("Snakefile", "workflow", "profiles", "config.yaml", "src")

SMALL = """\
measurements: {folds: 2, synthetic: {poses: 120}}
calibration: {vec: {order: 2}}
evaluation: {points: 12}
map: {slices_deg: [0, 30], grid_mm: 250}
study: {noise_mm: [0.1, 0.3], repetitions: 4, measurements: 20}
histories: {simulations_searched: 20}
figures: {formats: [svg]}
datasets:
  own:
    robot: mh180
    measurements: {source: file, file: {path: own data/poses.csv, orientation: {kind: quaternion}}}
    evaluation: {space: measured}
"""


@dataclass(frozen=True)
class Project:
    """A copy of the project; ``small.yaml`` is its small study of two data sets."""

    folder: Path

    def copied(self, folder: Path) -> Project:
        """A copy of it to be changed."""
        shutil.copytree(self.folder, folder, symlinks=True)
        return Project(folder)

    def snakemake(self, *targets: str, options: tuple[str, ...] = (), code: int = 0) -> str:
        """What ``snakemake`` prints; fails the test unless it ends as expected."""
        command = [python(), "-m", "snakemake", "--cores", "2", "--nocolor", *options]
        return self.run([*command, "--configfile", *CONFIGS, "--", *targets], code)

    def kinacc(self, *words: str) -> str:
        """What ``kinacc`` prints."""
        return self.run([python(), "-m", "kinacc", *words])

    def run(self, command: list[str], code: int = 0, cwd: Path | None = None) -> str:
        """Output and errors of a command started in a folder, the project's if none is named."""
        path = f"{commands()}:{os.environ['PATH']}"
        settings = os.environ | {"PYTHONPATH": str(self.folder / "src"), "PATH": path}
        done = subprocess.run(
            command, cwd=cwd or self.folder, env=settings, capture_output=True, text=True
        )
        text = done.stdout + done.stderr
        assert done.returncode == code, text
        return text

    def to_do(self) -> set[str]:
        """The rules a run would go through now."""
        text = self.snakemake(options=("--dry-run", "--quiet", "reason"))
        table = text.partition("Job stats:")[2].partition("\ntotal ")[0]
        found = set(re.findall(r"^(\w+) +\d+$", table, re.M)) - {"all"}
        assert found or "Nothing to be done" in text, text
        return found

    def configure(self, text: str) -> None:
        """Add to the small study's configuration."""
        path = self.folder / "small.yaml"
        changed = overlay(yaml.safe_load(path.read_text()), yaml.safe_load(text))
        path.write_text(yaml.safe_dump(changed))

    def append(self, name: str, line: str) -> None:
        """Add a line to a file."""
        with (self.folder / name).open("a") as file:
            file.write(line + "\n")

    def digests(self) -> dict[str, str]:
        """Content of every artefact and picture, without logs and parts."""
        results = self.folder / "results"
        return {
            path.relative_to(results).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(results.rglob("*"))
            if path.is_file()
            and not {"logs", "study_chunk"} & {*path.parts, path.name.partition(".")[0]}
        }


def copy(target: Path) -> None:
    """Copy the project with the times of its files, which Snakemake and numba's cache go by."""
    target.mkdir(parents=True)
    for name in PARTS:
        copied = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copied(ROOT / name, target / name)


def write_poses(path: Path) -> None:
    """A file of measured poses: the nominal arm in joint space, shifted by a known small error."""
    arm = robot.load("mh180")
    generator = np.random.default_rng(3)
    share = generator.uniform(0.2, 0.8, (60, 6))
    q_rad = arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)
    flange = dh.forward(arm.dh, arm.dh_joints(q_rad))
    position = flange.position_mm + generator.normal(0.0, 0.2, (60, 3))
    turn = Rotation.from_rotvec(generator.normal(0.0, 2e-4, (60, 3)))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_readings(path, q_rad, position, turn * Rotation.from_matrix(flange.rotation))


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Project:
    """A project whose small study has been run; shared by all workers, never changed."""

    def run(folder: Path) -> None:
        project = Project(folder / "project")
        copy(project.folder)
        (project.folder / "small.yaml").write_text(SMALL)
        write_poses(project.folder / "own data" / "poses.csv")
        project.snakemake()

    return Project(shared_work.once(tmp_path_factory, "finished project", run) / "project")


@pytest.fixture
def project(finished: Project, tmp_path: Path) -> Project:
    """A copy of the finished project to be changed."""
    return finished.copied(tmp_path / "a project")
