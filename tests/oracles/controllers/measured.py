"""Simulated measurements of an arm: what a tracker writes, and where its tool truly is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from measured_files import write_noisy
from scipy.spatial.transform import Rotation

from oracles.controllers.arms import Arm
from oracles.kinematics import frame

# The arm's base in the tracker's frame, and the measured target on the flange.
BASE = frame(2600.0, -700.0, 350.0, Rotation.from_rotvec([0.2, -0.4, 1.9]))
TOOL = frame(40.0, -25.0, 160.0, Rotation.from_rotvec([0.3, 0.2, -0.6]))
NOISE_MM, NOISE_RAD = 0.03, 6e-5


def seen(arm: Arm, shown: np.ndarray) -> np.ndarray:
    """Where the target of the true arm is, in the tracker's frame, at joints shown (..., 6)."""
    return BASE @ arm.pose(shown, true=True) @ TOOL


def write(folder: Path, arm: Arm, poses: int = 90, order: int = 1, folds: int = 5) -> Path:
    """A robot file, a file of measured poses and a configuration; the configuration's path."""
    rng = np.random.default_rng(11)
    shown = arm.draw(rng, poses)
    write_noisy(folder / "poses.csv", shown, seen(arm, shown), rng, NOISE_MM, NOISE_RAD)
    (folder / "robot.yaml").write_text(arm.description())
    config = folder / "arm.yaml"
    config.write_text(
        "datasets: {arm: {robot: robot.yaml}}\n"
        f"measurements: {{source: file, folds: {folds}, file: {{path: poses.csv,"
        " orientation: {kind: quaternion}}}\n"
        f"calibration: {{base_and_tool: estimated, vec: {{order: {order}}},"
        " dh: {fit_to: measurements, hayati_joints: auto}}\n"
        "evaluation: {space: measured}\n"
    )
    return config
