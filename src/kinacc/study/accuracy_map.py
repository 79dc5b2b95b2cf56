"""Largest error of a DH model over the evaluation space, against a VEC model (paper, IV-B).

The true arm is the VEC model. At every cell of the grid the flange takes all orientations and both
wrist configurations; joints come from the model a controller would use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinacc.geometry import IDENTITY, Pose, compose, invert
from kinacc.kinematics import dh as _dh
from kinacc.kinematics import inverse
from kinacc.kinematics import vec as _vec
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse import Status
from kinacc.kinematics.inverse.newton import pose_error
from kinacc.kinematics.region import Cells, Orientations, tool_poses
from kinacc.kinematics.robot import Robot
from kinacc.kinematics.vec import VECModel

_CELLS_PER_BLOCK = 256


class ModelPair(NamedTuple):
    """The true arm (``vec``), the model under assessment (``dh``), and what they carry.

    ``vec_tool`` and ``dh_tool`` are the tool centre point in the flange frame of each; ``travel``
    (k,) is the travel direction of every joint, or None for unknown. ``vec_base`` is the first
    frame of ``vec`` in that of ``dh`` where the two were fitted with bases of their own.
    """

    vec: VECModel
    dh: DHModel
    vec_tool: Pose = IDENTITY
    dh_tool: Pose = IDENTITY
    travel: np.ndarray | None = None
    vec_base: Pose | None = None


class AccuracyMap(NamedTuple):
    """One row per cell, all (n,); see ``accuracy_map``."""

    position_max_mm: np.ndarray
    orientation_max_mrad: np.ndarray
    worst_branch: np.ndarray
    orientation_worst_branch: np.ndarray
    solutions: np.ndarray
    wanted: np.ndarray
    extrapolating: np.ndarray


def errors_at(pair: ModelPair, q_rad: np.ndarray) -> np.ndarray:
    """VEC minus DH at joints (n, k), as (n, 6): tool position in mm, rotation vector in rad.

    Both in the DH base; the rotation vector turns the DH orientation into the (projected) VEC
    orientation.
    """
    travel = None if pair.travel is None else np.broadcast_to(pair.travel, q_rad.shape)
    true = compose(_vec.pose(pair.vec, q_rad, travel), pair.vec_tool)
    if pair.vec_base is not None:
        true = compose(pair.vec_base, true)
    modelled = compose(_dh.forward(pair.dh, q_rad), pair.dh_tool)
    return pose_error(true, modelled)


def joints_of(
    robot: Robot,
    pair: ModelPair,
    tool: Pose,
    branches: tuple[str, ...] | None = None,
    invert_with: str = "dh",
) -> inverse.Solutions:
    """Joints of tool poses (n, ...) per branch, from the ``dh``, ``vec`` or ``nominal`` model.

    Tool poses are in the arm's base frame; without ``branches`` they are taken in those of
    ``inverse.machining_branches``. The nominal model carries the tool of the DH model. A solution
    outside the joint range the VEC model was fitted over is Status.OUTSIDE_RANGE.
    """
    models = {"dh": pair.dh, "vec": pair.vec, "nominal": robot.dh}
    carried = pair.vec_tool if invert_with == "vec" else pair.dh_tool
    flange = compose(tool, invert(carried))
    if robot.base is not IDENTITY:
        flange = compose(invert(robot.base), flange)
    if invert_with == "vec" and pair.vec_base is not None:
        flange = compose(invert(pair.vec_base), flange)
    branches = inverse.machining_branches(robot) if branches is None else branches
    fitted = pair.vec.q_min_rad, pair.vec.q_max_rad
    return inverse.solve(robot, models[invert_with], flange, branches, pair.travel, fitted)


def accuracy_map(
    robot: Robot,
    pair: ModelPair,
    cells: Cells,
    reference: np.ndarray,
    orientations: Orientations,
    branches: tuple[str, ...] | None = None,
    invert_with: str = "dh",
) -> AccuracyMap:
    """Largest errors at cells (n,) over ``orientations`` and ``branches``.

    ``solutions`` counts the combinations reached within the joint limits and within the range the
    VEC model was fitted over, of ``wanted``; only those enter the maxima, since beyond its range a
    Chebyshev error says nothing. ``extrapolating`` counts the combinations left out for that
    reason alone. Cells without a solution have NaN maxima and None branches, which read
    ``X+ Y- Z0, front-up-flip``. Without ``branches`` those of ``inverse.machining_branches``.
    """
    branches = inverse.machining_branches(robot) if branches is None else branches
    count = len(cells.radius_mm)
    parts = [
        _block(
            robot,
            pair,
            Cells(*(axis[begin : begin + _CELLS_PER_BLOCK] for axis in cells)),
            reference,
            orientations,
            branches,
            invert_with,
        )
        for begin in range(0, count, _CELLS_PER_BLOCK)
    ]
    return AccuracyMap(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _block(
    robot: Robot,
    pair: ModelPair,
    cells: Cells,
    reference: np.ndarray,
    orientations: Orientations,
    branches: tuple[str, ...],
    invert_with: str,
) -> AccuracyMap:
    turns = len(orientations.names)
    count = len(cells.radius_mm)
    repeated = Cells(*(np.repeat(axis, turns) for axis in cells))
    tool = tool_poses(repeated, reference, np.tile(orientations.rotation, (count, 1, 1)))
    solved = joints_of(robot, pair, tool, branches, invert_with)
    found = solved.status == Status.FOUND
    position, orientation = np.full((2, *found.shape), -np.inf)
    error = errors_at(pair, solved.q_rad[found])
    position[found] = np.linalg.norm(error[:, :3], axis=1)
    orientation[found] = np.linalg.norm(error[:, 3:], axis=1) * 1e3
    shape = (count, turns * len(branches))
    solutions = found.reshape(shape).sum(axis=1)
    position_max, worst = _largest(position.reshape(shape), orientations, branches)
    orientation_max, orientation_worst = _largest(
        orientation.reshape(shape), orientations, branches
    )
    outside = (solved.status == Status.OUTSIDE_RANGE).reshape(shape).sum(axis=1)
    wanted = np.full(count, shape[1])
    return AccuracyMap(
        position_max, orientation_max, worst, orientation_worst, solutions, wanted, outside
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
