"""Joint angles of wanted flange poses: closed forms, a table of postures, any model, limits."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from kinacc.errors import input_error
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.inverse import closed_form, limits, newton, postures
from kinacc.kinematics.inverse.closed_form import BRANCHES
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.kinematics.robot import Robot

__all__ = [
    "BRANCHES",
    "Solutions",
    "Status",
    "branches_of",
    "grid_of",
    "machining_branches",
    "solve",
]

# An arm a little different from the nominal one may have postures the nominal one just misses.
_NEAR_MISS_MM = 30.0
_GRID_RAD = np.deg2rad(30.0)
_GRID_POINTS = 9  # of a first joint that slides
_AT_LIMIT_RAD = 1e-9
_WEAK_MM, _ASIDE_RAD = 60.0, (-0.25, -0.08, 0.08, 0.25)  # beside nearly singular postures
_PER_NAME = 8  # postures of one name: of sixteen in all five were the most seen


class Status(IntEnum):
    """Whether a branch has a solution, and whether it can be used.

    NOT_REACHED: the pose is out of reach in this branch, or another branch has the same joints.
    """

    FOUND = 0
    NOT_REACHED = 1
    OUTSIDE_LIMITS = 2
    OUTSIDE_RANGE = 3


class Solutions(NamedTuple):
    """Joints per pose and branch.

    Attributes
    ----------
    q_rad : numpy.ndarray
        DH joints, shape (n, b, k), rad (mm where a joint slides); NaN where the model has no such
        solution. Solutions outside limits or range are included.
    status : numpy.ndarray
        A ``Status`` each, shape (n, b).
    branches : tuple of str
        Names of the b branches.
    """

    q_rad: np.ndarray
    status: np.ndarray
    branches: tuple[str, ...]


def grid_of(robot: Robot) -> np.ndarray:
    """Values of DH joint 1 at which the freedom of a seven-axis arm is sampled.

    Parameters
    ----------
    robot : Robot
        Arm of seven joints.

    Returns
    -------
    numpy.ndarray
        Every 30 degrees within the limits and one turn, rad; nine places, mm, for a joint that
        slides.
    """
    low, high = (limit[0] for limit in limits.dh_limits(robot))
    if robot.dh.prismatic[0]:
        return np.linspace(low, high, _GRID_POINTS)
    steps = np.arange(-5, 7) * _GRID_RAD
    return steps[(steps >= low - _AT_LIMIT_RAD) & (steps <= high + _AT_LIMIT_RAD)]


def branches_of(robot: Robot) -> tuple[str, ...]:
    """Names of all branches ``solve`` gives for an arm, in its order.

    Parameters
    ----------
    robot : Robot
        The arm.

    Returns
    -------
    tuple of str
        The names.
    """
    if closed_form.recognise(robot.dh) is not None:
        return BRANCHES
    numbered = tuple(
        name if number == 0 else f"{name} ({number + 1})"
        for number in range(_PER_NAME)
        for name in postures.names_of(robot.dh)
    )
    if robot.dh.joints < 7:
        return numbered
    slides, grid = robot.dh.prismatic[0], grid_of(robot)
    heads = [f"{value:.6g}mm" if slides else f"{np.rad2deg(value):.6g}deg" for value in grid]
    return tuple(f"q1={head} {name}" for head in heads for name in numbered)


def machining_branches(robot: Robot) -> tuple[str, ...]:
    """Branches an arm works in: facing the work, elbow up, either wrist.

    Names count up along axis 1; in a table whose axis 1 points down an elbow up is a ``down``.

    Parameters
    ----------
    robot : Robot
        The arm.

    Returns
    -------
    tuple of str
        The names; all branches of arms whose branches are not named so.
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
) -> Solutions:
    """Joints at which a model puts the last DH frame at wanted poses, per branch.

    The nominal arm's closed form, or where it has none a search over all its postures, starts a
    Newton refinement onto ``model``. A solution counts when forward kinematics returns to the pose
    within ``newton.POSITION_TOLERANCE_MM`` and ``newton.ROTATION_TOLERANCE_RAD``. Of the turns of a
    joint ``limits.take_turns`` chooses one.

    With a closed form, a branch that converged to the joints of an earlier one is NOT_REACHED and
    branches keep the name they started from; on a calibrated arm one may be missed within 5 mm of
    axis 1 and where two singularities meet. The search looks for postures within the limits and
    slightly beyond, and names what it finds by ``postures.classes_of``.

    Parameters
    ----------
    robot : Robot
        Nominal arm of k joints.
    model : ErrorModel
        Model of that arm. The pose of a VEC model is its projected one.
    pose : Pose
        Poses (n, ...) of the last DH frame in the first one, mm.
    branches : tuple of str, optional
        Some of ``branches_of``; all when not given.
    travel : numpy.ndarray, optional
        Travel directions (-1, 0, +1) of the joints, shape (k,).
    fitted_range_rad : tuple of numpy.ndarray, optional
        Ends (k,), (k,) of the DH joints of the fit. Solutions within the limits but outside this
        range are OUTSIDE_RANGE.

    Returns
    -------
    Solutions
        Joints and their status.

    Raises
    ------
    InputError
        For a branch that the arm does not have.
    """
    known = branches_of(robot)
    names = known if branches is None else tuple(branches)
    for name in names:
        if name not in known:
            raise input_error(f"robot {robot.name}", f"has no branch {name}", ", ".join(known))
    columns = [known.index(name) for name in names]
    like = None if travel is None else JointState(np.zeros((1, model.joints)), travel[None])
    onto = _Onto(robot, model, like, fitted_range_rad)
    form = closed_form.recognise(robot.dh)
    if form is not None:
        q_rad = _by_closed_form(onto, form, pose, columns)
    else:
        heads = np.zeros((1, 0)) if robot.dh.joints < 7 else grid_of(robot)[:, None]
        q_rad = _searched(onto, pose, heads)[:, columns]
    good = np.isfinite(q_rad[..., 0])
    status = np.where(good, Status.FOUND, Status.NOT_REACHED).astype(np.int8)
    if fitted_range_rad is not None:
        status[good & ~limits.within(q_rad, *fitted_range_rad)] = Status.OUTSIDE_RANGE
    status[good & ~limits.within_limits(robot, q_rad)] = Status.OUTSIDE_LIMITS
    return Solutions(q_rad, status, names)


