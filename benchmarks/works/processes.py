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
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd
from harness import ROOT, Contender, Work

from kinacc.geometry import exp_so3, quaternion_from_rotation
from kinacc.kinematics import robot

CALIBRATED = """\
measurements: {folds: 2}
calibration: {vec: {order: 2}}
datasets:
  arm:
    robot: mh180
    measurements: {source: file, file: {path: poses.csv, orientation: {kind: quaternion}}}
    evaluation: {space: measured}
"""
COMMANDS = {
    "predict": "-m kinacc predict results/arm --model dh --json --joints-deg 10,-20,30,0,45,0",
    "compare": "-m kinacc compare results/arm results/arm",
    "check-data": "-m kinacc check-data arm.yaml",
}
KEPT: list[tempfile.TemporaryDirectory] = []  # folders that go when the process ends


def works(smoke: bool) -> list[Work]:
    """Three commands, and the paper; in smoke size the first command alone."""
    own, cwd = version("kinacc"), calibrated(40 if smoke else 120)
    plain = Contender("import numpy", np.__version__, lambda: python(["-c", "import numpy"], cwd))
    each = [
        Work(
            name, "start", 1,
            (Contender("kinacc", own, partial(python, line.split(), cwd)), plain),
            _predicted if name == "predict" else lambda outputs: None,
            {plain.name: 1 / 3.5}, seconds=9.0,
        )
        for name, line in COMMANDS.items()
    ]  # fmt: skip
    if smoke:
        return each[:1]
    idle = folder()
    (idle / "Snakefile").write_text('rule all:\n    input: "there"\n')
    (idle / "there").touch()
    start = ["-m", "snakemake", "--cores", "2"]
    where = f"--snakefile {ROOT}/Snakefile --workflow-profile {ROOT}/profiles/default --no-hooks"
    paper = Contender("kinacc", own, lambda: python(start + where.split(), folder()))
    beside = Contender("plain Snakemake", version("snakemake"), lambda: python(start, idle))
    return [
        *each,
        Work("the paper, two cores", "run", 1, (paper, beside), lambda outputs: None,
             {beside.name: 1 / 20}, seconds=60.0, wall=True),
    ]  # fmt: skip


def folder() -> Path:
    """A new empty folder."""
    KEPT.append(tempfile.TemporaryDirectory(prefix="kinacc-bench-"))
    return Path(KEPT[-1].name)


def python(words: list[str], cwd: Path) -> str:
    """What a Python command prints; raises with its output if it fails."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src"), "PYTHONDONTWRITEBYTECODE": ""}
    done = subprocess.run(
        [sys.executable, *words], cwd=cwd, env=environment, capture_output=True, text=True
    )
    if done.returncode:
        raise RuntimeError(f"{words}: {done.stdout}{done.stderr}")
    return done.stdout


def calibrated(poses: int) -> Path:
    """A folder with arm.yaml and its calibration: errors that bend smoothly, noise of 0.05 mm."""
    arm, random, made = robot.load("mh180"), np.random.default_rng(0), folder()
    share = random.uniform(0.2, 0.8, (poses, 6))
    q_rad = arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)
    flange = robot.forward(arm, q_rad)
    bent_mm = 0.4 * np.sin(q_rad[:, :3]) + random.normal(0.0, 0.05, (poses, 3))
    turn = exp_so3(random.normal(0.0, 2e-4, (poses, 3))) @ flange.rotation
    names = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    columns = np.rad2deg(q_rad), flange.position_mm + bent_mm, quaternion_from_rotation(turn)
    pd.DataFrame(np.hstack(columns), columns=names).to_csv(made / "poses.csv", index=False)
    (made / "arm.yaml").write_text(CALIBRATED)
    python(["-m", "kinacc", "calibrate", "arm.yaml", "--cores", "1"], made)
    return made


def _predicted(outputs) -> None:
    """The predicted position is within 5 mm of the nominal arm's."""
    row = json.loads(outputs[0])["rows"][0]
    q_rad = np.deg2rad([10, -20, 30, 0, 45, 0])
    nominal_mm = robot.forward(robot.load("mh180"), q_rad[None]).position_mm[0]
    np.testing.assert_allclose([row[f"{axis}_mm"] for axis in "xyz"], nominal_mm, atol=5.0)
