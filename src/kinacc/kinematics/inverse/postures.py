"""All postures of a pose for any serial arm of four to seven axes: a table, looked up and refined.

What the first joint does to the last axis, and the last joint to the flange, is known in closed
form where both turn. So a pose is looked up by what is left: five numbers that say how the line of
the last axis lies to the line of the first. They depend on the joints between alone, two fewer than
the arm has, and a table even in these joints covers every posture densely. Where the first or the
last joint slides, the table is one of whole poses. Entries that one Newton step brings to the
wanted numbers are where Newton's method on the pose starts.

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

from kinacc.geometry import Pose, rotation_z
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.inverse import newton
from kinacc.kinematics.inverse.closed_form import BRANCHES, before_last

_ENTRIES, _MOST_ENTRIES = {2: 4_000, 3: 20_000, 4: 60_000}, 400_000  # by number of joints
_NEAREST, _MOST_STARTS = 192, 64
_FARTHEST = 2.5  # steps, in spacings of the table, that an entry is trusted for
_APART = 0.6  # spacings between two starts
_BEYOND_LIMITS_RAD = 0.1
_BLOCK = 32
_STEPS, _SAME_RAD, _SAME_START_RAD = 30, 1e-6, 1e-4
_BY_SIGN = {4: (1,), 5: (1, 2), 6: (1, 2, 4), 7: (3, 5)}


@dataclass(frozen=True, eq=False)
class Table:
    """Joints ``inner`` of an arm, m of its k, and the features they lead to.

    ``joints`` (N, m); ``slopes`` (N, f, m) of the features per ``unit`` (m,), the spacing of the
    table; ``reach_mm`` scales lengths; ``tree`` holds the features (N, f).
    """

    dh: DHModel
    inner: slice
    joints: np.ndarray
    slopes: np.ndarray
    unit: np.ndarray
    reach_mm: float
    tree: cKDTree


def table_of(model: DHModel, lower_rad: np.ndarray, upper_rad: np.ndarray) -> Table:
    """The table of an arm within limits (k,), (k,) of its DH joints; built once per arm."""
    columns = *(getattr(model, name) for name in PARAMETERS), model.prismatic, lower_rad, upper_rad
    return _table(np.stack(columns).astype(float).tobytes())


@lru_cache(maxsize=8)
def _table(columns: bytes) -> Table:
    *parameters, lower, upper = np.frombuffer(columns).reshape(8, -1)
    model = DHModel(*parameters)
    ends_turn = not model.prismatic[[0, -1]].any()
    inner = slice(1, model.joints - 1) if ends_turn else slice(0, model.joints)
    slides = model.prismatic[inner]
    # The limits and a little beyond, as an arm slightly different may come in from there; for a
    # joint that turns, one turn is enough.
    low, span = lower[inner], (upper - lower)[inner]
    margin = np.where(slides, 0.05 * span, _BEYOND_LIMITS_RAD)
    low, span = low - margin, span + 2.0 * margin
    whole = ~slides & (span >= 2.0 * np.pi)
    low, span = np.where(whole, -np.pi, low), np.where(whole, 2.0 * np.pi, span)
    count = _ENTRIES.get(len(span), _MOST_ENTRIES)
    unit = span * count ** (-1.0 / len(span))
    reach_mm = float(np.abs([model.a_mm, model.d_mm]).sum() + span[slides].sum())
    joints = low + qmc.Halton(len(span), scramble=False).random(count) * span

    def features(at: np.ndarray) -> np.ndarray:
        # The first and the last joint do not matter where they turn.
        if not ends_turn:
            return _features(model, _dh.forward(model, at), reach_mm)
        q_rad = np.insert(at, 0, 0.0, axis=1)
        return _features(model, _dh.forward(model.part(slice(-1)), q_rad), reach_mm)

    steps = np.diag(1e-5 * unit)
    slopes = np.stack([(features(joints + h) - features(joints - h)) / 2e-5 for h in steps], axis=2)
    return Table(model, inner, joints, slopes, unit, reach_mm, cKDTree(features(joints)))


def search(table: Table, pose: Pose, near_miss_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Postures of poses of the arm of a table, and near misses.

    Parameters
    ----------
    table : Table
        Table of an arm of k joints.
    pose : Pose
        Poses (n, ...) of the last DH frame in the first one.
    near_miss_mm : float
        Largest error of a near miss in mm, where a radian counts as a metre.

    Returns
    -------
    tuple of numpy.ndarray
        Of m postures: the pose (m,) and joints (m, k) in (-pi, pi].
    """
    goal = pose if table.inner.start == 0 else before_last(table.dh, pose)
    wanted = _features(table.dh, goal, table.reach_mm)
    parts = [
        _starts(table, wanted[begin : begin + _BLOCK], begin)
        for begin in range(0, max(len(wanted), 1), _BLOCK)  # one block of none
    ]
    rows, start = (np.concatenate(column) for column in zip(*parts, strict=True))
    if table.inner.start == 1:
        start = _closed(table.dh, start, goal.select(rows))
    found = newton.refine(table.dh, pose.select(rows), start, most_steps=_STEPS)
    turn = 2.0 * np.pi * ~table.dh.prismatic
    q_rad = found.q_rad - turn * np.rint(found.q_rad / (2.0 * np.pi))
    order = np.lexsort([found.error_mm, rows])
    order = order[(found.error_mm <= max(near_miss_mm, 1e-6))[order]]
    order = order[~repeats(rows[order], q_rad[order], table.dh.prismatic, _SAME_START_RAD)]
    return rows[order], q_rad[order]


