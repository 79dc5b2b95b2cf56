"""Commands and workflow of the kinacc that is imported, each in a folder of its own."""

from __future__ import annotations

import contextlib
import functools
import io
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from harness import ONE_THREAD

KEPT: list[tempfile.TemporaryDirectory] = []  # folders that go when the process ends

CALIBRATED = """\
measurements: {folds: 2}
calibration: {vec: {order: 2}}
datasets:
  arm:
    robot: mh180
    measurements: {source: file, file: {path: poses.csv, orientation: {kind: quaternion}}}
    evaluation: {space: measured}
"""


def tree() -> Path:
    """The project the imported kinacc stands in."""
    import kinacc

    return Path(kinacc.__file__).parents[2]


def folder() -> Path:
    """A new empty folder; it goes when the process ends."""
    KEPT.append(tempfile.TemporaryDirectory(prefix="kinacc-bench-"))
    return Path(KEPT[-1].name)


def environment() -> dict[str, str]:
    """Of a command of the imported kinacc; bytecode is kept, as after `make reproduce`."""
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    return kept | ONE_THREAD | {"PYTHONPATH": str(tree() / "src")}


def python(*words: object, cwd: Path, allowed: Sequence[int] = (0,)) -> str:
    """What a Python command prints on standard output; raises with all it said if it fails."""
    done = subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=cwd, env=environment(), capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode not in allowed:
        raise RuntimeError(f"{' '.join(map(str, words))}: {done.stdout}{done.stderr}")
    return done.stdout


def kinacc(*words: object, cwd: Path, allowed: Sequence[int] = (0,)) -> str:
    """What a command of kinacc prints."""
    return python("-m", "kinacc", *words, cwd=cwd, allowed=allowed)


def called(*words: object, cwd: Path, allowed: Sequence[int] = (0,)) -> str:
    """The same within this process: what is imported by now costs nothing."""
    from kinacc.cli.group import main

    with contextlib.chdir(cwd), contextlib.redirect_stdout(io.StringIO()) as said:
        try:
            code = main(list(map(str, words)), standalone_mode=False)
        except SystemExit as ended:
            code = ended.code
    if code not in (None, *allowed):
        raise RuntimeError(f"{' '.join(map(str, words))}: {said.getvalue()}")
    return said.getvalue()


def snakemake(*words: object, cwd: Path) -> str:
    """What the workflow prints, run in ``cwd`` as from the project's own folder."""
    where = (
        "--snakefile",
        tree() / "Snakefile",
        "--workflow-profile",
        tree() / "profiles" / "default",
    )
    return python("-m", "snakemake", *where, *words, cwd=cwd)


def measured_file(path: Path, poses: int, seed: int) -> None:
    """Measured poses of a shipped arm, with errors that bend smoothly and noise of 0.05 mm."""
    import numpy as np

    from kinacc import geometry
    from kinacc.kinematics import dh, robot

    arm = robot.load("mh180")
    random = np.random.default_rng(seed)
    share = random.uniform(0.2, 0.8, (poses, 6))
    q_rad = arm.q_min_rad + share * (arm.q_max_rad - arm.q_min_rad)
    flange = dh.forward(arm.dh, arm.dh_joints(q_rad))
    bend_mm = 0.4 * np.sin(q_rad[:, :3] + 0.1 * seed)
    position_mm = flange.position_mm + bend_mm + random.normal(0.0, 0.05, (poses, 3))
    turn = geometry.exp_so3(random.normal(0.0, 2e-4, (poses, 3)))
    quaternion = geometry.quaternion_from_rotation(turn @ flange.rotation)
    names = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    rows = np.hstack([q_rad * 180.0 / math.pi, position_mm, quaternion])
    lines = [",".join(names), *(",".join(f"{value:.9f}" for value in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


@functools.cache
def calibrated(poses: int) -> Path:
    """A folder with the configuration arm.yaml and its calibration in results/arm."""
    made = folder()
    measured_file(made / "poses.csv", poses, seed=0)
    (made / "arm.yaml").write_text(CALIBRATED)
    kinacc("calibrate", "arm.yaml", "--cores", 1, cwd=made)
    return made
