"""Measured orientations of every kind as quaternions, and what their angles' noise means."""

from __future__ import annotations

import numpy as np

from kinacc.geometry import (
    exp_so3,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_x,
    rotation_y,
    rotation_z,
    skew,
)
from kinacc.measurements.layout import Layout

_ABOUT = {"x": rotation_x, "y": rotation_y, "z": rotation_z}
_SMALL_ANGLE_RAD = 1e-6


def quaternions(turns: np.ndarray, layout: Layout) -> np.ndarray:
    """Unit quaternions (n, 4) w, x, y, z, w >= 0, of ``turns`` (n, 4 or 3); NaN stays NaN.

    ``turns``: w, x, y, z of about unit length, rotation vectors, or Euler angles in the order of
    the layout's convention, in rad.
    """
    result = np.full((len(turns), 4), np.nan)
    there = np.isfinite(turns).all(axis=1)
    given = turns[there]
    if layout.orientation == "quaternion":
        unit = given / np.linalg.norm(given, axis=1, keepdims=True)
        result[there] = np.where(unit[:, :1] < 0.0, -unit, unit)
    else:
        result[there] = quaternion_from_rotation(rotations(given, layout))
    return result


def rotations(turns: np.ndarray, layout: Layout) -> np.ndarray:
    """Rotations (n, 3, 3) of ``turns`` as in ``quaternions``."""
    if layout.orientation == "quaternion":
        return rotation_from_quaternion(turns / np.linalg.norm(turns, axis=1, keepdims=True))
    if layout.orientation == "rotation_vector":
        return exp_so3(turns)
    return euler(turns, layout.convention)


def euler(angles_rad: np.ndarray, convention: str) -> np.ndarray:
    """Rotations (n, 3, 3) of angles (n, 3); capitals intrinsic, small letters extrinsic."""
    product = np.broadcast_to(np.eye(3), (len(angles_rad), 3, 3))
    for _, turn in _factors(angles_rad, convention):
        product = product @ turn
    return product


def rotation_std(turns: np.ndarray, std: np.ndarray, layout: Layout) -> np.ndarray:
    """Standard deviations (n, 3) of the rotation vector w of ``exp(w) R``, instrument's frame.

    ``std`` (n, 3): of the layout's angles or rotation vector components, taken as independent.
    """
    if layout.orientation == "rotation_vector":
        jacobian = _left_jacobians(turns)
    else:
        # The axis of an angle is turned by the factors before it.
        jacobian = np.empty((len(turns), 3, 3))
        product = np.broadcast_to(np.eye(3), (len(turns), 3, 3))
        for (number, turn), axis in zip(
            _factors(turns, layout.convention), _axes(layout.convention), strict=True
        ):
            jacobian[:, :, number] = product[:, :, axis]
            product = product @ turn
    return np.sqrt(np.einsum("nij,nj->ni", jacobian**2, std**2))


def _factors(angles_rad: np.ndarray, convention: str):
    """Number of the angle and its rotation, factors of the product from left to right."""
    order = range(3) if convention.isupper() else range(2, -1, -1)
    for number in order:
        yield number, _ABOUT[convention[number].lower()](angles_rad[:, number])


def _axes(convention: str) -> list[int]:
    letters = convention if convention.isupper() else convention[::-1]
    return ["xyz".index(letter.lower()) for letter in letters]


def _left_jacobians(vectors: np.ndarray) -> np.ndarray:
    angle = np.linalg.norm(vectors, axis=1)
    small = angle < _SMALL_ANGLE_RAD
    safe = np.where(small, 1.0, angle)
    versine = np.where(small, 0.5, (1 - np.cos(safe)) / safe**2)[:, None, None]
    excess = np.where(small, 1 / 6, (safe - np.sin(safe)) / safe**3)[:, None, None]
    cross = skew(vectors)
    return np.eye(3) + versine * cross + excess * (cross @ cross)
