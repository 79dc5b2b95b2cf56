"""Commands and the workflow

A command cannot start faster than Python with numpy, about 0.1 s of CPU time; it may take 3.5 times
that with its work, a row or 120 poses through a model. `check-data` fits models to what it checks.

The paper's study from nothing, two cores, is held to plain Snakemake with nothing to do, about 1 s
of CPU time: 17 jobs start Python with numpy and pandas 17 times.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
from harness import ROOT, Contender, Work

CALIBRATED = """\
measurements: {folds: 2}
calibration: {vec: {order: 2}}
datasets:
  arm:
    robot: mh180
    measurements: {source: file, file: {path: poses.csv, orientation: {kind: quaternion}}}
    evaluation: {space: measured}
"""
JOINTS_DEG = "10,-20,30,0,45,0"
KEPT: list[tempfile.TemporaryDirectory] = []  # folders that go when the process ends


def works(smoke: bool) -> list[Work]:
    """Three commands, and the paper; in smoke size the first command alone."""
    own, numpy = version("kinacc"), np.__version__
    cwd = calibrated(40 if smoke else 120)
    plain = Contender("import numpy", numpy, lambda: python("-c", "import numpy", cwd=cwd))
    commands = {
        "predict": (
            "predict",
            "results/arm",
            "--model",
            "dh",
            "--json",
            "--joints-deg",
            JOINTS_DEG,
        ),
        "compare": ("compare", "results/arm", "results/arm"),
        "check-data": ("check-data", "arm.yaml"),
    }
    each = [
        Work(
            name, "start", 1,
            (Contender("kinacc", own, lambda words=words: kinacc(*words, cwd=cwd)), plain),
            _predicted if name == "predict" else lambda outputs: None,
            {plain.name: 1 / 3.5}, seconds=9.0,
        )
        for name, words in commands.items()
    ]  # fmt: skip
    if smoke:
        return each[:1]
    idle = folder()
    (idle / "Snakefile").write_text('rule all:\n    input: "there"\n')
    (idle / "there").touch()
    snakemake = ("-m", "snakemake", "--cores", 2)
    beside = Contender(
        "plain Snakemake", version("snakemake"), lambda: python(*snakemake, cwd=idle)
    )
    where = ("--snakefile", ROOT / "Snakefile", "--workflow-profile", ROOT / "profiles" / "default")
    paper = Contender("kinacc", own, lambda: python(*snakemake, *where, "--no-hooks", cwd=folder()))
    return [
        *each,
        Work("the paper, two cores", "run", 1, (paper, beside), lambda outputs: None,
             {beside.name: 1 / 20}, seconds=60.0, wall=True),
    ]  # fmt: skip


def folder() -> Path:
    """A new empty folder."""
    KEPT.append(tempfile.TemporaryDirectory(prefix="kinacc-bench-"))
    return Path(KEPT[-1].name)


def python(*words: object, cwd: Path) -> str:
    """What a Python command prints; raises with all it said if it fails."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(
        [sys.executable, *map(str, words)], cwd=cwd, env=environment, capture_output=True, text=True
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, words))}: {done.stdout}{done.stderr}")
    return done.stdout


def kinacc(*words: object, cwd: Path) -> str:
    """What a command of kinacc prints."""
    return python("-m", "kinacc", *words, cwd=cwd)


def calibrated(poses: int) -> Path:
    """A folder with arm.yaml and its calibration: errors that bend smoothly, noise of 0.05 mm."""
    from kinacc import geometry
    from kinacc.kinematics import dh, robot

    arm, random, made = robot.load("mh180"), np.random.default_rng(0), folder()
    share = random.uniform(0.2, 0.8, (poses, 6))
    q_rad = arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)
    flange = dh.forward(arm.dh, arm.dh_joints(q_rad))
    bend_mm = 0.4 * np.sin(q_rad[:, :3])
    position_mm = flange.position_mm + bend_mm + random.normal(0.0, 0.05, (poses, 3))
    turn = geometry.exp_so3(random.normal(0.0, 2e-4, (poses, 3)))
    quaternion = geometry.quaternion_from_rotation(turn @ flange.rotation)
    names = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    rows = np.hstack([np.rad2deg(q_rad), position_mm, quaternion])
    np.savetxt(
        made / "poses.csv", rows, fmt="%.9f", delimiter=",", header=",".join(names), comments=""
    )
    (made / "arm.yaml").write_text(CALIBRATED)
    kinacc("calibrate", "arm.yaml", "--cores", 1, cwd=made)
    return made


def _predicted(outputs: Sequence[str]) -> None:
    """The predicted position is within 5 mm of the nominal arm's."""
    from kinacc.kinematics import robot

    row = json.loads(outputs[0])["rows"][0]
    q_rad = np.deg2rad([float(each) for each in JOINTS_DEG.split(",")])
    nominal_mm = robot.forward(robot.load("mh180"), q_rad[None]).position_mm[0]
    np.testing.assert_allclose([row[f"{axis}_mm"] for axis in "xyz"], nominal_mm, atol=5.0)
