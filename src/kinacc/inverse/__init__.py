"""Joint angles of wanted flange poses: closed form, refinement onto any model, limits and turns."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from functools import partial
from typing import NamedTuple

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose
from kinacc.inverse import closed_form, limits, newton, rescue
from kinacc.inverse.closed_form import BRANCHES
from kinacc.models import dh as _dh
from kinacc.models import vec as _vec
from kinacc.models.dh import DHModel
from kinacc.models.vec import VECModel
from kinacc.robot import Robot

__all__ = ["BRANCHES", "Solutions", "Status", "closed_form_of", "solve"]

_SAME_POSTURE_RAD = 1e-6
_CHEAP_STEPS = 12
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

    ``q_rad`` (n, b, 6): DH joint angles, NaN where the model has no such solution; solutions
    outside limits or range are kept and say so in ``status`` (n, b), a ``Status``.
    ``branches``: names of the b branches.
    """

    q_rad: np.ndarray
    status: np.ndarray
    branches: tuple[str, ...]


def closed_form_of(robot: Robot) -> closed_form.SphericalWristArm:
    """Closed form of the nominal arm; InputError, naming what is missing, where it has none."""
    arm = closed_form.recognise(robot.dh)
    if arm is None:
        problems = [
            Problem(f"robot {robot.name}", reason, "axes 2 and 3 parallel and a spherical wrist")
            for reason in closed_form.missing_properties(robot.dh)
        ]
        raise InputError(problems, f"{robot.name} has no closed-form inverse here")
    return arm


def solve(
    robot: Robot,
    model: DHModel | VECModel,
    pose: Pose,
    branches: tuple[str, ...] | None = None,
    travel: np.ndarray | None = None,
    fitted_range_rad: tuple[np.ndarray, np.ndarray] | None = None,
) -> Solutions:
    """Joints at which ``model`` puts the flange at ``pose`` (n, ...), per branch.

    The nominal closed form starts a Newton refinement onto ``model`` (the pose of a VEC model is
    its projected one, at travel directions ``travel`` (6,)). A solution counts when forward
    kinematics returns to the pose within ``newton.POSITION_TOLERANCE_MM`` and
    ``newton.ROTATION_TOLERANCE_RAD``; otherwise it is dropped. Turns are those of
    ``limits.take_turns``. Solutions outside the joint limits are OUTSIDE_LIMITS, those within them
    but outside ``fitted_range_rad`` (6,), (6,) OUTSIDE_RANGE. A branch that converged to the
    joints of an earlier one is a DUPLICATE. Branches keep the name they started from. On a
    calibrated arm a branch may be missed within 5 mm of axis 1 and where two singularities meet
    (9 of 20,000 random postures).
    """
    arm = closed_form_of(robot)
    names = BRANCHES if branches is None else tuple(branches)
    starts, reached = closed_form.solve(arm, pose, names, closed_form.Start())
    rows, columns = np.nonzero(reached)
    box = limits.dh_limits(robot)
    goal = Pose(pose.rotation[rows], pose.position_mm[rows])
    functions = _functions(model, travel)
    turns = partial(limits.take_turns, limits_rad=box, preferred_rad=fitted_range_rad)
    found, converged = _converge(functions, goal, starts[rows, columns], turns)
    q_rad = np.full(starts.shape, np.nan)
    q_rad[rows[converged], columns[converged]] = found[converged]
    status = np.full(reached.shape, Status.OUT_OF_REACH, dtype=np.int8)
    status[rows[converged], columns[converged]] = Status.FOUND
    _mark_duplicates(q_rad, status)
    missed = np.flatnonzero((reached & (status != Status.FOUND)).any(axis=1))
    if len(missed):
        part = Pose(pose.rotation[missed], pose.position_mm[missed])
        again = q_rad[missed], status[missed]
        _rescue(arm, functions, part, names, turns, box, *again)
        q_rad[missed], status[missed] = again
    good = status == Status.FOUND
    if fitted_range_rad is not None:
        status[good & ~limits.within(q_rad, *fitted_range_rad)] = Status.OUTSIDE_RANGE
    status[good & ~limits.within_limits(robot, q_rad)] = Status.OUTSIDE_LIMITS
    return Solutions(q_rad, status, names)


class _Functions(NamedTuple):
    """A forward model (m, k) -> Pose, its joint Jacobian (m, 6, k), and one that is nearly that."""

    forward: Callable[[np.ndarray], Pose]
    jacobian: Callable[[np.ndarray], np.ndarray]
    cheap_jacobian: Callable[[np.ndarray], np.ndarray] | None


