"""Largest error of a model over the evaluation space, against another one (paper, IV-B).

The true arm is the reference, a VEC model unless said otherwise. At every cell of the
grid the flange takes all orientations and both wrist configurations; joints come from the model a
controller would use.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from kinacc.geometry import IDENTITY, Pose, compose, invert
from kinacc.kinematics import inverse
from kinacc.kinematics.inverse import Status
from kinacc.kinematics.inverse.newton import pose_error
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.region import SLICE, Cells, Cylinder, Orientations, tool_poses
from kinacc.kinematics.robot import Robot

_CELLS_PER_BLOCK = 256


class Equipped(NamedTuple):
    """A model with the tool centre point it carries in its last frame.

    ``base``: its first frame in that of the robot, None where they are the same.
    """

    model: ErrorModel
    tool: Pose = IDENTITY
    base: Pose | None = None

    def tool_poses(self, q_rad: np.ndarray, travel: np.ndarray | None) -> Pose:
        """Tool poses (n, ...) at joints (n, k), which travel in the directions (k,)."""
        state = JointState(q_rad, None if travel is None else np.broadcast_to(travel, q_rad.shape))
        end = compose(self.model.pose(state), self.tool)
        return end if self.base is None else compose(self.base, end)


class Models(NamedTuple):
    """Models of one arm: of which one stands for the true arm, and which one is assessed.

    ``travel`` (k,) is the travel direction of every joint, or None for unknown.
    """

    by_name: Mapping[str, Equipped]
    travel: np.ndarray | None = None
    reference: str = "vec"
    assessed: str = "dh"

    @property
    def range_rad(self) -> tuple[np.ndarray, np.ndarray]:
        """DH joints (k,), (k,) that the reference says something of."""
        true = self.by_name[self.reference].model
        return true.domain or (np.full(true.joints, -np.inf), np.full(true.joints, np.inf))


class PosesWanted(NamedTuple):
    """Which tool poses are assessed, and the model whose joints are taken for them.

    ``reference`` (3, 3) is the flange orientation before the ``orientations``, in ``frame``.
    """

    cylinder: Cylinder
    reference: np.ndarray
    orientations: Orientations
    invert_with: str
    frame: str = SLICE


class AccuracyMap(NamedTuple):
    """One row per cell, (n,) but for ``worst_q_rad`` (n, k); see ``accuracy_map``."""

    position_max_mm: np.ndarray
    orientation_max_mrad: np.ndarray
    worst_branch: np.ndarray
    orientation_worst_branch: np.ndarray
    solutions: np.ndarray
    wanted: np.ndarray
    extrapolating: np.ndarray
    worst_q_rad: np.ndarray


def errors_at(models: Models, q_rad: np.ndarray) -> np.ndarray:
    """Reference minus assessed model at joints (n, k), as (n, 6): tool position in mm, turn in rad.

    Both in the base of the assessed model; the rotation vector turns its orientation into that of
    the reference.
    """
    names = models.reference, models.assessed
    true, modelled = (models.by_name[name].tool_poses(q_rad, models.travel) for name in names)
    return pose_error(true, modelled)


def joints_of(robot: Robot, models: Models, tool: Pose, invert_with: str) -> inverse.Solutions:
    """Joints of tool poses (n, ...) per branch, from the model named ``invert_with``.

    Tool poses are in the arm's base frame, branches those of ``inverse.machining_branches``. A
    solution outside the joint range of the reference is Status.OUTSIDE_RANGE.
    """
    chosen = models.by_name[invert_with]
    flange = compose(tool, invert(chosen.tool))
    if robot.base is not IDENTITY:
        flange = compose(invert(robot.base), flange)
    if chosen.base is not None:
        flange = compose(invert(chosen.base), flange)
    branches = inverse.machining_branches(robot)
    return inverse.solve(robot, chosen.model, flange, branches, models.travel, models.range_rad)


def accuracy_map(robot: Robot, models: Models, cells: Cells, wanted: PosesWanted) -> AccuracyMap:
    """Largest errors at cells (n,) over the orientations ``wanted`` and every branch.

    ``solutions`` counts the combinations reached within the joint limits and within the range of
    the reference, of ``wanted``; only those enter the maxima, since beyond its range it says
    nothing. ``extrapolating`` counts the combinations left out for that reason alone.
    ``worst_q_rad`` are the DH joints of the largest position error. Cells without a solution have
    NaN maxima and joints, and None branches, which read ``X+ Y- Z0, front-up-flip``.
    """
    count = len(cells.radius_mm)
    parts = [
        _block(
            robot,
            models,
            Cells(*(axis[begin : begin + _CELLS_PER_BLOCK] for axis in cells)),
            wanted,
        )
        for begin in range(0, count, _CELLS_PER_BLOCK)
    ]
    return AccuracyMap(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _block(robot: Robot, models: Models, cells: Cells, wanted: PosesWanted) -> AccuracyMap:
    orientations, branches = wanted.orientations, inverse.machining_branches(robot)
    turns = len(orientations.names)
    count = len(cells.radius_mm)
    repeated = Cells(*(np.repeat(axis, turns) for axis in cells))
    turned = np.tile(orientations.rotation, (count, 1, 1))
    tool = tool_poses(repeated, wanted.reference, turned, wanted.frame)
    solved = joints_of(robot, models, tool, wanted.invert_with)
    reached = solved.status == Status.FOUND
    position, orientation = np.full((2, *reached.shape), -np.inf)
    error = errors_at(models, solved.q_rad[reached])
    position[reached] = np.linalg.norm(error[:, :3], axis=1)
    orientation[reached] = np.linalg.norm(error[:, 3:], axis=1) * 1e3
    shape = (count, turns * len(branches))
    solutions = reached.reshape(shape).sum(axis=1)
    position, orientation = position.reshape(shape), orientation.reshape(shape)
    position_max, worst = _largest(position, orientations, branches)
    orientation_max, orientation_worst = _largest(orientation, orientations, branches)
    outside = (solved.status == Status.OUTSIDE_RANGE).reshape(shape).sum(axis=1)
    tried = np.full(count, shape[1])
    q_rad = solved.q_rad.reshape(*shape, -1)[np.arange(count), position.argmax(axis=1)]
    q_rad[solutions == 0] = np.nan
    return AccuracyMap(
        position_max, orientation_max, worst, orientation_worst, solutions, tried, outside, q_rad
    )


def _largest(
    values: np.ndarray, orientations: Orientations, branches: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Largest value per row, NaN where there is none, and the name of its combination."""
    names = np.array(
        [f"{turn}, {branch}" for turn in orientations.names for branch in branches] + [None],
        dtype=object,
    )
    place = values.argmax(axis=1)
    largest = np.take_along_axis(values, place[:, None], axis=1)[:, 0]
    empty = np.isneginf(largest)
    return np.where(empty, np.nan, largest), names[np.where(empty, len(names) - 1, place)]
