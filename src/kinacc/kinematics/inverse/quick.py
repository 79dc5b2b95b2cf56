"""Plain Newton steps of six turning joints onto poses from starts close by, many at once.

What takes more than a few steps, or a long one, is left to :mod:`kinacc.kinematics.inverse.newton`.
``kernels.onto_poses`` is this file compiled: the same operations in the same order.
"""

from __future__ import annotations

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import chain as _chain
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import DHModel

STEPS = 4
TOLERANCE_MM = 1e-10  # of the position, and of the rotation at the lever
LEVER_MM = 1000.0
LONGEST_RAD = 0.5
ROUND_OFF = 1e-15  # of the diagonal: keeps the solve regular
_BLOCK = 1024


def suits(model: DHModel | None) -> bool:
    """Whether these steps are for a model: a table of DH parameters of six turning joints."""
    return model is not None and model.joints == 6 and not model.prismatic.any()


def refine(model: DHModel, goal: Pose, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joints (m, 6) on ``goal`` (m, ...) to 1e-9 mm, and which are (m,); from ``first`` (m, 6)."""
    q_rad, met = np.array(first, dtype=float, order="C"), np.zeros(len(first), dtype=bool)
    if not (np.abs(q_rad + model.theta_offset_rad) <= 0.5 * _chain.LARGEST_RAD).all():
        return q_rad, met
    rotation, p_mm = (np.require(part, float, ["C", "W"]) for part in goal)
    kernels = _dh.compiled_for(8 * q_rad.size)  # four forward kinematics, and twice that
    if kernels is not None:
        kernels.onto_poses(model.rows, rotation, p_mm, q_rad, met)
        return q_rad, met
    for begin in range(0, len(q_rad), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        onto_poses(model.rows, rotation[block], p_mm[block], q_rad[block], met[block])
    return q_rad, met


def onto_poses(
    rows: np.ndarray, rotation: np.ndarray, p_mm: np.ndarray, q_rad: np.ndarray, met: np.ndarray
) -> None:
    """Move joints ``q_rad`` (m, 6) in place and fill ``met`` (m,); joints that fail become NaN."""
    x, y, z = rotation.transpose(2, 1, 0)
    goal = _chain.Columns(x, y, z, p_mm.T)
    going = np.arange(len(q_rad))
    for number in range(STEPS + 1):
        aims = _chain.Columns(*(part[:, going] for part in goal))
        slopes, frames = _slopes_at(rows, q_rad[going])
        error, done = _error(aims, frames)
        met[going[done]] = True
        if done.all() or number == STEPS:
            return
        going, slopes, error = going[~done], slopes[..., ~done], error[:, ~done]
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            step = _solve(slopes, error).T
            moved = q_rad[going] + step
            good = (np.abs(step) <= LONGEST_RAD) & (np.abs(moved) <= _chain.LARGEST_RAD)
        q_rad[going] = np.where(good, moved, np.nan)


def _slopes_at(rows: np.ndarray, q_rad: np.ndarray) -> tuple[np.ndarray, _chain.Columns]:
    """Slopes (6, 6, m) of joint by row: position, rotation times the lever; and the frames."""
    before, frames = _dh.walk(rows, q_rad)
    slopes = np.empty((6, 6, len(q_rad)))
    for joint, at in enumerate(before):
        slopes[joint, :3] = _chain.cross(at.z, frames.p_mm - at.p_mm)
        slopes[joint, 3:] = LEVER_MM * at.z
    return slopes, frames


def _error(goal: _chain.Columns, frames: _chain.Columns) -> tuple[np.ndarray, np.ndarray]:
    """Error (6, m) in mm, rotation times the lever, and what is within tolerance (m,)."""
    error = np.empty((6, frames.x.shape[1]))
    error[:3] = goal.p_mm - frames.p_mm
    for r in range(3):
        u, v = (r + 1) % 3, (r + 2) % 3
        turn = frames.x[u] * goal.x[v] - frames.x[v] * goal.x[u]
        turn += frames.y[u] * goal.y[v] - frames.y[v] * goal.y[u]
        turn += frames.z[u] * goal.z[v] - frames.z[v] * goal.z[u]
        error[3 + r] = (0.5 * LEVER_MM) * turn
    along = np.sum(frames.x * goal.x, axis=0) + np.sum(frames.y * goal.y, axis=0)  # 2: no turn left
    shift, turn = ((a * a + b * b) + c * c for a, b, c in (error[:3], error[3:]))
    return error, (shift < TOLERANCE_MM**2) & (turn < TOLERANCE_MM**2) & (along > 1.0)


def _solve(slopes: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Steps (6, m) that undo the errors (6, m): normal equations by Cholesky."""
    lower: list[list[np.ndarray]] = []
    step: list[np.ndarray] = []
    for a in range(6):
        lower.append([_product(slopes[a], slopes[b]) for b in range(a + 1)])
        lower[a][a] *= 1.0 + ROUND_OFF
        for b in range(a + 1):
            for c in range(b):
                lower[a][b] -= lower[a][c] * lower[b][c]
            lower[a][b] = np.sqrt(lower[a][a]) if a == b else lower[a][b] / lower[b][b]
        step.append(_product(slopes[a], error))
        for c in range(a):
            step[a] -= lower[a][c] * step[c]
        step[a] /= lower[a][a]
    for a in range(5, -1, -1):
        for c in range(a + 1, 6):
            step[a] -= lower[c][a] * step[c]
        step[a] /= lower[a][a]
    return np.stack(step)


def _product(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    total = one[0] * other[0]
    for r in range(1, 6):
        total += one[r] * other[r]
    return total
