"""Least squares on kinematic models, with derivatives by complex steps: exact to rounding.

Poses are those of `oracles.kinematics`, n at a time, at parameters that may be complex. A residual
of one pose is the position difference in mm (model minus measurement, robot base) and the rotation
vector of R_model R_measured' times a weight in mm/rad.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_STEP = 1e-30


def residual(poses: np.ndarray, measured: np.ndarray, weight: float) -> np.ndarray:
    """Residuals (6n,), pose by pose."""
    turned = poses[:, :3, :3] @ np.swapaxes(measured[:, :3, :3], 1, 2)
    skew = (turned - np.swapaxes(turned, 1, 2)) / 2
    axis = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    sine = np.sqrt(np.sum(axis**2, axis=1, keepdims=True))
    vector = axis * np.arcsin(sine) / sine
    return np.hstack([poses[:, :3, 3] - measured[:, :3, 3], weight * vector]).ravel()


def linearised(
    function: Callable[[np.ndarray], np.ndarray], x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values (m,) of a function at ``x`` (P,) and its Jacobian (m, P)."""
    columns = [function(x + 1j * _STEP * unit).imag / _STEP for unit in np.eye(x.size)]
    return function(x).real, np.array(columns).T


def two_variances(r: np.ndarray, fitted: np.ndarray) -> np.ndarray:
    """Variance of every residual, one for positions and one for rotations: those whose expected
    sums of squares, with the projector that leaves out the ``fitted`` columns, are those seen."""
    turned = np.tile([False] * 3 + [True] * 3, r.size // 6)
    rest = np.eye(r.size) - fitted @ fitted.T
    kinds = (~turned, turned)
    expected = [[(rest[np.ix_(one, other)] ** 2).sum() for other in kinds] for one in kinds]
    position, rotation = np.linalg.solve(expected, [(r[one] ** 2).sum() for one in kinds])
    return np.where(turned, rotation, position)


@dataclass(frozen=True)
class Truncated:
    """A truncated fit judged at its end.

    ``step`` (P,): what is left to the smallest displacement that minimises the residual;
    ``lost`` (P,): share of each parameter in directions that are left out.
    """

    step: np.ndarray
    values: np.ndarray
    rank: int
    cost: float
    std: np.ndarray
    lost: np.ndarray


def truncated(
    r: np.ndarray, jacobian: np.ndarray, displacement: np.ndarray, threshold: float
) -> Truncated:
    """Judge a fit of P parameters, ``displacement`` (P,) away from nominal, in their units.

    Columns of ``jacobian`` beyond P are those of base and tool, which are projected out before
    singular values below ``threshold`` times the largest are left out.
    """
    count = displacement.size
    frames, _ = np.linalg.qr(jacobian[:, count:])
    own = jacobian[:, :count] - frames @ (frames.T @ jacobian[:, :count])
    left, values, right = np.linalg.svd(own, full_matrices=False)
    keep = values >= threshold * values[0]
    solving = (right[keep].T / values[keep]) @ left.T[keep]
    step = -solving @ r - right[~keep].T @ (right[~keep] @ displacement)
    follow, *_ = np.linalg.lstsq(jacobian[:, count:], -r - jacobian[:, :count] @ step)
    variance = two_variances(r, np.hstack([frames, left[:, keep]]))
    std = np.sqrt((solving**2 * variance).sum(axis=1))
    lost = (right[~keep] ** 2).sum(axis=0)
    step = np.concatenate([step, follow])
    return Truncated(step, values, int(keep.sum()), float(r @ r), std, lost)