class _Onto(NamedTuple):
    """How starts are brought onto a model."""

    robot: Robot
    model: ErrorModel
    like: JointState | None
    preferred_rad: tuple[np.ndarray, np.ndarray] | None

    def converge(self, goal: Pose, start: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Joints (m, k) on their final turns and convergence (m,), from starts (m, k).

        Turns are taken before the refinement, as a model need not repeat after one, and once more
        after it, as a step may cross one. Joints before ``first`` stay.
        """
        start = limits.take_turns(self.robot, start, self.preferred_rad)
        q_rad, _, converged = newton.refine(self.model, goal, start, self.like, first)
        turned = limits.take_turns(self.robot, q_rad, self.preferred_rad)
        rows = np.flatnonzero(converged & (np.abs(turned - q_rad) > 1.0).any(axis=1))
        again = newton.refine(self.model, goal.select(rows), turned[rows], self.like, first)
        q_rad[rows], converged[rows] = again.q_rad, again.converged
        return q_rad, converged


def _by_closed_form(
    onto: _Onto, form: closed_form.SixAxes, pose: Pose, columns: list[int]
) -> np.ndarray:
    """Joints (n, b, 6), NaN where a branch has none or those of an earlier one."""
    starts, near = (part[:, columns] for part in form.solve(pose, closed_form.Start()))
    rows, places = np.nonzero(near)
    found, converged = onto.converge(pose.select(rows), starts[rows, places], 0)
    rows, places, found = rows[converged], places[converged], found[converged]
    new = ~postures.repeats(rows, found, onto.robot.dh.prismatic)
    q_rad = np.full(starts.shape, np.nan)
    q_rad[rows[new], places[new]] = found[new]
    return q_rad


def _searched(onto: _Onto, pose: Pose, heads: np.ndarray) -> np.ndarray:
    """Joints (n, g b, k) in their branches, NaN where empty.

    ``heads`` (g, f): values at which the first f joints, none or one, are held in turn.
    """
    dh, (values, fixed) = onto.robot.dh, heads.shape
    count = len(pose.position_mm)
    heads, pose = np.repeat(heads, count, axis=0), pose.select(np.tile(np.arange(count), values))
    # Coupled joints, which have no limits of their own, make a turn.
    low, high = np.nan_to_num(limits.dh_limits(onto.robot), neginf=-np.pi, posinf=np.pi)
    before = _dh.forward(dh.part(slice(fixed)), heads)
    tail = slice(fixed, None)
    table = postures.table_of(dh.part(tail), low[tail], high[tail])
    rows, start = postures.search(table, compose(invert(before), pose), _NEAR_MISS_MM)
    start = np.hstack([heads[rows], start])
    q_rad, converged = onto.converge(pose.select(rows), start, fixed)
    rows, q_rad = rows[converged], q_rad[converged]
    number, start = _beside(dh, q_rad, fixed)
    again, converged = onto.converge(pose.select(rows[number]), start, fixed)
    rows = np.concatenate([rows, rows[number[converged]]])
    q_rad = np.concatenate([q_rad, again[converged]])
    new = ~postures.repeats(rows, q_rad, dh.prismatic)
    placed = _placed(dh, values * count, rows[new], q_rad[new])
    placed = placed.reshape(values, count, *placed.shape[1:]).swapaxes(0, 1)
    return placed.reshape(count, values * placed.shape[2], dh.joints)


def _beside(dh: _dh.DHModel, q_rad: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Which of joints (m, k) are nearly singular, and starts beside them for a second posture.

    The nominal arm may have one posture, or none, where the model has two. Starts lie along the
    direction of joints, from ``first`` on, that moves the flange least.
    """
    unit = dh.travel_unit
    slopes = dh.joint_jacobian(JointState(q_rad)) * np.repeat([1.0, 1e3], 3)[:, None] * unit
    _, sizes, directions = np.linalg.svd(slopes[..., first:], full_matrices=False)
    weak = np.flatnonzero(sizes[:, -1] < _WEAK_MM)
    step = np.pad(directions[weak, -1], ((0, 0), (first, 0))) * unit
    starts = [q_rad[weak] + size * step for size in _ASIDE_RAD]
    return np.tile(weak, len(_ASIDE_RAD)), np.concatenate(starts)


def _placed(dh: _dh.DHModel, count: int, rows: np.ndarray, q_rad: np.ndarray) -> np.ndarray:
    """Joints (m, k) of poses ``rows`` (m,) put into their branches: (count, b, k), NaN if empty."""
    names = len(postures.names_of(dh))
    placed = np.full((count, _PER_NAME * names, dh.joints), np.nan)
    classes = postures.classes_of(dh, q_rad)
    order = np.lexsort([*q_rad.T[::-1], q_rad[:, 2], classes, rows])
    rows, classes, q_rad = rows[order], classes[order], q_rad[order]
    group = rows * names + classes
    number = np.arange(len(group)) - np.searchsorted(group, group, side="left")
    fits = number < _PER_NAME
    placed[rows[fits], number[fits] * names + classes[fits]] = q_rad[fits]
    return placed
