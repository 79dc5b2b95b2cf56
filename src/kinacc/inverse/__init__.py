"""Joint angles of wanted flange poses: closed form, refinement onto any model, limits and turns."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose
from kinacc.inverse import closed_form, limits, newton
from kinacc.inverse.closed_form import BRANCHES
from kinacc.models import dh as _dh
from kinacc.models import vec as _vec
from kinacc.models.dh import DHModel
from kinacc.models.vec import VECModel
from kinacc.robot import Robot

__all__ = ["BRANCHES", "Solutions", "Status", "closed_form_of", "solve"]

_SAME_POSTURE_RAD = 1e-6


class Status(IntEnum):
    """Why a branch has a solution, or none."""

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
    joints of an earlier one is a DUPLICATE. Branches keep the name they started from. Within about
    5 mm of axis 1 the shoulder of a calibrated arm is ill-defined and branches may be missed.
    """
    arm = closed_form_of(robot)
    names = BRANCHES if branches is None else tuple(branches)
    starts, reached = closed_form.solve(arm, pose, names, closed_form.Start())
    rows, columns = np.nonzero(reached)
    box = limits.dh_limits(robot)
    goal = Pose(pose.rotation[rows], pose.position_mm[rows])
    forward, jacobian = _functions(model, travel)
    first = limits.take_turns(starts[rows, columns], box, fitted_range_rad)
    refined = newton.refine(forward, jacobian, goal, first)
    found, converged = _settle_turns(forward, jacobian, goal, refined, box, fitted_range_rad)

    status = np.where(reached, Status.NOT_CONVERGED, Status.OUT_OF_REACH).astype(np.int8)
    status[rows[converged], columns[converged]] = Status.FOUND
    q_rad = np.full(starts.shape, np.nan)
    q_rad[rows[converged], columns[converged]] = found[converged]
    _mark_duplicates(q_rad, status)
    good = status == Status.FOUND
    if fitted_range_rad is not None:
        status[good & ~limits.within(q_rad, *fitted_range_rad)] = Status.OUTSIDE_RANGE
    status[good & ~limits.within_limits(robot, q_rad)] = Status.OUTSIDE_LIMITS
    return Solutions(q_rad, status, names)


def _functions(
    model: DHModel | VECModel, travel: np.ndarray | None
) -> tuple[Callable[[np.ndarray], Pose], Callable[[np.ndarray], np.ndarray]]:
    if isinstance(model, DHModel):
        return (lambda q: _dh.forward(model, q)), (lambda q: _dh.joint_jacobian(model, q))

    def directions(q_rad: np.ndarray) -> np.ndarray | None:
        return None if travel is None else np.broadcast_to(travel, q_rad.shape)

    return (
        lambda q: _vec.pose(model, q, directions(q)),
        lambda q: _vec.joint_jacobian(model, q, directions(q)),
    )


def _settle_turns(
    forward: Callable[[np.ndarray], Pose],
    jacobian: Callable[[np.ndarray], np.ndarray],
    goal: Pose,
    refined: newton.Refined,
    box: tuple[np.ndarray, np.ndarray],
    fitted_range_rad: tuple[np.ndarray, np.ndarray] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Joints and convergence with final turns: a step may cross one, and a model may not repeat."""
    q_rad, converged = refined.q_rad, refined.converged.copy()
    turned = limits.take_turns(q_rad, box, fitted_range_rad)
    changed = np.flatnonzero(converged & (np.abs(turned - q_rad) > 1.0).any(axis=1))
    if len(changed):
        part = Pose(goal.rotation[changed], goal.position_mm[changed])
        again = newton.refine(forward, jacobian, part, turned[changed])
        q_rad = q_rad.copy()
        q_rad[changed], converged[changed] = again.q_rad, again.converged
    return q_rad, converged


def _mark_duplicates(q_rad: np.ndarray, status: np.ndarray) -> None:
    for later in range(1, q_rad.shape[1]):
        for earlier in range(later):
            both = np.flatnonzero(
                (status[:, earlier] == Status.FOUND) & (status[:, later] == Status.FOUND)
            )
            apart = q_rad[both, later] - q_rad[both, earlier]
            apart -= 2.0 * np.pi * np.rint(apart / (2.0 * np.pi))
            same = both[np.abs(apart).max(axis=1, initial=0.0) < _SAME_POSTURE_RAD]
            status[same, later] = Status.DUPLICATE
            q_rad[same, later] = np.nan