def repeats(
    rows: np.ndarray, q_rad: np.ndarray, prismatic: np.ndarray, tolerance_rad: float = _SAME_RAD
) -> np.ndarray:
    """Which of joints (m, k) of poses ``rows`` (m,), in any order, repeat an earlier one of theirs.

    Whole turns aside; a metre of travel counts as a radian.
    """
    order = np.argsort(rows, kind="stable")
    rows, q_rad = rows[order], q_rad[order]
    repeated = np.zeros(len(rows), dtype=bool)
    for back in range(1, int(np.bincount(rows).max(initial=1))):
        later = np.flatnonzero(rows[back:] == rows[:-back]) + back
        gap = q_rad[later] - q_rad[later - back]
        gap = np.where(prismatic, 1e-3 * gap, gap - 2.0 * np.pi * np.rint(gap / (2.0 * np.pi)))
        repeated[order[later[np.abs(gap).max(axis=1, initial=0.0) < tolerance_rad]]] = True
    return repeated


def _starts(table: Table, wanted: np.ndarray, begin: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses (m,), counted from ``begin``, and inner joints (m, j) where to start for them."""
    near = table.tree.query(wanted, k=min(_NEAREST, len(table.joints)))[1]
    slopes, gap = table.slopes[near], wanted[:, None] - table.tree.data[near]
    turned = np.swapaxes(slopes, 2, 3)
    damped = turned @ slopes + 1e-4 * np.eye(slopes.shape[3])
    step = np.linalg.solve(damped, turned @ gap[..., None])
    rest = np.linalg.norm(gap - (slopes @ step)[..., 0], axis=2)
    score = np.abs(step[..., 0]).max(axis=2) + 2.0 * rest
    order = np.argsort(score, axis=1)
    score = np.take_along_axis(score, order, axis=1)
    moved = table.joints[near] / table.unit + step[..., 0]
    moved = np.take_along_axis(moved, order[..., None], axis=1)
    # Starts beside a better one lead to the same posture.
    apart = np.abs(moved[:, :, None] - moved[:, None])
    turns = np.where(table.dh.prismatic[table.inner], np.inf, 2.0 * np.pi / table.unit)
    beside = np.minimum(apart, np.abs(turns - apart)).max(axis=3) < _APART
    taken = score <= _FARTHEST
    for number in range(score.shape[1]):
        taken[:, number + 1 :] &= ~(taken[:, number, None] & beside[:, number, number + 1 :])
    taken &= np.cumsum(taken, axis=1) <= _MOST_STARTS
    rows, places = np.nonzero(taken)
    return begin + rows, moved[rows, places] * table.unit


def _closed(dh: DHModel, between: np.ndarray, want: Pose) -> np.ndarray:
    """Joints (m, k) of which the first and the last bring the last axis closest to ``want``."""
    q_rad = np.pad(between, ((0, 0), (1, 1)))
    end = _dh.forward(dh.part(slice(-1)), q_rad[:, :-1])
    # Directions and points of the last axis as complex numbers, turned about z onto the wanted.
    mine, goal = (
        np.stack([1e3 * frame.rotation[:, :2, 2], frame.position_mm[:, :2]]) @ [1.0, 1.0j]
        for frame in (end, want)
    )
    q_rad[:, 0] = np.angle(np.sum(mine.conj() * goal, axis=0))
    axes = np.swapaxes(rotation_z(q_rad[:, 0]) @ end.rotation, 1, 2) @ want.rotation
    sine, cosine = axes[:, 1, 0] - axes[:, 0, 1], axes[:, 0, 0] + axes[:, 1, 1]
    q_rad[:, -1] = np.arctan2(sine, cosine) - dh.theta_offset_rad[-1]
    return q_rad


def _features(model: DHModel, frame: Pose, reach_mm: float) -> np.ndarray:
    """Numbers (n, f) of a frame on the last axis that neither the first nor the last joint changes.

    All of the flange frame where one of them slides.
    """
    p, z = frame.position_mm / reach_mm, frame.rotation[..., 2]
    if model.prismatic[[0, -1]].any():
        return np.column_stack([p, z, frame.rotation[..., 0]])
    aside = p[:, 0] * z[:, 1] - p[:, 1] * z[:, 0]
    along, half_square = np.sum(p * z, axis=1), 0.5 * np.sum(p * p, axis=1)
    return np.column_stack([p[:, 2], along, aside, z[:, 2], half_square])


def names_of(dh: DHModel) -> tuple[str, ...]:
    """Names of the postures of an arm, before they are numbered."""
    if dh.joints == 6 and not dh.prismatic.any():
        return BRANCHES
    sides = [(f"q{joint + 1}+", f"q{joint + 1}-") for joint in _BY_SIGN[dh.joints]]
    halves = [("fore", "aft")] if dh.joints == 7 else []
    return tuple(map(" ".join, product(*halves, *sides)))


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