def _functions(model: DHModel | VECModel, travel: np.ndarray | None) -> _Functions:
    if isinstance(model, DHModel):
        return _Functions(partial(_dh.forward, model), partial(_dh.joint_jacobian, model), None)

    def directions(q_rad: np.ndarray) -> np.ndarray | None:
        return None if travel is None else np.broadcast_to(travel, q_rad.shape)

    return _Functions(
        lambda q: _vec.pose(model, q, directions(q)),
        lambda q: _vec.joint_jacobian(model, q, directions(q)),
        # Error terms of a milliradian change the slopes by a thousandth: each step still gains
        # three digits, at a fifth of the cost.
        partial(_dh.joint_jacobian, model.dh),
    )


def _refine(functions: _Functions, goal: Pose, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints (m, k) and convergence (m,): cheap slopes first, exact ones for what they leave."""
    if functions.cheap_jacobian is None:
        refined = newton.refine(functions.forward, functions.jacobian, goal, first)
        return refined.q_rad, refined.converged
    refined = newton.refine(functions.forward, functions.cheap_jacobian, goal, first, _CHEAP_STEPS)
    q_rad, converged = refined.q_rad, refined.converged
    left = np.flatnonzero(~converged)
    if len(left):
        part = Pose(goal.rotation[left], goal.position_mm[left])
        again = newton.refine(functions.forward, functions.jacobian, part, first[left])
        q_rad[left], converged[left] = again.q_rad, again.converged
    return q_rad, converged


def _converge(
    functions: _Functions,
    goal: Pose,
    start: np.ndarray,
    turns: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Joints (m, k) on their final turns and convergence (m,), from starts (m, k).

    Turns are taken before the refinement, as a model need not repeat after one, and once more
    after it, as a step may cross one.
    """
    q_rad, converged = _refine(functions, goal, turns(start))
    turned = turns(q_rad)
    changed = np.flatnonzero(converged & (np.abs(turned - q_rad) > 1.0).any(axis=1))
    if len(changed):
        part = Pose(goal.rotation[changed], goal.position_mm[changed])
        q_rad[changed], converged[changed] = _refine(functions, part, turned[changed])
    return q_rad, converged


def _rescue(
    arm: closed_form.SphericalWristArm,
    functions: _Functions,
    pose: Pose,
    names: tuple[str, ...],
    turns: Callable[[np.ndarray], np.ndarray],
    box: tuple[np.ndarray, np.ndarray],
    q_rad: np.ndarray,
    status: np.ndarray,
) -> None:
    """Fill the branches still missing at poses (m, ...) from second starts, in place."""
    lower, upper = box
    for number, (start, tried) in enumerate(rescue.starts(arm, pose, names)):
        if number == 0:
            status[tried & (status == Status.OUT_OF_REACH)] = Status.NOT_CONVERGED
        # Second starts are worth it only for joints somebody could use.
        usable = limits.within(turns(start), lower - _NEAR_RAD, upper + _NEAR_RAD)
        rows, columns = np.nonzero(tried & usable & (status != Status.FOUND))
        if len(rows) == 0:
            continue
        goal = Pose(pose.rotation[rows], pose.position_mm[rows])
        found, converged = _converge(functions, goal, start[rows, columns], turns)
        for row, column, joints in zip(
            rows[converged], columns[converged], found[converged], strict=True
        ):
            if not _same_posture(q_rad[row], joints).any():
                q_rad[row, column], status[row, column] = joints, Status.FOUND


def _same_posture(q_rad: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Whether joints (..., k) are equal but for whole turns; (...)."""
    apart = q_rad - other
    apart -= 2.0 * np.pi * np.rint(apart / (2.0 * np.pi))
    return np.abs(apart).max(axis=-1, initial=0.0) < _SAME_POSTURE_RAD


def _mark_duplicates(q_rad: np.ndarray, status: np.ndarray) -> None:
    for later in range(1, q_rad.shape[1]):
        for earlier in range(later):
            both = np.flatnonzero(
                (status[:, earlier] == Status.FOUND) & (status[:, later] == Status.FOUND)
            )
            same = both[_same_posture(q_rad[both, later], q_rad[both, earlier])]
            status[same, later] = Status.DUPLICATE
            q_rad[same, later] = np.nan
