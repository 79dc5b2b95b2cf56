"""Inverse of any serial arm of four to seven axes: all postures by table and Newton.

Seven axes leave a freedom: joint 1 is put on every angle of a grid in turn and the six joints after
it are solved as an arm of their own, in closed form where shoulder and wrist are spherical.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse import limits, onto_model, posture, search, spherical_shoulder
from kinacc.kinematics.inverse.chain_rows import behind_first, part_of
from kinacc.kinematics.inverse.onto_model import Functions
from kinacc.kinematics.inverse.search import Postures
from kinacc.kinematics.robot import Robot

# An arm a little different from the nominal one may have postures the nominal one just misses.
_NEAR_MISS_MM = 30.0
_GRID_RAD = np.deg2rad(30.0)
_GRID_POINTS = 9  # of a first joint that slides
_BENDS_RAD = (0.02, 0.1)
_AT_LIMIT_RAD = 1e-9
# Postures of one name: of sixteen in all five were the most seen; two with spherical joints.
_PER_NAME, _PER_NAME_SPHERICAL = 8, 2


def grid_of(robot: Robot) -> np.ndarray:
    """Values of DH joint 1 at which the freedom of a seven-axis arm is sampled.

    Every 30 degrees within the limits and one turn; nine places for a joint that slides.
    """
    low, high = (limit[0] for limit in limits.dh_limits(robot))
    if robot.dh.prismatic[0]:
        return np.linspace(low, high, _GRID_POINTS)
    steps = np.arange(-5, 7) * _GRID_RAD
    return steps[(steps >= low - _AT_LIMIT_RAD) & (steps <= high + _AT_LIMIT_RAD)]


def names_of(robot: Robot, grid: np.ndarray) -> tuple[str, ...]:
    """Names of the branches of an arm, which stay the same whatever the pose."""
    numbered = tuple(
        name if number == 1 else f"{name} ({number})"
        for number in range(1, _per_name(robot.dh) + 1)
        for name in posture.names_of(robot.dh)
    )
    if robot.dh.joints < 7:
        return numbered
    slides = robot.dh.prismatic[0]
    heads = [f"{value:.6g}mm" if slides else f"{np.rad2deg(value):.6g}deg" for value in grid]
    return tuple(f"q1={head} {name}" for head in heads for name in numbered)


def solve(
    robot: Robot,
    functions: Functions,
    pose: Pose,
    grid: np.ndarray,
    preferred_rad: tuple[np.ndarray, np.ndarray] | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joints (n, b, k), whether found (n, b), and whether the nominal arm has the branch (n, b).

    Columns as ``names_of``. Joints are on the turns of ``limits.take_turns``.
    """
    if robot.dh.joints < 7:
        nominal = search.search(_table(robot, 0), pose, _NEAR_MISS_MM)
        return _onto(robot, functions, pose, nominal, preferred_rad, None)
    parts = []
    for value in grid:
        nominal = _at_first_joint(robot, pose, value)
        parts.append(_onto(robot, functions, pose, nominal, preferred_rad, value))
    return tuple(np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True))


def _at_first_joint(robot: Robot, pose: Pose, value: float) -> Postures:
    """Postures of the joints after the first, which stands at ``value``."""
    arm = spherical_shoulder.recognise(robot.dh)
    if arm is not None:
        q_rad, missed_mm = spherical_shoulder.solve(arm, pose, value)
        for bend in _BENDS_RAD:
            bent, short_mm = spherical_shoulder.solve(arm, pose, value, _NEAR_MISS_MM, bend)
            short_mm[onto_model.same_posture(bent, q_rad[:, :8])] = np.inf
            q_rad = np.concatenate([q_rad, bent], axis=1)
            missed_mm = np.concatenate([missed_mm, np.maximum(short_mm, 1.0)], axis=1)
        return Postures(q_rad, missed_mm)
    seen = compose(invert(behind_first(robot.dh, value)), pose)
    return search.search(_table(robot, 1), seen, _NEAR_MISS_MM)


def _onto(
    robot: Robot,
    functions: Functions,
    pose: Pose,
    nominal: Postures,
    preferred_rad: tuple[np.ndarray, np.ndarray] | None,
    first: float | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nominal postures brought onto a model and put into their branches."""
    skipped = 0 if first is None else 1
    box = tuple(limit[skipped:] for limit in limits.dh_limits(robot))
    preferred = None if preferred_rad is None else tuple(end[skipped:] for end in preferred_rad)
    if first is not None:
        functions = onto_model.with_first_joint(functions, first)
    turns = partial(
        limits.take_turns,
        limits_rad=box,
        preferred_rad=preferred,
        prismatic=robot.dh.prismatic[skipped:],
    )
    rows, slots = np.nonzero(np.isfinite(nominal.error_mm))
    start = nominal.q_rad[rows, slots]
    goal = Pose(pose.rotation[rows], pose.position_mm[rows])
    joints, converged = onto_model.converge(functions, goal, start, turns)
    if first is not None:
        start, joints = (np.insert(part, 0, first, axis=1) for part in (start, joints))
    q_rad = np.full((*nominal.error_mm.shape, robot.dh.joints), np.nan)
    q_rad[rows, slots] = joints
    found = np.zeros(nominal.error_mm.shape, dtype=bool)
    found[rows, slots] = converged
    found &= ~onto_model.mark_duplicates(q_rad, found, robot.dh.prismatic)
    kept, exact = found[rows, slots], nominal.error_mm[rows, slots] < 1e-6
    placed = _placed(robot.dh, len(found), rows[kept], joints[kept])
    expected = _placed(robot.dh, len(found), rows[exact], start[exact])
    return placed, np.isfinite(placed[..., 0]), np.isfinite(expected[..., 0])


def _placed(dh: DHModel, count: int, rows: np.ndarray, q_rad: np.ndarray) -> np.ndarray:
    """Joints (m, k) of poses ``rows`` (m,) put into their branches: (count, b, k), NaN if empty."""
    names, most = len(posture.names_of(dh)), _per_name(dh)
    placed = np.full((count, most * names, dh.joints), np.nan)
    if len(rows) == 0:
        return placed
    classes = posture.classes_of(dh, q_rad)
    order = np.lexsort([*q_rad.T[::-1], q_rad[:, 2], classes, rows])
    rows, classes, q_rad = rows[order], classes[order], q_rad[order]
    group = rows * names + classes
    number = np.arange(len(group)) - np.searchsorted(group, group, side="left")
    fits = number < most
    placed[rows[fits], number[fits] * names + classes[fits]] = q_rad[fits]
    return placed


def _per_name(dh: DHModel) -> int:
    return _PER_NAME if spherical_shoulder.recognise(dh) is None else _PER_NAME_SPHERICAL


def _table(robot: Robot, skipped: int) -> search.Table:
    """The table of the joints from ``skipped`` on; coupled ones, without limits, make a turn."""
    low, high = (limit[skipped:] for limit in limits.dh_limits(robot))
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    return search.table_of(part_of(robot.dh, slice(skipped, None)), low, high)
