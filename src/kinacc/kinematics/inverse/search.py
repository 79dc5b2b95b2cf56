"""All postures of a pose for any serial arm: a table of postures, looked up and refined.

What the first joint does to the last axis, and the last joint to the flange, is known in closed
form. So a pose is looked up by what is left: five numbers that say how the line of the last axis
lies to the line of the first. They depend on the joints between alone, two fewer than the arm has,
and a table even in these joints covers every posture densely. Entries that one Newton step on the
five numbers brings to the wanted ones are where the search starts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose, compose, invert, rotation_x, rotation_y, rotation_z
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse.chain_rows import rows_of, targets_of

# Entries per number of joints between the first and the last.
_ENTRIES = {2: 4_000, 3: 20_000, 4: 60_000, 5: 400_000}
_NEAREST = 128
_MOST_STARTS = 64
_FARTHEST = 2.5  # steps, in spacings of the table, that an entry is trusted for
_SLOTS = 24
_BEYOND_LIMITS_RAD = 0.1
_BLOCK = 4096


class Postures(NamedTuple):
    """Postures of n poses: joints (n, slots, k) in (-pi, pi], NaN where empty.

    ``error_mm`` (n, slots) is what is left of the pose error (a radian counts as a metre): less
    than 1e-6 for postures, more for those that only come close.
    """

    q_rad: np.ndarray
    error_mm: np.ndarray


@dataclass(frozen=True, eq=False)
class Table:
    """Postures of the joints between the first and the last, and the features they lead to.

    ``joints`` (N, m); ``features`` (N, f); ``slopes`` (N, f, m) per ``unit`` (m,), the spacing of
    the table; ``reach_mm`` scales lengths; ``tree`` finds the entries nearest to given features.
    """

    dh: DHModel
    rows: np.ndarray
    joints: np.ndarray
    features: np.ndarray
    slopes: np.ndarray
    unit: np.ndarray
    reach_mm: float
    tree: object


def table_of(model: DHModel, lower_rad: np.ndarray, upper_rad: np.ndarray) -> Table:
    """The table of an arm within limits (k,), (k,) of its DH joints; built once per arm."""
    columns = (*(getattr(model, name) for name in _dh.PARAMETERS), lower_rad, upper_rad)
    return _table(tuple(tuple(map(float, column)) for column in columns), tuple(model.prismatic))


@lru_cache(maxsize=8)
def _table(columns: tuple[tuple[float, ...], ...], prismatic: tuple[bool, ...]) -> Table:
    from scipy.spatial import cKDTree

    *parameters, lower, upper = map(np.array, columns)
    model = DHModel(*parameters, np.array(prismatic))
    low, span = _ranges(model, lower, upper)
    low, span = low[1:-1], span[1:-1]
    count = _ENTRIES[len(span)]
    unit = span * count ** (-1.0 / len(span))
    reach_mm = float(np.abs(model.a_mm).sum() + np.abs(model.d_mm).sum())
    reach_mm += float(span[model.prismatic[1:-1]].sum())
    joints = low + _evenly(count, len(span)) * span
    features = _features_inside(model, joints, reach_mm)
    slopes = np.empty((*features.shape, len(span)))
    for joint in range(len(span)):
        step = np.zeros(len(span))
        step[joint] = 1e-5 * unit[joint]
        change = _features_inside(model, joints + step, reach_mm)
        change -= _features_inside(model, joints - step, reach_mm)
        slopes[:, :, joint] = change / 2e-5
    return Table(model, rows_of(model), joints, features, slopes, unit, reach_mm, cKDTree(features))


def search(table: Table, pose: Pose, near_miss_mm: float = 0.0) -> Postures:
    """All postures of poses (n, ...) of the arm of a table, and near misses up to that error."""
    from kinacc.kinematics.inverse import kernels  # numba, which arms in closed form do without

    count = len(pose.position_mm)
    found = np.full((count, _SLOTS, table.dh.joints), np.nan)
    left = np.full((count, _SLOTS), np.inf)
    targets = targets_of(pose)
    wanted = _features(table.dh, _before_last(table.dh, pose), table.reach_mm)
    for begin in range(0, count, _BLOCK):
        block = slice(begin, begin + _BLOCK)
        near = table.tree.query(wanted[block], k=min(_NEAREST, len(table.joints)))[1]
        kernels.postures(
            table.rows,
            targets[block],
            wanted[block],
            table.features,
            table.slopes,
            table.joints,
            near,
            table.unit,
            _MOST_STARTS,
            _FARTHEST,
            max(near_miss_mm, 1e-6),
            found[block],
            left[block],
        )
    return Postures(found, left)


def _ranges(model: DHModel, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the table of each joint begins (k,) and how far it reaches (k,).

    The limits and a little beyond, as an arm slightly different may come in from there; for a
    joint that turns, one turn is enough.
    """
    margin = np.where(model.prismatic, 0.05 * (upper - lower), _BEYOND_LIMITS_RAD)
    low, high = lower - margin, upper + margin
    whole = ~model.prismatic & ~(high - low < 2.0 * np.pi)
    return np.where(whole, -np.pi, low), np.where(whole, 2.0 * np.pi, high - low)


def _evenly(count: int, dimensions: int) -> np.ndarray:
    """Points (count, dimensions) spread evenly over the unit cube (Kronecker, golden ratios)."""
    ratio = 1.5
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (dimensions + 1))
    steps = ratio ** -np.arange(1.0, dimensions + 1)
    return np.mod(0.5 + np.arange(1, count + 1)[:, None] * steps, 1.0)


def _features_inside(model: DHModel, joints: np.ndarray, reach_mm: float) -> np.ndarray:
    """Features (n, f) of the joints between (n, m): the first and the last do not matter."""
    last = model.joints - 1
    columns = (getattr(model, name)[:last] for name in (*_dh.PARAMETERS, "prismatic"))
    still = 0.0 if model.prismatic[0] else -model.theta_offset_rad[0]
    q_rad = np.column_stack([np.full(len(joints), still), joints])
    frame = _dh.forward(DHModel(*columns), q_rad)
    if model.prismatic[last]:
        turn = rotation_z(model.theta_offset_rad[last])
        frame = Pose(frame.rotation @ turn, frame.position_mm)
    return _features(model, frame, reach_mm)


def _before_last(model: DHModel, pose: Pose) -> Pose:
    """Frames (n, ...) on the last axis, some way along and about it, of flange poses (n, ...)."""
    last = model.joints - 1
    turn = rotation_x(model.alpha_rad[last]) @ rotation_y(model.beta_rad[last])
    shift = np.array([model.a_mm[last], 0.0, model.d_mm[last]])
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
