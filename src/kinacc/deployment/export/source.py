"""What every format of ``kinacc export`` is made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from kinacc.calibration.misfit import Misfit, misfit
from kinacc.deployment import folder as results
from kinacc.deployment.record import STATED, Calibration
from kinacc.kinematics.dh import PARAMETERS, DHModel

CONVENTION = "T = Rz(q + theta_offset) Tz(d) Tx(a) Rx(alpha) Ry(beta) per joint"


@dataclass(frozen=True)
class Source:
    """A calibrated model, the ``tables`` of its results and what was asked for.

    ``provenance``: version, settings and seed that the model was made with.
    ``urdf_file``: a URDF whose origins are to be corrected, from link ``links[0]`` to ``links[1]``;
    ``dh_joints``: a URDF in the joints of the DH table.
    """

    calibration: Calibration
    tables: results.Tables
    provenance: Mapping[str, str] = field(default_factory=dict)
    urdf_file: Path | str | None = None
    links: tuple[str | None, str | None] = (None, None)
    dh_joints: bool = False

    @property
    def name(self) -> str:
        """Name of the calibrated arm."""
        robot, name = self.calibration.robot.name, self.calibration.name
        return f"{name if name.startswith(robot) else f'{robot}_{name}'}_calibrated"

    @property
    def about(self) -> str:
        """Where the arm comes from."""
        return (
            f"calibrated from {self.calibration.robot.name} with data set {self.calibration.name}"
        )

    @property
    def dh(self) -> DHModel:
        """The DH table of the model."""
        if self.calibration.model.table is None:
            raise TypeError(f"a {self.calibration.choice} model has no DH table: choose dh")
        return self.calibration.model.table

    @cached_property
    def std(self) -> np.ndarray:
        """Standard deviations (k, 5), by joint, as ``dh.PARAMETERS``; NaN where there are none."""
        columns = self.tables.get(f"{self.calibration.choice}_model", {})
        if f"std_{PARAMETERS[0]}" not in columns:
            return np.full((self.calibration.model.joints, len(PARAMETERS)), np.nan)
        order = np.argsort(columns["joint"], kind="stable")
        std = [np.asarray(columns[f"std_{name}"], dtype=float)[order] for name in PARAMETERS]
        return np.stack(std, axis=1)

    @cached_property
    def misfit(self) -> Misfit:
        """What the standard deviations are worth."""
        return misfit(self.tables, self.calibration.robot, self.calibration.choice)

    @property
    def selected(self) -> str:
        """The model that was selected; empty where that is not recorded."""
        return results.recorded_model(self.tables)

    @property
    def orientation_lines(self) -> list[str]:
        """Targets whose orientation no reading has, for a comment; nothing where there are none."""
        arm = self.calibration
        names = [item for item in arm.targets if arm.orientation_source(item) == STATED]
        sentence = "Orientation as stated in the robot file, not measured"
        return [f"{sentence}: {', '.join(names)}."] if names else []

    @property
    def left_open_lines(self) -> list[str]:
        """What the poses leave open, under a heading; nothing where they do not."""
        reported = self.calibration.left_open
        return ["Left open by the poses:", *(f"  {text}" for text in reported)] if reported else []


def number(value: float) -> float | None:
    """A number of JSON; None where it is not known."""
    return float(value) if np.isfinite(value) else None


def kind(model: DHModel, joint: int) -> str:
    """How a joint moves."""
    return "prismatic" if model.prismatic[joint] else "revolute"
