"""Least squares on kinematic models with numerical Jacobians, known base and tool.

A residual of one pose is the position difference in mm (model minus measurement, robot base) and
the rotation vector of R_model R_measured' times a weight in mm/rad.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from . import kinematics


def residual(
    forward: Callable[[int], np.ndarray], measured: Sequence[np.ndarray], weight: float
) -> np.ndarray:
    parts = []
    for i, frame in enumerate(measured):
        here = forward(i)
        turn = kinematics.rotation_vector(here[:3, :3] @ frame[:3, :3].T)
        parts.append(np.concatenate([here[:3, 3] - frame[:3, 3], weight * turn]))
    return np.concatenate(parts)


def slopes(
    function: Callable[[np.ndarray], np.ndarray], x: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    columns = []
    for i, step in enumerate(steps):
        shift = np.zeros_like(x)
        shift[i] = step
        columns.append((function(x + shift) - function(x - shift)) / (2 * step))
    return np.array(columns).T


def two_variances(r: np.ndarray, fitted: np.ndarray) -> np.ndarray:
    """Variance of every residual, one for positions and one for rotations: those whose expected
    sums of squares, with the projector that leaves out the ``fitted`` columns, are those seen."""
    turned = np.tile([False] * 3 + [True] * 3, r.size // 6)
    rest = np.eye(r.size) - fitted @ fitted.T
    kinds = (~turned, turned)
    expected = [[(rest[np.ix_(one, other)] ** 2).sum() for other in kinds] for one in kinds]
    position, rotation = np.linalg.solve(expected, [(r[one] ** 2).sum() for one in kinds])
    return np.where(turned, rotation, position)


def truncated_fit(
    function: Callable[[np.ndarray], np.ndarray],
    nominal: np.ndarray,
    unit: np.ndarray,
    threshold: float,
    start: np.ndarray | None = None,
    iterations: int = 12,
) -> dict[str, np.ndarray | int | float]:
    """Smallest displacement from nominal, in units of ``unit``, that minimises the residual:
    singular values below ``threshold`` times the largest are left out."""
    x = (nominal if start is None else start).astype(float)
    for _ in range(iterations):
        r = function(x)
        jacobian = slopes(function, x, unit * 0.1) * unit
        left, values, right = np.linalg.svd(jacobian, full_matrices=False)
        keep = values >= threshold * values[0]
        wanted = jacobian @ ((x - nominal) / unit) - r
        moved = nominal + unit * (right[keep].T @ ((left.T @ wanted)[keep] / values[keep]))
        done = np.abs((moved - x) / unit).max() < 1e-9
        x = moved
        if done:
            break
    cost = float(function(x) @ function(x))
    rank = int(keep.sum())
    solving = (right[keep].T / values[keep]) @ left.T[keep]
    variance = two_variances(function(x), left[:, keep])
    std = unit * np.sqrt((solving**2 * variance).sum(axis=1))
    lost = (right[~keep] ** 2).sum(axis=0)  # share of each parameter in undetermined directions
    return {"x": x, "rank": rank, "values": values, "cost": cost, "std": std, "lost": lost}
