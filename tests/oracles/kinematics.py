"""Forward kinematics one 4x4 matrix at a time (paper eqs. 1-6).

A DH table is a sequence of rows (theta_offset_rad, d_mm, a_mm, alpha_rad, beta_rad).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial import chebyshev
from scipy.spatial.transform import Rotation

ERROR_NAMES = ("delta_x", "delta_y", "delta_z", "eps_x", "eps_y", "eps_z")

MH180 = [
    (0.0, 0.0, 325.0, -math.pi / 2, 0.0),
    (-math.pi / 2, 0.0, 1150.0, math.pi, 0.0),
    (0.0, 0.0, 300.0, -math.pi / 2, 0.0),
    (-math.pi, -1225.0, 0.0, -math.pi / 2, 0.0),
    (-math.pi, 0.0, 0.0, -math.pi / 2, 0.0),
    (0.0, -225.0, 0.0, math.pi, 0.0),
]
MH180_LIMITS_DEG = [(-180, 180), (-60, 76), (-86, 90), (-360, 360), (-130, 130), (-360, 360)]

UR10 = [
    (0.0, 127.3, 0.0, math.pi / 2, 0.0),
    (0.0, 0.0, -612.0, 0.0, 0.0),
    (0.0, 0.0, -572.3, 0.0, 0.0),
    (0.0, 163.941, 0.0, math.pi / 2, 0.0),
    (0.0, 115.7, 0.0, -math.pi / 2, 0.0),
    (0.0, 92.2, 0.0, 0.0, 0.0),
]


def rot_x(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def rot_y(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1.0]])


def rot_z(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def trans(x: float, y: float, z: float) -> np.ndarray:
    return np.array([[1, 0, 0, x], [0, 1, 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


def dh_link(row: Sequence[float], q: float) -> np.ndarray:
    """Eq. 4 with Hayati's extra rotation: Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)."""
    theta, d, a, alpha, beta = row
    return rot_z(q + theta) @ trans(0, 0, d) @ trans(a, 0, 0) @ rot_x(alpha) @ rot_y(beta)


def dh_frames(table: Sequence[Sequence[float]], q: Sequence[float]) -> list[np.ndarray]:
    """The base frame and the frame after each joint."""
    frames = [np.eye(4)]
    for row, angle in zip(table, q, strict=True):
        frames.append(frames[-1] @ dh_link(row, angle))
    return frames


def dh_forward(table: Sequence[Sequence[float]], q: Sequence[float]) -> np.ndarray:
    """Eq. 3."""
    return dh_frames(table, q)[-1]


def error_matrix(errors: Sequence[float]) -> np.ndarray:
    """Eq. 6 as printed; errors in the order of ERROR_NAMES."""
    dx, dy, dz, ex, ey, ez = errors
    return np.array([[1, -ez, ey, dx], [ez, 1, -ex, dy], [-ey, ex, 1, dz], [0, 0, 0, 1.0]])


def vec_errors(
    series: np.ndarray, q: float, low: float, high: float, offsets: Sequence[float], s: int
) -> list[float]:
    """Six errors of one joint: Chebyshev series on [low, high] -> [-1, 1], plus the backlash
    offset of eps_z for travel direction -1 (offsets[0]) or +1 (offsets[1]); none for 0."""
    u = (2 * q - low - high) / (high - low)
    values = [float(chebyshev.chebval(u, list(row))) for row in series]
    if s == -1:
        values[5] += offsets[0]
    elif s == +1:
        values[5] += offsets[1]
    return values


def vec_forward(
    table: Sequence[Sequence[float]],
    series: np.ndarray,
    low: Sequence[float],
    high: Sequence[float],
    offsets: np.ndarray,
    q: Sequence[float],
    s: Sequence[int],
) -> np.ndarray:
    """Eq. 5: the rotation block is a product of first-order matrices and not orthonormal."""
    frame = np.eye(4)
    for i, row in enumerate(table):
        errors = vec_errors(series[i], q[i], low[i], high[i], offsets[i], int(s[i]))
        frame = frame @ error_matrix(errors) @ dh_link(row, q[i])
    return frame


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """Rotation closest to a 3x3 matrix in the Frobenius norm."""
    left, _, right = np.linalg.svd(matrix)
    return left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right


def projected(frame: np.ndarray) -> np.ndarray:
    result = frame.copy()
    result[:3, :3] = nearest_rotation(frame[:3, :3])
    return result


def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(matrix).as_rotvec()


def pose_matrix(x: float, y: float, z: float, wxyz: Sequence[float]) -> np.ndarray:
    w, i, j, k = wxyz
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat([i, j, k, w]).as_matrix()
    result[:3, 3] = (x, y, z)
    return result
