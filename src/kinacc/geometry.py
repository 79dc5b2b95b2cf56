"""Rigid motions as arrays: rotations, frames and their logarithms; knows nothing of robots.

Rotations are ``(..., 3, 3)``, vectors ``(..., 3)``; leading axes broadcast. Angles in rad,
lengths in mm. Quaternions are ``w, x, y, z``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kinacc.errors import input_error


def numbers(name: str, value: ArrayLike, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """An array of numbers that somebody gave, spread to a shape; InputError where it is none."""
    try:
        array = np.asarray(value, dtype=float)
        return array if shape is None else np.broadcast_to(array, shape)
    except (TypeError, ValueError):
        message = "is not an array of numbers" + (f" of shape {shape}" if shape else "")
        raise input_error(name, message) from None


class Pose(NamedTuple):
    """Poses of frames in their parent frame.

    Attributes
    ----------
    rotation
        (n, 3, 3) rotation matrices; other leading axes are allowed.
    position_mm
        (n, 3) origins, mm.
    """

    rotation: np.ndarray
    position_mm: np.ndarray

    def select(self, rows: np.ndarray | slice | int) -> Pose:
        """Select frames of the first axis.

        Parameters
        ----------
        rows : numpy.ndarray, slice or int
            Mask (n,), indices (m,), slice, or the number of a single frame.

        Returns
        -------
        Pose
            The m frames, or the single one, in the same parent frame, mm.
        """
        return Pose(self.rotation[rows], self.position_mm[rows])


IDENTITY = Pose(np.eye(3), np.zeros(3))


def compose(first: Pose, second: Pose) -> Pose:
    """Chain two frames: ``T = T_first T_second``.

    Parameters
    ----------
    first : Pose
        Poses (...) in their parent frame, mm.
    second : Pose
        Poses (...) in the frame ``first``, mm; leading axes broadcast.

    Returns
    -------
    Pose
        ``second`` in the parent frame of ``first``, mm.
    """
    rotation = first.rotation @ second.rotation
    position = (first.rotation @ second.position_mm[..., None])[..., 0] + first.position_mm
    return Pose(rotation, position)


def invert(pose: Pose) -> Pose:
    """Invert frames: ``(R, p)`` becomes ``(R', -R' p)``.

    Parameters
    ----------
    pose : Pose
        Poses (...) in their parent frame, mm.

    Returns
    -------
    Pose
        The parent frame in ``pose``, mm.
    """
    transposed = np.swapaxes(pose.rotation, -1, -2)
    return Pose(transposed, -(transposed @ pose.position_mm[..., None])[..., 0])


def skew(vector: np.ndarray) -> np.ndarray:
    """Cross-product matrix: ``skew(v) @ u = v x u``.

    Parameters
    ----------
    vector : numpy.ndarray
        Vectors, shape (..., 3), any unit.

    Returns
    -------
    numpy.ndarray
        Matrices, shape (..., 3, 3), same unit.
    """
    return np.tensordot(vector, _CROSS, 1)


# Cross-product matrices of the axes x, y, z.
_CROSS = np.swapaxes(np.cross(np.eye(3)[:, None], np.eye(3)), 1, 2)


def rotation_x(angle_rad: np.ndarray | float) -> np.ndarray:
    """Rotation about x.

    Parameters
    ----------
    angle_rad : numpy.ndarray or float
        Angles, shape (...).

    Returns
    -------
    numpy.ndarray
        Rotations, shape (..., 3, 3).
    """
    return _axis_rotation(angle_rad, 0)


def rotation_y(angle_rad: np.ndarray | float) -> np.ndarray:
    """Rotation about y; shapes and units as ``rotation_x``."""
    return _axis_rotation(angle_rad, 1)


def rotation_z(angle_rad: np.ndarray | float) -> np.ndarray:
    """Rotation about z; shapes and units as ``rotation_x``."""
    return _axis_rotation(angle_rad, 2)


def _axis_rotation(angle_rad: np.ndarray | float, axis: int) -> np.ndarray:
    angle = np.asarray(angle_rad, dtype=float)[..., None, None]
    along = np.diag(np.eye(3)[axis])
    return along + np.cos(angle) * (np.eye(3) - along) + np.sin(angle) * _CROSS[axis]


def exp_so3(rotation_vector_rad: np.ndarray) -> np.ndarray:
    """Rotation of a rotation vector.

    Parameters
    ----------
    rotation_vector_rad : numpy.ndarray
        Axis times angle, shape (..., 3), rad.

    Returns
    -------
    numpy.ndarray
        Rotations, shape (..., 3, 3).
    """
    return Rotation.from_rotvec(rotation_vector_rad).as_matrix()


def log_so3(rotation: np.ndarray) -> np.ndarray:
    """Rotation vector of a rotation; inverse of ``exp_so3``.

    Parameters
    ----------
    rotation : numpy.ndarray
        Rotations, shape (..., 3, 3).

    Returns
    -------
    numpy.ndarray
        Axis times angle, shape (..., 3), rad, length at most pi.
    """
    quaternion = quaternion_from_rotation(rotation)
    scalar, vector = quaternion[..., 0], quaternion[..., 1:]
    half = np.arctan2(np.linalg.norm(vector, axis=-1), scalar)
    return 2.0 / np.sinc(half / np.pi)[..., None] * vector


def project_so3(matrix: np.ndarray) -> np.ndarray:
    """Nearest rotation (polar factor) of a matrix.

    Newton's iteration for the polar factor on cofactors (Higham 1986); quadratic near a rotation,
    where the first-order products of eq. 6 lie.

    Parameters
    ----------
    matrix : numpy.ndarray
        Matrices with positive determinant, shape (..., 3, 3).

    Returns
    -------
    numpy.ndarray
        Rotations, shape (..., 3, 3).
    """
    matrices = np.asarray(matrix, dtype=float)
    # Numbers first, matrices last: one operation for all of them.
    result = np.moveaxis(matrices.reshape(-1, 3, 3), 0, 2).copy()
    settled = np.zeros(result.shape[2], dtype=bool)
    for _ in range(60):
        following = 0.5 * (result + inverse_transposed(result))
        change = np.max(np.abs(following - result), axis=(0, 1))
        # A settled matrix is left alone, so no result depends on what else is in the batch.
        result = np.where(settled, result, following)
        settled = settled | (change < 1e-14)
        if settled.all():
            break
    return np.moveaxis(result, 2, 0).reshape(matrices.shape)


def inverse_transposed(matrix: np.ndarray) -> np.ndarray:
    """Transposed inverse of matrices, from the cross products of their rows.

    Parameters
    ----------
    matrix : numpy.ndarray
        Matrices, shape (3, 3, n).

    Returns
    -------
    numpy.ndarray
        Matrices, shape (3, 3, n).
    """
    x, y, z = matrix
    cofactors = np.array([cross(y, z), cross(z, x), cross(x, y)])
    return cofactors / np.sum(x * cofactors[0], axis=0)


def cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Cross products of columns, in less time than ``numpy.cross``.

    Parameters
    ----------
    one, other : numpy.ndarray
        Vectors, shape (3, n).

    Returns
    -------
    numpy.ndarray
        Vectors, shape (3, n).
    """
    (a, b, c), (u, v, w) = one, other
    return np.array([b * w - c * v, c * u - a * w, a * v - b * u])


def rotation_from_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Rotation of a unit quaternion.

    Parameters
    ----------
    quaternion : numpy.ndarray
        Unit quaternions ``w, x, y, z``, shape (..., 4).

    Returns
    -------
    numpy.ndarray
        Rotations, shape (..., 3, 3).
    """
    values = np.asarray(quaternion, dtype=float)
    cross = skew(values[..., 1:])
    return np.eye(3) + 2.0 * (values[..., :1, None] * cross + cross @ cross)


def quaternion_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Unit quaternion of a rotation.

    Parameters
    ----------
    rotation : numpy.ndarray
        Rotations, shape (..., 3, 3).

    Returns
    -------
    numpy.ndarray
        Quaternions ``w, x, y, z`` with ``w >= 0``, shape (..., 4).
    """
    turn = Rotation.from_matrix(rotation, assume_valid=True)
    return turn.as_quat(canonical=True, scalar_first=True)
