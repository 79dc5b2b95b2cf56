"""Starting joints brought onto a model: which functions, which turns, when two are the same."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse import newton
from kinacc.kinematics.inverse.chain_rows import behind_first, rows_of, targets_of
from kinacc.kinematics.model import ErrorModel, JointState

SAME_POSTURE_RAD = 1e-6
_SAME_PLACE_MM = 1e-3
_CHEAP_STEPS, _MANY_STEPS = 12, 600
_CLOSE_MM, _CLOSE_RAD = 2.0, 2e-3
_COMPILED_MM = 3e-7  # what the compiled refinement leaves, a radian counting as a metre


class Functions(NamedTuple):
    """A forward model (m, k) -> Pose, its joint Jacobian (m, 6, k), and one that is nearly that.

    ``prismatic`` (k,) says which joints are in mm. ``dh`` is the model as a
    table of DH parameters where it is one, with joint 1 at ``first`` if that is given.
    """

    forward: Callable[[np.ndarray], Pose]
    jacobian: Callable[[np.ndarray], np.ndarray]
    cheap_jacobian: Callable[[np.ndarray], np.ndarray] | None
    prismatic: np.ndarray
    dh: DHModel | None = None
    first: float | None = None


def functions_of(model: ErrorModel, like: JointState | None = None) -> Functions:
    """The functions of a model that travels and is loaded as in one state, ``like``."""

    def at(q_rad: np.ndarray) -> JointState:
        return JointState(q_rad) if like is None else like.moved(q_rad)

    # Errors of a milliradian change the slopes by a thousandth: each step still gains three
    # digits, at a fifth of the cost.
    cheap = partial(_dh.joint_jacobian, model.dh) if model.table is None else None
    return Functions(
        lambda q: model.pose(at(q)),
        lambda q: model.joint_jacobian(at(q)),
        cheap,
        model.dh.prismatic,
        model.table,
    )


def _in_metres(functions: Functions) -> Functions:
    """The functions of joints whose travel is in metres, which steps as a radian does."""
    unit = np.where(functions.prismatic, 1e3, 1.0)

    def scaled(jacobian: Callable) -> Callable:
        return lambda q: jacobian(q * unit) * unit

    cheap = functions.cheap_jacobian
    return Functions(
        lambda q: functions.forward(q * unit),
        scaled(functions.jacobian),
        None if cheap is None else scaled(cheap),
        np.zeros_like(functions.prismatic),
    )


def _refine(functions: Functions, goal: Pose, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints (m, k) and convergence (m,): cheap slopes, then exact ones."""
    if functions.prismatic.any():
        unit = np.where(functions.prismatic, 1e3, 1.0)
        q_rad, converged = _refine(_in_metres(functions), goal, first / unit)
        return q_rad * unit, converged
    if functions.cheap_jacobian is None:
        return _patiently(functions, goal, first)
    refined = newton.refine(functions.forward, functions.cheap_jacobian, goal, first, _CHEAP_STEPS)
    q_rad, converged = refined.q_rad, refined.converged
    left = np.flatnonzero(~converged)
    if len(left):
        part = Pose(goal.rotation[left], goal.position_mm[left])
        q_rad[left], converged[left] = _patiently(functions, part, first[left])
    return q_rad, converged


def _patiently(
    functions: Functions, goal: Pose, first: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Joints (m, k) and convergence (m,): what is close but creeping gets many more steps.

    Beside a singular posture the error falls along a narrow curved valley, a little per step.
    """
    refined = newton.refine(functions.forward, functions.jacobian, goal, first)
    q_rad, converged = refined.q_rad, refined.converged
    close = (refined.position_error_mm < _CLOSE_MM) & (refined.rotation_error_rad < _CLOSE_RAD)
    left = np.flatnonzero(~converged & close)
    if len(left):
        part = Pose(goal.rotation[left], goal.position_mm[left])
        first, steps = q_rad[left], _MANY_STEPS
        if functions.dh is not None:
            first, steps = _compiled(functions, part, first), 5
        again = newton.refine(functions.forward, functions.jacobian, part, first, steps)
        q_rad[left], converged[left] = again.q_rad, again.converged
    return q_rad, converged


def _compiled(functions: Functions, goal: Pose, q_rad: np.ndarray) -> np.ndarray:
    """Joints (m, k) after many steps of the compiled refinement."""
    from kinacc.kinematics.inverse import kernels

    rows, q_rad = rows_of(functions.dh), np.ascontiguousarray(q_rad)
    if functions.first is not None:
        rows = rows[1:]
        goal = compose(invert(behind_first(functions.dh, functions.first)), goal)
    kernels.refine(rows, targets_of(goal), q_rad, _MANY_STEPS, _COMPILED_MM)
    return q_rad


def converge(
    functions: Functions,
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


def with_first_joint(functions: Functions, value: float) -> Functions:
    """The functions of the joints after the first, which stands at ``value``."""

    def whole(q_rad: np.ndarray) -> np.ndarray:
        return np.column_stack([np.full(len(q_rad), value), q_rad])

    def reduced(jacobian: Callable) -> Callable:
        return lambda q_rad: jacobian(whole(q_rad))[..., 1:]

    cheap = functions.cheap_jacobian
    return Functions(
        lambda q_rad: functions.forward(whole(q_rad)),
        reduced(functions.jacobian),
        None if cheap is None else reduced(cheap),
        functions.prismatic[1:],
        functions.dh,
        value,
    )


def same_posture(
    q_rad: np.ndarray, other: np.ndarray, prismatic: np.ndarray | None = None
) -> np.ndarray:
    """Whether joints (..., k) are equal but for whole turns; (...)."""
    apart = q_rad - other
    turns = 2.0 * np.pi * np.rint(apart / (2.0 * np.pi))
    if prismatic is None or not prismatic.any():
        return np.abs(apart - turns).max(axis=-1, initial=0.0) < SAME_POSTURE_RAD
    apart = np.where(prismatic, apart * (SAME_POSTURE_RAD / _SAME_PLACE_MM), apart - turns)
    return np.abs(apart).max(axis=-1, initial=0.0) < SAME_POSTURE_RAD


def mark_duplicates(
    q_rad: np.ndarray, found: np.ndarray, prismatic: np.ndarray | None = None
) -> np.ndarray:
    """Which of joints (n, b, k) that are ``found`` (n, b) repeat an earlier one, (n, b)."""
    repeated = np.zeros(found.shape, dtype=bool)
    for later in range(1, q_rad.shape[1]):
        for earlier in range(later):
            both = found[:, earlier] & found[:, later] & ~repeated[:, earlier]
            rows = np.flatnonzero(both & ~repeated[:, later])
            for joint in range(q_rad.shape[2]):  # most differ in the first
                one = slice(joint, joint + 1)
                slides = None if prismatic is None else prismatic[one]
                same = same_posture(q_rad[rows, later, one], q_rad[rows, earlier, one], slides)
                rows = rows[same]
            repeated[rows, later] = True
    return repeated
