"""Results folders of the arms of ``oracles.controllers``, made by the workflow's stages."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from oracles.controllers import measured
from oracles.pendants.controllers import MAKERS
from stages_by_hand import CALIBRATED, run_stages

_FOLDER = TemporaryDirectory()  # of all tests of a run


@cache
def calibrated(maker: str, wave: float = 0.0, poses: int = 90, order: int = 1) -> Path:
    """The results folder of a maker's arm that was measured and calibrated; its files beside it."""
    folder = Path(_FOLDER.name) / f"{maker}_{wave}_{poses}_{order}"
    folder.mkdir()
    arm = replace(MAKERS[maker], wave=wave)
    config = measured.write(folder, arm, poses=poses, order=order, folds=3)
    return run_stages(CALIBRATED, [config], folder / "results")
