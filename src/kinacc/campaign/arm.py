"""What a plan keeps of the arm: its nominal chain and the measured point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinacc.kinematics.dh import PARAMETERS, DHModel

if TYPE_CHECKING:
    from kinacc.deployment.record import Calibration


@dataclass(frozen=True)
class Arm:
    """Nominal ``dh``, ``joint_map`` (k, k), turn (3, 3) of its first frame in the robot's base, and
    the measured point (3,) in the last DH frame."""

    dh: DHModel
    joint_map: np.ndarray
    turn: np.ndarray
    point_mm: np.ndarray

    @classmethod
    def of(cls, calibration: Calibration, point: str | None) -> Arm:
        """The arm of a calibration."""
        robot = calibration.robot
        tool = calibration.point(point).position_mm
        return cls(robot.dh, robot.joint_map, robot.base.rotation, tool)

    def as_entry(self) -> dict:
        """The arm in plain numbers."""
        return {
            **{name: getattr(self.dh, name).tolist() for name in PARAMETERS},
            "prismatic": self.dh.prismatic.tolist(),
            "joint_map": self.joint_map.tolist(),
            "turn": self.turn.tolist(),
            "point_mm": self.point_mm.tolist(),
        }

    @classmethod
    def of_entry(cls, entry: Mapping) -> Arm:
        """The arm that ``as_entry`` wrote."""
        parameters = {name: numbers(entry[name]) for name in PARAMETERS}
        prismatic = np.array(entry["prismatic"], dtype=bool)
        names = ("joint_map", "turn", "point_mm")
        return cls(DHModel(**parameters, prismatic=prismatic), *(numbers(entry[n]) for n in names))


def numbers(value: object) -> np.ndarray:
    """Nested lists of numbers as an array; ValueError where they hold anything else."""
    found = np.array(value)
    if found.dtype.kind not in "iuf":
        raise ValueError("text or nothing in place of numbers")
    return found.astype(float)
