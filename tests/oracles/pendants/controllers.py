"""Controllers into which values are typed: they send the true arm to poses in a BASE frame.

``values``: typed numbers by group and name. ``joints`` of an arm are those the pendant shows before
anything was typed; they drive the true arm. Conventions are those of the makers' manuals.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from oracles.controllers.arms import ARMS, DEG, Arm, errors
from oracles.controllers.programs import CONVENTIONS
from oracles.kinematics import rot_x, rot_y, rot_z, trans

STAUBLI = Arm(
    "tx2_90_like",
    ((0, 478, 50, -90), (-90, 50, 425, 0), (90, 0, 0, 90), (0, 425, 0, -90), (0, 0, 0, 90),
     (0, 100, 0, 0)),
    np.eye(6), (0.0,) * 6,
    (0, 10, 80, 10, 50, 20), (60, 30, 25, 50, 30, 80), ((-200, 200),) * 6, errors(6),
)  # fmt: skip
MAKERS = {**ARMS, "staubli": STAUBLI}


class _Shifted(Arm):
    """``errors`` (6, 6) are additions to theta, d, a, b, alpha, beta of its rows; rad and mm."""

    def pose(self, shown: np.ndarray, true: bool = False) -> np.ndarray:
        here = np.eye(4)
        table = np.insert(self.table, 3, 0.0, axis=1) + self.errors
        for (theta, d, a, b, alpha, beta), q in zip(table, np.transpose(shown), strict=True):
            here = here @ rot_z(q + theta) @ trans(a, b, d) @ rot_x(alpha) @ rot_y(beta)
        return here


def joints_for(
    maker: str, arm: Arm, typed: dict[str, dict[str, float]], file: Path, goal: np.ndarray, near
) -> np.ndarray:
    """Joints (n, 6) of the arm as first mastered when its controller is sent to goals in BASE."""
    to_frame = CONVENTIONS[maker].pose
    tool, base = (to_frame([*typed[group].values()]) for group in ("TOOL tool", "BASE"))
    flange = base @ goal @ np.linalg.inv(tool)
    if maker in ("ur", "staubli"):
        return shifted_arm(maker, arm, file).joints(flange, near)
    # Every axis was driven to minus the value and mastered there as 0.
    zeros = np.deg2rad([*typed["joint zeros"].values()])
    return arm.joints(flange, near + zeros) - zeros


def shifted_arm(maker: str, arm: Arm, file: Path) -> Arm:
    """The arm as the file for its controller describes it."""
    rows = _mounting(file) if maker == "ur" else _array(file)
    return _Shifted(**{**vars(arm), "errors": rows})


def _mounting(file: Path) -> np.ndarray:
    lines = file.with_suffix(".conf").read_text().splitlines()
    values = dict(line.split(" = ") for line in lines if " = " in line)
    rows = np.zeros((6, 6))
    for column, (name, unit) in {
        0: ("delta_theta", 1.0), 1: ("delta_d", 1e3), 2: ("delta_a", 1e3), 4: ("delta_alpha", 1.0),
    }.items():  # fmt: skip
        rows[:, column] = unit * np.array(json.loads(values.get(name, "[0, 0, 0, 0, 0, 0]")))
    return rows


def _array(file: Path) -> np.ndarray:
    names = {"theta": DEG, "d": 1, "a": 1, "b": 1, "alpha": DEG, "beta": DEG}
    every = ET.parse(file.with_suffix(".cfx")).getroot()
    return np.array([[unit * float(row.get(key)) for key, unit in names.items()] for row in every])
