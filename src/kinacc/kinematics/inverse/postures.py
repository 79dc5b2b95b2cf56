"""All postures of a pose for any serial arm of four to seven axes: a table, looked up and refined.

What the first joint does to the last axis, and the last joint to the flange, is known in closed
form. So a pose is looked up by what is left: five numbers that say how the line of the last axis
lies to the line of the first. They depend on the joints between alone, two fewer than the arm has,
and a table even in these joints covers every posture densely. Entries that one Newton step on the
five numbers brings to the wanted ones are where Newton's method on the pose starts.

Postures have names. Six joints that turn are named as the closed forms name them
(``front-up-noflip``), whatever the arm: by the side of axis 1 on which joint 1 faces the last axis,
by axis 3 above or below the line from axis 2 to the fourth frame, and by the side on which joint 5
bends. Arms with other joints are named by the sides to which some of them turn from their DH zero
(``q2+ q5-``); seven axes by whether joint 3 turns less than a quarter (``fore``) or more (``aft``),
and by the sides of joints 4 and 6. A general arm may have several postures of one name; they are
numbered in the order of their third joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import qmc

from kinacc.geometry import Pose, compose, invert, rotation_x, rotation_y, rotation_z
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.inverse import newton
from kinacc.kinematics.inverse.closed_form import BRANCHES

# Entries per number of joints between the first and the last.
_ENTRIES = {2: 4_000, 3: 20_000, 4: 60_000, 5: 400_000}
_NEAREST, _MOST_STARTS = 192, 64
_FARTHEST = 2.5  # steps, in spacings of the table, that an entry is trusted for
_APART = 0.6  # spacings between two starts
_BEYOND_LIMITS_RAD = 0.1
_BLOCK = 32
_STEPS, _SAME_RAD = 30, 1e-4
_BY_SIGN = {4: (1,), 5: (1, 2), 6: (1, 2, 4), 7: (3, 5)}


@dataclass(frozen=True, eq=False)
class Table:
    """Joints between the first and the last of an arm, and the features they lead to.

    ``joints`` (N, m); ``features`` (N, f); ``slopes`` (N, f, m) per ``unit`` (m,), the spacing of
    the table; ``reach_mm`` scales lengths; ``tree`` finds the entries nearest to given features.
    """

    dh: DHModel
    joints: np.ndarray
    features: np.ndarray
    slopes: np.ndarray
    unit: np.ndarray
    reach_mm: float
    tree: cKDTree


def table_of(model: DHModel, lower_rad: np.ndarray, upper_rad: np.ndarray) -> Table:
    """The table of an arm within limits (k,), (k,) of its DH joints; built once per arm."""
    columns = (*(getattr(model, name) for name in PARAMETERS), lower_rad, upper_rad)
    return _table(tuple(tuple(map(float, column)) for column in columns), tuple(model.prismatic))


@lru_cache(maxsize=8)
def _table(columns: tuple[tuple[float, ...], ...], prismatic: tuple[bool, ...]) -> Table:
    theta, d, a, alpha, beta, lower, upper = map(np.array, columns)
    model = DHModel(theta, d, a, alpha, beta, np.array(prismatic))
    # The limits and a little beyond, as an arm slightly different may come in from there; for a
    # joint that turns, one turn is enough.
    margin = np.where(model.prismatic, 0.05 * (upper - lower), _BEYOND_LIMITS_RAD)
    low, span = lower - margin, upper - lower + 2.0 * margin
    whole = ~model.prismatic & ~(span < 2.0 * np.pi)
    low, span = np.where(whole, -np.pi, low)[1:-1], np.where(whole, 2.0 * np.pi, span)[1:-1]
    count = _ENTRIES[len(span)]
    unit = span * count ** (-1.0 / len(span))
    reach_mm = float(np.abs(model.a_mm).sum() + np.abs(model.d_mm).sum())
    reach_mm += float(span[model.prismatic[1:-1]].sum())
    joints = low + qmc.Halton(len(span), scramble=False).random(count) * span
    features = _features_inside(model, joints, reach_mm)
    slopes = np.empty((*features.shape, len(span)))
    for joint, step in enumerate(np.diag(1e-5 * unit)):
        change = _features_inside(model, joints + step, reach_mm)
        change -= _features_inside(model, joints - step, reach_mm)
        slopes[:, :, joint] = change / 2e-5
    return Table(model, joints, features, slopes, unit, reach_mm, cKDTree(features))


def search(table: Table, pose: Pose, near_miss_mm: float) -> tuple[np.ndarray, ...]:
    """Postures of poses (n, ...) of the arm of a table, and near misses up to that error.

    The pose (m,) of each, joints (m, k) in (-pi, pi], and the error (m,) left (mm, a radian counts
    as a metre).
    """
    wanted = _features(table.dh, _before_last(table.dh, pose), table.reach_mm)
    parts = [
        _starts(table, wanted[begin : begin + _BLOCK], begin)
        for begin in range(0, len(wanted), _BLOCK)
    ]
    rows, between = (np.concatenate(column) for column in zip(*parts, strict=True))
    goal = Pose(pose.rotation[rows], pose.position_mm[rows])
    start = _closed(table.dh, between, goal)
    found = newton.refine(table.dh, goal, start, most_steps=_STEPS)
    error = np.hypot(found.position_error_mm, 1e3 * found.rotation_error_rad)
    turn = 2.0 * np.pi * ~table.dh.prismatic
    q_rad = found.q_rad - turn * np.rint(found.q_rad / (2.0 * np.pi))
    order = np.lexsort([error, rows])
    order = order[(error <= max(near_miss_mm, 1e-6))[order]]
    rows, q_rad, error = rows[order], q_rad[order], error[order]
    kept = ~repeats(rows, q_rad, table.dh.prismatic, _SAME_RAD)
    return rows[kept], q_rad[kept], error[kept]


def repeats(
    rows: np.ndarray, q_rad: np.ndarray, prismatic: np.ndarray, tolerance_rad: float
) -> np.ndarray:
    """Which of joints (m, k) of poses ``rows`` (m,), in order, repeat an earlier one of theirs.

    Whole turns aside; a metre of travel counts as a radian.
    """
    repeated = np.zeros(len(rows), dtype=bool)
    for back in range(1, int(np.bincount(rows).max(initial=1))):
        later = np.flatnonzero(rows[back:] == rows[:-back]) + back
        gap = q_rad[later] - q_rad[later - back]
        gap = np.where(prismatic, 1e-3 * gap, gap - 2.0 * np.pi * np.rint(gap / (2.0 * np.pi)))
        repeated[later[np.abs(gap).max(axis=1, initial=0.0) < tolerance_rad]] = True
    return repeated


def _starts(table: Table, wanted: np.ndarray, begin: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses (m,), counted from ``begin``, and joints between (m, j) where to start for them."""
    near = table.tree.query(wanted, k=min(_NEAREST, len(table.joints)))[1]
    slopes, gap = table.slopes[near], wanted[:, None] - table.features[near]
    turned = np.swapaxes(slopes, 2, 3)
    damped = turned @ slopes + 1e-4 * np.eye(slopes.shape[3])
    step = np.linalg.solve(damped, turned @ gap[..., None])
    left = np.linalg.norm(gap - (slopes @ step)[..., 0], axis=2)
    step = step[..., 0]
    score = np.abs(step).max(axis=2) + 2.0 * left
    order = np.argsort(score, axis=1)
    score = np.take_along_axis(score, order, axis=1)
    moved = np.take_along_axis(table.joints[near] / table.unit + step, order[..., None], axis=1)
    # Starts beside a better one lead to the same posture.
    apart = np.abs(moved[:, :, None] - moved[:, None])
    turns = np.where(table.dh.prismatic[1:-1], np.inf, 2.0 * np.pi / table.unit)
    beside = np.minimum(apart, np.abs(turns - apart)).max(axis=3) < _APART
    taken = score <= _FARTHEST
    for number in range(score.shape[1]):
        taken[:, number + 1 :] &= ~(taken[:, number, None] & beside[:, number, number + 1 :])
    taken &= np.cumsum(taken, axis=1) <= _MOST_STARTS
    rows, places = np.nonzero(taken)
    return begin + rows, moved[rows, places] * table.unit


