"""What a program makes the true arm do, on a controller that knows the arm as described."""

from __future__ import annotations

import numpy as np

from oracles.controllers import measured
from oracles.controllers.programs import Program
from oracles.kinematics import apart


def shown(program: Program, numbers: list[float]) -> list[np.ndarray]:
    """Joints on the pendant at every point: the arm as described reaches the written pose."""
    found = []
    for point in program.points:
        own = [numbers[place] for place in point.places]
        if point.of_joints:
            found.append(program.convention.joints(own))
            continue
        flange = program.base @ program.convention.pose(own) @ np.linalg.inv(program.tool)
        joints = program.arm.joints(flange, point.shown)
        assert np.abs(joints - point.shown).max() < 0.1, "the arm would stand in another posture"
        found.append(joints)
    return found


def misses(program: Program, numbers: list[float], base: np.ndarray) -> np.ndarray:
    """Distances (n, 2), mm and mrad, of the true arm's tool from where the program means it.

    ``numbers``: those of the program that runs. ``base``: the arm's base in the tracker's frame, as
    it is known.
    """
    meant = shown(program, [float(each) for each in program.numbers])
    rows = []
    for wanted, real in zip(meant, shown(program, numbers), strict=True):
        goal = base @ program.arm.pose(wanted) @ program.tool
        rows.append(apart(goal, measured.seen(program.arm, real)))
    return np.array(rows)
