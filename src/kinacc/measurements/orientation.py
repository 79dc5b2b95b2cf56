"""Measured orientations of every kind as rotations and quaternions."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.config.measured import Orientation
from kinacc.geometry import exp_so3, rotation_from_quaternion


def quaternions(turns: np.ndarray, orientation: Orientation) -> np.ndarray:
    """Unit quaternions (n, 4) w, x, y, z, w >= 0, of ``turns`` (n, 4 or 3); NaN stays NaN.

    ``turns``: w, x, y, z of about unit length, rotation vectors, or Euler angles in the order of
    its convention, in rad.
    """
    result = np.full((len(turns), 4), np.nan)
    there = np.isfinite(turns).all(axis=1)
    if orientation.kind == "quaternion":
        unit = turns[there] / np.linalg.norm(turns[there], axis=1, keepdims=True)
        result[there] = np.where(unit[:, :1] < 0.0, -unit, unit)
    elif there.any():
        turned = Rotation.from_matrix(rotations(turns[there], orientation))
        result[there] = turned.as_quat(canonical=True, scalar_first=True)
    return result


def rotations(turns: np.ndarray, orientation: Orientation) -> np.ndarray:
    """Rotations (n, 3, 3) of ``turns`` as in ``quaternions``."""
    if orientation.kind == "quaternion":
        return rotation_from_quaternion(turns / np.linalg.norm(turns, axis=1, keepdims=True))
    if orientation.kind == "rotation_vector":
        return exp_so3(turns)
    return Rotation.from_euler(orientation.convention, turns).as_matrix().reshape(-1, 3, 3)
