"""What a program makes the true arm do, on a controller that knows the arm as described."""

from __future__ import annotations

import numpy as np

from oracles.controllers import measured
from oracles.controllers.programs import Program
from oracles.kinematics import apart


def shown(program: Program, numbers: list[float]) -> np.ndarray:
    """Joints on the pendant at every point: the arm as described reaches the written pose."""
    found = np.array([point.shown for point in program.points])
    poses, near = {}, found.copy()
    for row, point in enumerate(program.points):
        own = [numbers[place] for place in point.places]
        if point.of_joints:
            found[row] = program.convention.joints(own)
        else:
            poses[row] = program.convention.pose(own)
    flanges = program.base @ np.array([*poses.values()]) @ np.linalg.inv(program.tool)
    found[[*poses]] = program.arm.joints(flanges, near[[*poses]])
    assert np.abs(found - near)[[*poses]].max() < 0.1, "the arm would stand in another posture"
    return found


def misses(program: Program, numbers: list[float], base: np.ndarray) -> np.ndarray:
    """Distances (n, 2), mm and mrad, of the true arm's tool from where the program means it.

    ``numbers``: those of the program that runs. ``base``: the arm's base in the tracker's frame, as
    it is known.
    """
    meant = shown(program, [float(each) for each in program.numbers])
    goals = base @ program.arm.pose(meant) @ program.tool
    there = measured.seen(program.arm, shown(program, numbers))
    return np.array([*map(apart, goals, there)])
