"""Moving a batch of frames along a kinematic chain, one elementary motion at a time.

Frames are held as their columns, each ``(3, n)``: a rotation about a frame's own axis mixes two
columns and a translation adds one to the origin, which is several times faster than 4x4 products.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose

# Half pi in parts; the first two have 33 bits: their products with small numbers are exact.
HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
# Polynomials of sine and cosine within pi/4, highest power first (those of FreeBSD's libm).
SINE = (
    1.58969099521155010221e-10,
    -2.50507602534068634195e-08,
    2.75573137070700676789e-06,
    -1.98412698298579493134e-04,
    8.33333333332248946124e-03,
    -1.66666666666666324348e-01,
)
COSINE = (
    -1.13596475577881948265e-11,
    2.08757232129817482790e-09,
    -2.75573143513906633035e-07,
    2.48015872894767294178e-05,
    -1.38888888888741095749e-03,
    4.16666666666666019037e-02,
)
LARGEST_RAD = 1e5  # angles further out, and those not finite, are left to libm


class Columns(NamedTuple):
    """Axes ``x, y, z`` and origin ``p_mm`` of n frames, each ``(3, n)``, in the robot base."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    p_mm: np.ndarray


def sincos(angle_rad: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """Sine and cosine of angles, within a unit in the last place.

    Sums and products in an order that ``kernels.sincos`` repeats, so that both have the same bits,
    which hang on neither processor nor libm.
    """
    angle = np.atleast_1d(np.asarray(angle_rad, dtype=float))
    far = ~(np.abs(angle) <= LARGEST_RAD)
    some_far = far.any()
    x = np.where(far, 0.0, angle) if some_far else angle
    quadrant = np.rint(x * (2.0 / np.pi))
    near = x - quadrant * HALF_PI[0]
    less = quadrant * HALF_PI[1]
    y = near - less
    near -= y
    near -= less
    less = quadrant * HALF_PI[2]
    less -= near
    near, y = y, y - less
    near -= y
    near -= less  # what y has lost by rounding
    z = y * y
    odd, even = z * SINE[0], z * COSINE[0]
    for one, other in zip(SINE[1:-2], COSINE[1:-2], strict=True):
        odd += one
        odd *= z
        even += other
        even *= z
    odd += SINE[-2]
    even += COSINE[-2]
    even *= z
    even += COSINE[-1]
    even *= z
    cube = z * y
    odd *= cube
    np.subtract(0.5 * near, odd, out=odd)
    odd *= z
    odd -= near
    cube *= SINE[-1]
    odd -= cube
    s = y - odd
    even *= z
    y *= near
    even -= y
    z *= 0.5
    c = 1.0 - z
    np.subtract(1.0 - c, z, out=z)
    z += even
    c += z
    # They change places in odd quadrants, and signs in two each: as bits, the fastest way.
    sine, cosine, number = s.view(np.int64), c.view(np.int64), quadrant.astype(np.int64)
    other = sine ^ cosine
    other &= -(number & 1)
    sine ^= other
    cosine ^= other
    sine ^= (number & 2) << 62
    cosine ^= ((number + 1) & 2) << 62
    if some_far:
        s[far], c[far] = np.sin(angle[far]), np.cos(angle[far])
    return s.reshape(np.shape(angle_rad)), c.reshape(np.shape(angle_rad))


def start(count: int) -> Columns:
    """``count`` frames at the robot base."""
    axes = np.zeros((4, 3, count))
    axes[0, 0] = axes[1, 1] = axes[2, 2] = 1.0
    return Columns(*axes)


def rotate_z(frames: Columns, s: np.ndarray | float, c: np.ndarray | float) -> Columns:
    """Turn every frame about its own z axis by the angle of sine ``s`` and cosine ``c``."""
    x, y, z, p_mm = frames
    return Columns(c * x + s * y, c * y - s * x, z, p_mm)


def rotate_x(frames: Columns, s: np.ndarray | float, c: np.ndarray | float) -> Columns:
    """Turn every frame about its own x axis."""
    x, y, z, p_mm = frames
    return Columns(x, c * y + s * z, c * z - s * y, p_mm)


def rotate_y(frames: Columns, s: np.ndarray | float, c: np.ndarray | float) -> Columns:
    """Turn every frame about its own y axis."""
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
    count = frames.x.shape[1]
    pose = Pose(np.empty((count, 3, 3)), np.empty((count, 3)))
    write(frames, *pose)
    return pose


def write(frames: Columns, rotation: np.ndarray, position_mm: np.ndarray) -> None:
    """Fill ``rotation`` (n, 3, 3) and ``position_mm`` (n, 3) with the frames."""
    for column, axis in enumerate(frames[:3]):
        rotation[:, :, column] = axis.T
    position_mm[:] = frames.p_mm.T
