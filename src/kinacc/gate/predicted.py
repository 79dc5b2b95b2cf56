"""Two calibrations held to each other by the poses that they predict where was measured.

What the poses do not determine differs without a meaning: parameters of parallel axes that only
count together, a base that a first link takes up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kinacc.artifacts import store
from kinacc.artifacts.columns import SAME_WITHIN, Columns
from kinacc.artifacts.error_models import FITTED, NOMINAL
from kinacc.calibration.models import Fit
from kinacc.calibration.observations import Observations
from kinacc.calibration.residuals import seen
from kinacc.deployment.folder import recorded_robot
from kinacc.errors import InputError, Problem
from kinacc.gate.made import Made
from kinacc.geometry import log_so3
from kinacc.kinematics.robot import Robot
from kinacc.workflow.calibration_settings import delivered_fits, observed


@dataclass(frozen=True)
class Apart:
    """The largest difference of predicted poses, orientations where they were measured."""

    position_mm: float
    orientation_mrad: float

    @property
    def same(self) -> bool:
        """Whether it is within what two runs of one work may differ by."""
        return (
            self.position_mm <= SAME_WITHIN["mm"] and self.orientation_mrad <= SAME_WITHIN["mrad"]
        )

    def __str__(self) -> str:
        return (
            f"poses predicted where was measured differ by up to {self.position_mm:.2g} mm and "
            f"{self.orientation_mrad:.2g} mrad"
        )


def apart(before: Made, now: Made) -> dict[str, Apart]:
    """By model how far apart two calibrations predict the poses that the accepted one measured.

    Without what cannot be compared so: a model or frame that one of both lacks, another number of
    joints, tables that cannot be read.
    """
    try:
        arm = _robot(before.folder)
        measured = store.read(before.folder / "measurements.parquet")
        every, _ = observed({"measurements": measured}, arm)
        old, new = (_fits(each.folder, every) for each in (before, now))
        return {kind: _apart(old[kind], new[kind], every) for kind in old.keys() & new.keys()}
    except (InputError, ValueError):
        return {}


def models_of(artefact: str) -> Sequence[str]:
    """The models that a table of parameters or frames is about."""
    kind = artefact.partition("_")[0]
    return [kind] if kind in FITTED else [*FITTED, NOMINAL]


def _robot(folder: Path) -> Robot:
    arm = recorded_robot(folder)
    if arm is None:
        raise InputError(Problem(str(folder), "does not say which robot it is about"))
    return arm


def _fits(folder: Path, every: Observations) -> Mapping[str, Fit]:
    arm = _robot(folder)
    names = ["frames", *(f"{kind}_{what}" for kind in FITTED for what in ("model", "frames"))]
    tables: dict[str, Columns] = {
        name: store.read(folder / f"{name}.parquet")
        for name in names
        if (folder / f"{name}.parquet").is_file()
    }
    return delivered_fits(tables, arm, every)


def _apart(one: Fit, other: Fit, every: Observations) -> Apart:
    poses = seen(one, every), seen(other, every)
    position = np.linalg.norm(poses[1].position_mm - poses[0].position_mm, axis=1)
    known = every.has_rotation
    turned = poses[1].rotation[known] @ np.swapaxes(poses[0].rotation[known], 1, 2)
    angle = np.linalg.norm(log_so3(turned), axis=1)
    return Apart(float(position.max()), 1e3 * float(angle.max(initial=0.0)))