def _closed(dh: DHModel, between: np.ndarray, pose: Pose) -> np.ndarray:
    """Joints (m, k) of which the first and the last bring the arm closest to poses (m, ...)."""
    want = _before_last(dh, pose)
    q_rad = np.column_stack([np.zeros(len(between)), between, np.zeros(len(between))])
    # Frames behind the joints between and in front of the first, and the wanted one, as columns.
    ends = _dh.chain(dh, q_rad)
    end = Pose(ends.rotation[:, -2], ends.position_mm[:, -2])
    if dh.prismatic[-1]:
        end = Pose(end.rotation @ rotation_z(dh.theta_offset_rad[-1]), end.position_mm)
    if dh.prismatic[0]:
        q_rad[:, 0] = want.position_mm[:, 2] - end.position_mm[:, 2]
        end.position_mm[:, 2] += q_rad[:, 0]
    else:
        # Axis and origin where the last joint turns, axes where it slides: about z onto the wanted.
        if dh.prismatic[-1]:
            mine, other = end.rotation[:, :2], want.rotation[:, :2]
        else:
            mine = np.stack([1e3 * end.rotation[:, :2, 2], end.position_mm[:, :2]], axis=2)
            other = np.stack([1e3 * want.rotation[:, :2, 2], want.position_mm[:, :2]], axis=2)
        sine = np.sum(mine[:, 0] * other[:, 1] - mine[:, 1] * other[:, 0], axis=1)
        q_rad[:, 0] = np.arctan2(sine, np.sum(mine * other, axis=(1, 2)))
        turn = rotation_z(q_rad[:, 0])
        end = Pose(turn @ end.rotation, (turn @ end.position_mm[..., None])[..., 0])
    if dh.prismatic[-1]:
        gap = want.position_mm - end.position_mm
        q_rad[:, -1] = np.sum(end.rotation[..., 2] * gap, axis=1)
    else:
        axes = np.swapaxes(end.rotation, 1, 2) @ want.rotation
        sine, cosine = axes[:, 1, 0] - axes[:, 0, 1], axes[:, 0, 0] + axes[:, 1, 1]
        q_rad[:, -1] = np.arctan2(sine, cosine) - dh.theta_offset_rad[-1]
    return q_rad


