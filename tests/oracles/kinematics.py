"""Forward kinematics by products of 4x4 matrices (paper eqs. 1-6).

A DH table is a sequence of rows (theta_offset_rad, d_mm, a_mm, alpha_rad, beta_rad); joints are
(k,) or (n, k). Tables, joints and errors may be complex, for derivatives by complex steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

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

# Joints (low, high) at which the paper's arm is measured.
MEASURED_RAD = np.radians(
    [(-12, 72), (-30, 54), (-74, 18), (-180, 180), (-122, 122), (-180, 180)]
).T


def turn(axis: int, angle) -> np.ndarray:
    """Rotations (..., 4, 4) about an axis."""
    cosine, sine = np.cos(angle), np.sin(angle)
    matrix = np.zeros((*np.shape(cosine), 4, 4), cosine.dtype)
    second, third = (axis + 1) % 3, (axis + 2) % 3
    matrix[..., axis, axis] = matrix[..., 3, 3] = 1.0
    matrix[..., second, second] = matrix[..., third, third] = cosine
    matrix[..., third, second], matrix[..., second, third] = sine, -sine
    return matrix


rot_x, rot_y, rot_z = (partial(turn, axis) for axis in range(3))


def posture(frames: Sequence[np.ndarray], turned: float) -> tuple[bool, bool]:
    """Whether the wrist is behind axis 1 at ``turned``, and the elbow above shoulder to wrist."""
    ahead = np.array([math.cos(turned), math.sin(turned), 0.0])
    flat = np.array([[frame[:3, 3] @ ahead, frame[2, 3]] for frame in frames])
    shoulder, elbow, wrist = flat[[1, 2, 4]]
    upper, fore = elbow - shoulder, wrist - elbow
    return bool(wrist[0] < 0.0), bool(upper[1] * fore[0] - upper[0] * fore[1] > 0.0)


def motion(change) -> np.ndarray:
    """Eq. 6 as printed: displacements and small turns ``change`` (6, ...) as (..., 4, 4)."""
    dx, dy, dz, ex, ey, ez = np.asarray(change)
    one, nothing = np.ones_like(ex), np.zeros_like(ex)
    rows = [one, -ez, ey, dx], [ez, one, -ex, dy], [-ey, ex, one, dz], [nothing] * 3 + [one]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def trans(x: float, y: float, z: float) -> np.ndarray:
    return motion([x, y, z, 0.0, 0.0, 0.0])


def links(table, q) -> list[np.ndarray]:
    """Eq. 4 with Hayati's extra rotation: Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)."""
    theta, d, a, alpha, beta = np.transpose(table)
    along = motion([a, 0 * a, d, 0 * a, 0 * a, 0 * a])
    product = turn(2, np.asarray(q) + theta) @ along @ turn(0, alpha) @ turn(1, beta)
    return [*np.moveaxis(product, -3, 0)]


def dh_frames(table, q) -> list[np.ndarray]:
    """The base frame and the frame after each joint."""
    frames = [np.eye(4)]
    for link in links(table, q):
        frames.append(frames[-1] @ link)
    return frames


def dh_forward(table, q) -> np.ndarray:
    """Eq. 3."""
    return dh_frames(table, q)[-1]


def vec_forward(table, series, low, high, offsets, q, s) -> np.ndarray:
    """Eq. 5: the rotation block is a product of first-order matrices and not orthonormal.

    Chebyshev series (k, 6, order + 1) on [low, high] -> [-1, 1], plus the backlash offset of eps_z
    for travel direction -1 (offsets[:, 0]) or +1 (offsets[:, 1]); none for 0.
    """
    q, s = np.asarray(q), np.asarray(s)
    mapped, frame = (2 * q - low - high) / (np.asarray(high) - low), np.eye(4)
    for i, link in enumerate(links(table, q)):
        errors = chebyshev.chebval(mapped[..., i], series[i].T)
        errors[5] += offsets[i, 0] * (s[..., i] == -1) + offsets[i, 1] * (s[..., i] == 1)
        frame = frame @ motion(errors) @ link
    return frame


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3) closest to matrices: their polar factors, by Newton's iteration."""
    for _ in range(8):
        matrix = (matrix + np.swapaxes(np.linalg.inv(matrix), -1, -2)) / 2
    return matrix


def projected(frame: np.ndarray) -> np.ndarray:
    result = frame.copy()
    result[..., :3, :3] = nearest_rotation(frame[..., :3, :3])
    return result


def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(matrix).as_rotvec()


def apart(first: np.ndarray, second: np.ndarray) -> tuple[float, float]:
    """Distance (mm) and angle (mrad) between two frames."""
    turned = rotation_vector(first[:3, :3].T @ second[:3, :3])
    return float(np.linalg.norm(first[:3, 3] - second[:3, 3])), 1e3 * float(np.linalg.norm(turned))


def frame(x=0.0, y=0.0, z=0.0, turned=None) -> np.ndarray:
    """A 4 x 4 matrix of a position and a scipy rotation."""
    found = trans(x, y, z)
    if turned is not None:
        found[:3, :3] = turned.as_matrix()
    return found
