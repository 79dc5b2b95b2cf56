"""The operating points an assessor may visit: joint configurations and their true errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from kinacc.config.error_models import MEASURED, Comparison
from kinacc.errors import input_error
from kinacc.geometry import compose
from kinacc.kinematics import inverse, region
from kinacc.kinematics.inverse import Status, limits
from kinacc.kinematics.region import Cylinder
from kinacc.kinematics.robot import Robot
from kinacc.study.accuracy_map import ASSESSED, TRUE, Models, PosesWanted, joints_of
from kinacc.tables.columns import Columns

_DRAWS_PER_POINT = 500  # draws spent per wanted point before the space is called out of reach


def in_space(
    robot: Robot,
    models: Models,
    wanted: PosesWanted,
    sequence: str,
    count: int,
    wrist: str = "both",
) -> np.ndarray:
    """Joints (count, k) of tool poses drawn from a quasi-random sequence, in drawing order.

    Five coordinates per draw: radius, angle and height (even over the volume), orientation,
    branch. Draws without a solution within the limits and the fitted range are passed over.
    ``wrist`` keeps to the branches of one wrist configuration, ``noflip`` or ``flip``. Raises
    InputError where the space holds too few, and where the arm has no such wrist.
    """
    names = inverse.machining_branches(robot)
    chosen = [i for i, name in enumerate(names) if wrist in ("both", name.rpartition("-")[2])]
    if not chosen:
        message = f"{wrist}, but robot {robot.name} has no branch of that wrist"
        raise input_error("evaluation.wrist", message, "both")
    branches = np.array(chosen)

    def solve(unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        cells = region.fill(wanted.cylinder, unit[:, :3])
        turn = (unit[:, 3] * len(wanted.orientations.names)).astype(int)
        branch = branches[(unit[:, 4] * len(branches)).astype(int)]
        turned = wanted.orientations.rotation[turn]
        tool = region.tool_poses(cells, wanted.reference, turned, wanted.frame)
        solved = joints_of(robot, models, tool, wanted.invert_with)
        rows = np.arange(len(unit))
        return solved.q_rad[rows, branch], solved.status[rows, branch]

    return _drawn(sequence, count, 5, solve)


def _drawn(
    sequence: str,
    count: int,
    dimensions: int,
    solve: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    """The first ``count`` of the joints that ``solve`` finds, with their status, for draws."""
    found, block = np.empty((0, 0)), max(count, 256)
    for first in range(1, _DRAWS_PER_POINT * count + 1, block):
        q_rad, status = solve(region.points(sequence, block, dimensions, first))
        q_rad = q_rad[status == Status.FOUND]
        found = np.concatenate([found, q_rad]) if len(found) else q_rad
        if len(found) >= count:
            return found[:count]
    message = f"only {len(found)} of {_DRAWS_PER_POINT * count} draws can be assessed"
    fix = "move or enlarge the evaluation space, or fit the VEC model over a wider joint range"
    raise input_error("evaluation.cylinder", message, f"{count} points", fix)


def in_joints(
    robot: Robot, models: Models, sequence: str, count: int, cylinder: Cylinder
) -> np.ndarray:
    """DH joint angles (count, k) drawn evenly within the limits of the reported joints.

    Only configurations within the range of the reference are kept whose tool (assessed model) lies
    in the cylinder. Raises InputError where too few qualify.
    """
    limited, known_rad = (robot.q_min_rad, robot.q_max_rad), models[TRUE].range_rad
    lower, upper = limits.cut_to_range(robot, *limited, known_rad)

    def solve(unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q_rad = robot.dh_joints(lower + unit * (upper - lower))
        tool = models[ASSESSED].tool_poses(q_rad)
        good = limits.within(q_rad, *known_rad)
        good &= region.contains(cylinder, compose(robot.base, tool).position_mm)
        return q_rad, np.where(good, Status.FOUND, Status.OUTSIDE_RANGE)

    return _drawn(sequence, count, len(lower), solve)


def spread_rows(total: int, count: int) -> np.ndarray:
    """``count`` of ``total`` row numbers spread evenly, each once, coarse to fine (van der Corput).

    All of them where ``count`` is not smaller than ``total``.
    """
    count = min(count, total)
    draws = region.points("halton", 4 * max(total, 1), 1, 0)[:, 0]
    rows = list(dict.fromkeys((draws * total).astype(int).tolist()))
    return np.array(rows[:count], dtype=int)


def rows_of(errors: Columns, model: str) -> tuple[np.ndarray, np.ndarray]:
    """Which rows (n,) of pose_errors are of a model at measured poses, and which are held out."""
    of_model = np.asarray(errors["comparison"]) == Comparison(MEASURED, model).name
    return of_model, of_model & (np.asarray(errors["estimate"]) == "cross_validated")


def measured_errors(errors: Columns, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean errors (n, 3) of the configurations and targets in the ``wanted`` rows of pose_errors.

    Before them the row (n,) of each one's first reading in the measurements.
    """
    axes = ["ex_mm", "ey_mm", "ez_mm"]
    table = pd.DataFrame({name: errors[name] for name in ("pose", "target", "row", *axes)})[wanted]
    groups = table.groupby(["pose", "target"], sort=False, dropna=False)
    return groups["row"].first().to_numpy(int), groups[axes].mean().to_numpy()
