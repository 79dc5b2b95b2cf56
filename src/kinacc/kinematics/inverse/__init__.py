"""Joint angles of wanted flange poses: closed forms, search, any model, limits and turns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import IntEnum
from functools import partial
from typing import NamedTuple

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose
from kinacc.kinematics.inverse import (
    closed_form,
    limits,
    numeric,
    onto_model,
    parallel_axes,
    rescue,
)
from kinacc.kinematics.inverse.closed_form import BRANCHES
from kinacc.kinematics.inverse.onto_model import Functions
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.robot import Robot

__all__ = [
    "BRANCHES",
    "Solutions",
    "Status",
    "branches_of",
    "closed_form_of",
    "machining_branches",
    "solve",
]

_NEAR_RAD = 0.2  # a refinement moves joints less than this, but for joints 4 and 6 when aligned


class Status(IntEnum):
    """Why a branch has a solution, or none.

    OUT_OF_REACH: neither the nominal arm nor the model has it. NOT_CONVERGED: the nominal arm has
    it, the refinement did not reach it on the model.
    """

    FOUND = 0
    OUT_OF_REACH = 1
    NOT_CONVERGED = 2
    DUPLICATE = 3
    OUTSIDE_LIMITS = 4
    OUTSIDE_RANGE = 5


class Solutions(NamedTuple):
    """Joints per pose and branch.

    ``q_rad`` (n, b, k): DH joints, NaN where the model has no such solution; solutions
    outside limits or range are kept and say so in ``status`` (n, b), a ``Status``.
    ``branches``: names of the b branches.
    """

    q_rad: np.ndarray
    status: np.ndarray
    branches: tuple[str, ...]


class ClosedForm(NamedTuple):
    """A nominal arm with a closed form: its constants, all branches, and second starts."""

    arm: closed_form.SphericalWristArm | parallel_axes.ParallelAxesArm
    solve: Callable[..., tuple[np.ndarray, np.ndarray]]
    starts: Callable[..., Iterator[tuple[np.ndarray, np.ndarray]]]


def closed_form_of(robot: Robot) -> ClosedForm | None:
    """Closed form of the nominal arm, or None where it has none here."""
    wrist = closed_form.recognise(robot.dh)
    if wrist is not None:
        return ClosedForm(wrist, closed_form.solve, rescue.starts)
    parallel = parallel_axes.recognise(robot.dh)
    if parallel is not None:
        return ClosedForm(parallel, parallel_axes.solve, parallel_axes.starts)
    return None


def branches_of(robot: Robot, grid_rad: np.ndarray | None = None) -> tuple[str, ...]:
    """Names of all branches ``solve`` gives for an arm, in its order.

    ``grid_rad``: values of joint 1 at which the freedom of a seven-axis arm is sampled.
    """
    if closed_form_of(robot) is not None:
        return BRANCHES
    return numeric.names_of(robot, numeric.grid_of(robot) if grid_rad is None else grid_rad)


def machining_branches(robot: Robot) -> tuple[str, ...]:
    """The branches an arm works in: facing the work, elbow up, either wrist.

    Names count up along axis 1; in a table whose axis 1 points down an elbow up is a ``down``. All
    branches of arms that are not named so.
    """
    names = branches_of(robot)
    elbow = "front-up" if robot.base.rotation[2, 2] >= 0.0 else "front-down"
    return tuple(name for name in names if name.startswith(elbow)) or names


def solve(
    robot: Robot,
    model: ErrorModel,
    pose: Pose,
    branches: tuple[str, ...] | None = None,
    travel: np.ndarray | None = None,
    fitted_range_rad: tuple[np.ndarray, np.ndarray] | None = None,
    grid_rad: np.ndarray | None = None,
) -> Solutions:
    """Joints at which ``model`` puts the last DH frame at ``pose`` (n, ...), per branch.

    The nominal arm's closed form, or where it has none a search over all its postures, starts a
    Newton refinement onto ``model`` (the pose of a VEC model is its projected one, at travel
    directions ``travel`` (k,)). A solution counts when forward kinematics returns to the pose
    within ``newton.POSITION_TOLERANCE_MM`` and ``newton.ROTATION_TOLERANCE_RAD``; otherwise it is
    dropped. Turns are those of ``limits.take_turns``. Solutions outside the joint limits are
    OUTSIDE_LIMITS, those within them but outside ``fitted_range_rad`` (k,), (k,) OUTSIDE_RANGE.
    ``branches`` are some of ``branches_of``, others raise InputError; None for all. ``grid_rad``
    are the values of DH joint 1 at which the freedom of a seven-axis arm is sampled
    (``numeric.grid_of`` when not given).

    With a closed form, a branch that converged to the joints of an earlier one is a DUPLICATE and
    branches keep the name they started from; on a calibrated arm one may be missed within 5 mm of
    axis 1 and where two singularities meet (9 of 20,000 random postures). The search looks for
    postures within the limits and slightly beyond, and names what it finds by ``posture``.
    """
    known = branches_of(robot, grid_rad)
    names = known if branches is None else tuple(branches)
    unknown = [name for name in names if name not in known]
    if unknown:
        problem = Problem(f"robot {robot.name}", f"has no branch {unknown[0]}", ", ".join(known))
        raise InputError(problem)
    like = None if travel is None else JointState(np.zeros((1, model.joints)), travel[None])
    functions = onto_model.functions_of(model, like)
    form = closed_form_of(robot)
    if form is not None:
        q_rad, status = _by_closed_form(robot, form, functions, pose, names, fitted_range_rad)
    else:
        grid = numeric.grid_of(robot) if grid_rad is None else grid_rad
        columns = [known.index(name) for name in names]
        q_rad, found, expected = (
            part[:, columns]
            for part in numeric.solve(robot, functions, pose, grid, fitted_range_rad)
        )
        status = np.full(found.shape, Status.OUT_OF_REACH, dtype=np.int8)
        status[expected] = Status.NOT_CONVERGED
        status[found] = Status.FOUND
    good = status == Status.FOUND
    if fitted_range_rad is not None:
        status[good & ~limits.within(q_rad, *fitted_range_rad)] = Status.OUTSIDE_RANGE
    status[good & ~limits.within_limits(robot, q_rad)] = Status.OUTSIDE_LIMITS
    return Solutions(q_rad, status, names)


def _by_closed_form(
    robot: Robot,
    form: ClosedForm,
    functions: Functions,
    pose: Pose,
    names: tuple[str, ...],
    preferred_rad: tuple[np.ndarray, np.ndarray] | None,
) -> tuple[np.ndarray, np.ndarray]:
    starts, reached = form.solve(form.arm, pose, names, closed_form.Start())
    rows, columns = np.nonzero(reached)
    box = limits.dh_limits(robot)
    goal = Pose(pose.rotation[rows], pose.position_mm[rows])
    turns = partial(limits.take_turns, limits_rad=box, preferred_rad=preferred_rad)
    found, converged = onto_model.converge(functions, goal, starts[rows, columns], turns)
    q_rad = np.full(starts.shape, np.nan)
    q_rad[rows[converged], columns[converged]] = found[converged]
    status = np.full(reached.shape, Status.OUT_OF_REACH, dtype=np.int8)
    status[rows[converged], columns[converged]] = Status.FOUND
    repeated = onto_model.mark_duplicates(q_rad, status == Status.FOUND)
    status[repeated], q_rad[repeated] = Status.DUPLICATE, np.nan
    missed = np.flatnonzero((reached & (status != Status.FOUND)).any(axis=1))
    if len(missed):
        part = Pose(pose.rotation[missed], pose.position_mm[missed])
        again = q_rad[missed], status[missed]
        _rescue(form, functions, part, names, turns, box, *again)
        q_rad[missed], status[missed] = again
    return q_rad, status


def _rescue(
    form: ClosedForm,
    functions: Functions,
    pose: Pose,
    names: tuple[str, ...],
    turns: Callable[[np.ndarray], np.ndarray],
    box: tuple[np.ndarray, np.ndarray],
    q_rad: np.ndarray,
    status: np.ndarray,
) -> None:
    """Fill the branches still missing at poses (m, ...) from second starts, in place."""
    lower, upper = box
    for number, (start, tried) in enumerate(form.starts(form.arm, pose, names)):
        if number == 0:
            status[tried & (status == Status.OUT_OF_REACH)] = Status.NOT_CONVERGED
        # Second starts are worth it only for joints somebody could use.
        usable = limits.within(turns(start), lower - _NEAR_RAD, upper + _NEAR_RAD)
        rows, columns = np.nonzero(tried & usable & (status != Status.FOUND))
        if len(rows) == 0:
            continue
        goal = Pose(pose.rotation[rows], pose.position_mm[rows])
        found, converged = onto_model.converge(functions, goal, start[rows, columns], turns)
        for row, column, joints in zip(
            rows[converged], columns[converged], found[converged], strict=True
        ):
            if not onto_model.same_posture(q_rad[row], joints).any():
                q_rad[row, column], status[row, column] = joints, Status.FOUND
