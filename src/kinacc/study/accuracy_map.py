"""Largest error of a model over the evaluation space, against another one (paper, IV-B).

The true arm is the reference, a VEC model unless said otherwise. At every cell of the
grid the flange takes all orientations and both wrist configurations; joints come from the model a
controller would use.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinacc.geometry import IDENTITY, Pose, compose, invert
from kinacc.kinematics import inverse
from kinacc.kinematics.inverse import Status, limits
from kinacc.kinematics.inverse.newton import pose_error
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.region import SLICE, Cells, Cylinder, Orientations, tool_poses
from kinacc.kinematics.robot import Robot

_CELLS_PER_BLOCK = 256


class Equipped(NamedTuple):
    """A model with the tool centre point it carries in its last frame.

    ``base``: its first frame in that of the robot, None where they are the same. ``travel`` (k,) is
    the travel direction of every joint, or None for unknown.
    """

    model: ErrorModel
    tool: Pose = IDENTITY
    base: Pose | None = None
    travel: np.ndarray | None = None

    def tool_poses(self, q_rad: np.ndarray) -> Pose:
        """Tool poses (n, ...) at joints (n, k)."""
        travel = None if self.travel is None else np.broadcast_to(self.travel, q_rad.shape)
        end = compose(self.model.pose(JointState(q_rad, travel)), self.tool)
        return end if self.base is None else compose(self.base, end)

    @property
    def range_rad(self) -> tuple[np.ndarray, np.ndarray]:
        """DH joints (k,), (k,) that the model says something of."""
        model = self.model
        return model.domain or (np.full(model.joints, -np.inf), np.full(model.joints, np.inf))


Models = Mapping[str, Equipped]  # of one arm, by name
TRUE, ASSESSED = "vec", "dh"  # the model that stands for the true arm, and the one assessed


class PosesWanted(NamedTuple):
    """Which tool poses are assessed, and the model whose joints are taken for them.

    ``reference`` (3, 3) is the flange orientation before the ``orientations``, in ``frame``.
    """

    cylinder: Cylinder
    reference: np.ndarray
    orientations: Orientations
    invert_with: str
    frame: str = SLICE


def errors_at(models: Models, q_rad: np.ndarray) -> np.ndarray:
    """Reference minus assessed model at joints (n, k), as (n, 6): tool position in mm, turn in rad.

    Both in the base of the assessed model; the rotation vector turns its orientation into that of
    the reference.
    """
    true, modelled = (models[name].tool_poses(q_rad) for name in (TRUE, ASSESSED))
    return pose_error(true, modelled)


def joints_of(robot: Robot, models: Models, tool: Pose, invert_with: str) -> inverse.Solutions:
    """Joints of tool poses (n, ...) per branch, from the model named ``invert_with``.

    Tool poses are in the arm's base frame, branches those of ``inverse.machining_branches``. A
    solution outside the joint range of the reference is Status.OUTSIDE_RANGE.
    """
    chosen = models[invert_with]
    flange = compose(tool, invert(chosen.tool))
    if robot.base is not IDENTITY:
        flange = compose(invert(robot.base), flange)
    if chosen.base is not None:
        flange = compose(invert(chosen.base), flange)
    branches = inverse.machining_branches(robot)
    return inverse.solve(
        robot, chosen.model, flange, branches, chosen.travel, models[TRUE].range_rad
    )


def accuracy_map(robot: Robot, models: Models, cells: Cells, wanted: PosesWanted) -> pd.DataFrame:
    """Largest errors at cells (n,) over the orientations ``wanted`` and every branch.

    The columns of ``accuracy_map``, a row a cell. ``solutions`` counts the combinations reached
    within the joint limits and within the range of the reference, of ``wanted``; only those enter
    the maxima, since beyond its range it says nothing. ``extrapolating`` counts the combinations
    left out for that reason alone. ``q1`` .. are the reported joints of the largest position error.
    Cells without a solution have no maxima, joints and branches; a branch reads
    ``X+ Y- Z0, front-up-flip``.
    """
    blocks = range(0, len(cells.radius_mm), _CELLS_PER_BLOCK)
    parts = [
        _block(robot, models, Cells(*(axis[i : i + _CELLS_PER_BLOCK] for axis in cells)), wanted)
        for i in blocks
    ]
    return pd.concat(parts, ignore_index=True)


def _block(robot: Robot, models: Models, cells: Cells, wanted: PosesWanted) -> pd.DataFrame:
    orientations, branches = wanted.orientations, inverse.machining_branches(robot)
    count, turns = len(cells.radius_mm), len(orientations.names)
    repeated = Cells(*(np.repeat(axis, turns) for axis in cells))
    turned = np.tile(orientations.rotation, (count, 1, 1))
    tool = tool_poses(repeated, wanted.reference, turned, wanted.frame)
    solved = joints_of(robot, models, tool, wanted.invert_with)
    reached, tried = solved.status == Status.FOUND, turns * len(branches)
    error = errors_at(models, solved.q_rad[reached])
    size = np.full((2, *reached.shape), -np.inf)  # of position and orientation
    size[:, reached] = np.linalg.norm(error.reshape(-1, 2, 3), axis=2).T * [[1.0], [1e3]]
    size = size.reshape(2, count, tried)
    outside = (solved.status == Status.OUTSIDE_RANGE).reshape(count, tried)
    place, largest = size.argmax(axis=2), size.max(axis=2)
    names = [f"{turn}, {branch}" for turn in orientations.names for branch in branches]
    worst = np.array(names, dtype=object)[place]
    q_rad = solved.q_rad.reshape(count, tried, -1)[np.arange(count), place[0]]
    joints = limits.reported_joints(robot, q_rad)
    table = pd.DataFrame(joints, columns=[f"q{n}" for n in range(1, joints.shape[1] + 1)])
    table["position_max_mm"], table["orientation_max_mrad"] = largest
    table["worst_branch"], table["orientation_worst_branch"] = worst
    solutions = reached.reshape(count, tried).sum(axis=1)
    table.loc[solutions == 0, :] = np.nan
    return table.assign(solutions=solutions, wanted=tried, extrapolating=outside.sum(axis=1))
