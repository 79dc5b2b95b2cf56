"""Results folders of the arms of ``oracles.controllers``, made by the workflow's stages."""

from __future__ import annotations

from pathlib import Path

from oracles.controllers import measured
from oracles.controllers.arms import Arm
from stages_by_hand import CALIBRATED, run_stage


def calibrated(folder: Path, arm: Arm, poses: int = 90, order: int = 1) -> Path:
    """The results folder of an arm that was measured and calibrated; its files beside it."""
    config = measured.write(folder, arm, poses=poses, order=order)
    for stage in CALIBRATED:
        done = run_stage(stage, "--config", config, "--results", folder / "results")
        assert done.exit_code == 0, done.output
    return folder / "results" / "arm"