def _features_inside(model: DHModel, joints: np.ndarray, reach_mm: float) -> np.ndarray:
    """Features (n, f) of the joints between (n, m): the first and the last do not matter."""
    last = model.joints - 1
    columns = (getattr(model, name)[:last] for name in (*PARAMETERS, "prismatic"))
    still = 0.0 if model.prismatic[0] else -model.theta_offset_rad[0]
    frame = _dh.forward(DHModel(*columns), np.column_stack([np.full(len(joints), still), joints]))
    if model.prismatic[last]:
        turn = rotation_z(model.theta_offset_rad[last])
        frame = Pose(frame.rotation @ turn, frame.position_mm)
    return _features(model, frame, reach_mm)


def _before_last(model: DHModel, pose: Pose) -> Pose:
    """Frames (n, ...) on the last axis, some way along and about it, of flange poses (n, ...)."""
    turn = rotation_x(model.alpha_rad[-1]) @ rotation_y(model.beta_rad[-1])
    shift = np.array([model.a_mm[-1], 0.0, model.d_mm[-1]])
    return compose(pose, invert(Pose(turn, shift)))


def _features(model: DHModel, frame: Pose, reach_mm: float) -> np.ndarray:
    """What neither the first nor the last joint changes in a frame on the last axis, (n, f)."""
    p, z = frame.position_mm / reach_mm, frame.rotation[..., 2]
    slides = model.prismatic[0], model.prismatic[-1]
    if slides == (True, False):
        return np.column_stack([z, p[:, :2]])
    if slides == (False, True):
        base = invert(Pose(frame.rotation, p))
        return np.column_stack([base.rotation[..., 2], base.position_mm[:, :2]])
    aside = p[:, 0] * z[:, 1] - p[:, 1] * z[:, 0]
    if slides == (True, True):
        return np.column_stack([frame.rotation[..., 0], z, aside])
    along = np.einsum("ni,ni->n", p, z)
    half_square = 0.5 * np.einsum("ni,ni->n", p, p)
    return np.column_stack([p[:, 2], along, aside, z[:, 2], half_square])


def names_of(dh: DHModel) -> tuple[str, ...]:
    """Names of the postures of an arm, before they are numbered."""
    if dh.joints == 6 and not dh.prismatic.any():
        return BRANCHES
    names = [
        " ".join(
            f"q{joint + 1}{sign}" for joint, sign in zip(_BY_SIGN[dh.joints], signs, strict=True)
        )
        for signs in product("+-", repeat=len(_BY_SIGN[dh.joints]))
    ]
    if dh.joints == 7:
        names = [f"{half} {name}" for half in ("fore", "aft") for name in names]
    return tuple(names)


def classes_of(dh: DHModel, q_rad: np.ndarray) -> np.ndarray:
    """Place (n,) of DH joints (n, k) in ``names_of``."""
    theta = q_rad + dh.theta_offset_rad
    if dh.joints == 6 and not dh.prismatic.any():
        return _sides(dh, q_rad, theta)
    place = np.zeros(len(q_rad), dtype=int)
    if dh.joints == 7:
        place += np.cos(theta[:, 2]) < 0.0
    for joint in _BY_SIGN[dh.joints]:
        value = q_rad[:, joint] if dh.prismatic[joint] else np.sin(theta[:, joint])
        place = 2 * place + (value < 0.0)
    return place


def _sides(dh: DHModel, q_rad: np.ndarray, theta: np.ndarray) -> np.ndarray:
    frames = _dh.chain(dh, q_rad).position_mm
    ahead = np.stack([np.cos(theta[:, 0]), np.sin(theta[:, 0])], axis=1)
    forward = np.einsum("ni,nji->nj", ahead, frames[..., :2])  # of every frame
    height = frames[..., 2]
    front = forward[:, 5] >= 0.0
    above = (forward[:, 4] - forward[:, 1]) * (height[:, 2] - height[:, 1])
    above -= (height[:, 4] - height[:, 1]) * (forward[:, 2] - forward[:, 1])
    up = (above > 0.0) == front
    bent = np.sin(theta[:, 4]) * (1.0 if np.cos(dh.theta_offset_rad[4]) >= 0.0 else -1.0)
    return 4 * ~front + 2 * ~up + (bent < 0.0)
