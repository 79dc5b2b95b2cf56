"""Moving a batch of frames along a kinematic chain, one elementary motion at a time.

Frames are held as their columns, each ``(3, n)``: a rotation about a frame's own axis mixes two
columns and a translation adds one to the origin, which is several times faster than 4x4 products.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose


class Columns(NamedTuple):
    """Axes ``x, y, z`` and origin ``p_mm`` of n frames, each ``(3, n)``, in the robot base."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    p_mm: np.ndarray


def start(count: int) -> Columns:
    """``count`` frames at the robot base."""
    axes = np.zeros((4, 3, count))
    axes[0, 0] = axes[1, 1] = axes[2, 2] = 1.0
    return Columns(*axes)


def rotate_z(frames: Columns, angle_rad: np.ndarray | float) -> Columns:
    """Turn every frame about its own z axis."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z, p_mm = frames
    return Columns(c * x + s * y, c * y - s * x, z, p_mm)


def rotate_x(frames: Columns, angle_rad: np.ndarray | float) -> Columns:
    """Turn every frame about its own x axis."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z, p_mm = frames
    return Columns(x, c * y + s * z, c * z - s * y, p_mm)


def rotate_y(frames: Columns, angle_rad: np.ndarray | float) -> Columns:
    """Turn every frame about its own y axis."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z, p_mm = frames
    return Columns(c * x - s * z, y, c * z + s * x, p_mm)


def shift(frames: Columns, axis: np.ndarray, distance_mm: np.ndarray | float) -> Columns:
    """Move every origin along ``axis`` (one of the frames' own columns)."""
    x, y, z, p_mm = frames
    return Columns(x, y, z, p_mm + distance_mm * axis)


def disturb(frames: Columns, errors: np.ndarray) -> Columns:
    """Apply the first-order error matrix of eq. 6; ``errors`` (6, n) in mm and rad.

    The axes are no longer orthonormal afterwards; eq. 6 is kept as printed.
    """
    dx, dy, dz, ex, ey, ez = errors
    x, y, z, p_mm = frames
    return Columns(
        x + ez * y - ey * z,
        y - ez * x + ex * z,
        z + ey * x - ex * y,
        p_mm + dx * x + dy * y + dz * z,
    )


def cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Cross products (3, n) of columns (3, n), with the bits of ``np.cross`` in less time."""
    (a, b, c), (u, v, w) = one, other
    return np.stack([b * w - c * v, c * u - a * w, a * v - b * u])


def to_pose(frames: Columns) -> Pose:
    """The frames as ``Pose`` with leading axis n."""
    return Pose(np.stack([frames.x.T, frames.y.T, frames.z.T], axis=-1), frames.p_mm.T.copy())
