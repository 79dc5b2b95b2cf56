"""One walk along a serial chain: its poses, and how every elementary motion moves the flange.

A joint is a product of elementary motions: the six errors of a VEC model (eq. 6), then
``Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)`` (eq. 4). Frames are held as columns ``(3, n)``: a
rotation about a frame's own axis mixes two columns, several times faster than 4x4 products.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from kinacc.geometry import Pose, cross, inverse_transposed, project_so3

if TYPE_CHECKING:
    from kinacc.kinematics.dh import DHModel

X, Y, Z = 0, 1, 2


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


def disturbed(frames: Columns, errors: np.ndarray) -> Columns:
    """Frames behind the first-order error matrix of eq. 6; ``errors`` (6, n) in mm and rad.

    The axes are no longer orthonormal afterwards; eq. 6 is kept as printed.
    """
    dx, dy, dz, ex, ey, ez = errors
    x, y, z, p_mm = frames
    moved = p_mm + dx * x + dy * y + dz * z
    return Columns(x + ez * y - ey * z, y - ez * x + ex * z, z + ey * x - ex * y, moved)


def across(dh: DHModel, joint: int, frames: Columns, q_rad: np.ndarray) -> Iterator[Columns]:
    """The frames that a, alpha act on, those that beta acts on, and those behind the joint.

    ``frames`` are those in front of it, ``q_rad`` (n,) its values (mm where it slides).
    """
    slides = dh.prismatic[joint]
    x, y, z, p_mm = frames
    x, y = _turned(x, y, dh.theta_offset_rad[joint] + (np.zeros(1) if slides else q_rad))
    p_mm = p_mm + (dh.d_mm[joint] + (q_rad if slides else 0.0)) * z
    yield Columns(x, y, z, p_mm)
    p_mm = p_mm + dh.a_mm[joint] * x
    y, z = _turned(y, z, dh.alpha_rad[joint])
    yield Columns(x, y, z, p_mm)
    if dh.beta_rad[joint] != 0.0:
        z, x = _turned(z, x, dh.beta_rad[joint])
    yield Columns(x, y, z, p_mm)


def _turned(
    one: np.ndarray, other: np.ndarray, angle_rad: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Two axes (3, n) turned from the first to the second."""
    s, c = np.sin(angle_rad), np.cos(angle_rad)
    return c * one + s * other, c * other - s * one


def to_pose(frames: Columns) -> Pose:
    """The frames as ``Pose`` with leading axis n."""
    return Pose(np.stack(frames[:3]).transpose(2, 1, 0), frames.p_mm.T)


class Walk:
    """n poses of an arm, and the frames that its elementary motions act on.

    ``before`` [k]: in front of the errors; ``frames`` [k][3]: those theta and d, a and alpha, beta
    act on; ``end``: the flange as eqs. 5-6 print it; ``pose`` with its rotation projected to SO(3).
    """

    def __init__(self, dh: DHModel, q_rad: np.ndarray, errors: np.ndarray | None = None) -> None:
        """``q_rad`` (n, k); ``errors`` (k, 6, n) in mm and rad, none when not given."""
        here = start(len(q_rad))
        self.dh, self.before, self.frames = dh, [], []
        for joint in range(dh.joints):
            self.before.append(here)
            if errors is not None:
                here = disturbed(here, errors[joint])
            ahead, twisted, behind = across(dh, joint, here, q_rad[:, joint])
            self.frames.append((here, ahead, twisted))
            here = behind
        self.end = here
        self.pose = to_pose(here)
        self.stretch: Any = None  # an array where there are errors
        if errors is not None:
            self.pose = Pose(project_so3(self.pose.rotation), self.pose.position_mm)
            # raw = P Q, P symmetric; a small turn w of Q: (tr(P) - P) w = skew part of d(raw) Q'.
            self.stretch = np.einsum("kin,njk->ijn", np.stack(here[:3]), self.pose.rotation)
            trace = np.trace(self.stretch) * np.eye(3)[..., None]
            self.rate = inverse_transposed(trace - self.stretch)

    def shift(self, frames: Columns, axis: int, into: np.ndarray) -> None:
        """Motion (6, n) of the flange per mm along an axis of ``frames``."""
        into[:3], into[3:] = frames[axis], 0.0

    def turn(
        self,
        frames: Columns,
        axis: int,
        into: np.ndarray,
        behind: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Motion (6, n) of the flange per rad about an axis of ``frames``: mm, then rad.

        ``behind``: ``inverse`` of the frames that follow, where frames are not quite orthonormal.
        """
        if behind is None:
            into[:3], into[3:] = cross(frames[axis], self.end.p_mm - frames.p_mm), frames[axis]
            return
        # F [e] G^-1 of frames F and, behind, G, as v r_u' - u r_v' of axes of F and rows of G^-1.
        pushed, reach = behind
        u, v = (axis + 1) % 3, (axis + 2) % 3
        into[:3] = frames[v] * reach[u] - frames[u] * reach[v]
        turned = cross(pushed[u], frames[v]) - cross(pushed[v], frames[u])
        into[3:] = np.einsum("ijn,jn->in", self.rate, turned)

    def inverse(self, frames: Columns) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the inverse axes (3, 3, n), stretched, and the flange (3, n) seen from there."""
        rows = inverse_transposed(np.stack(frames[:3]))
        reach = self.end.p_mm - frames.p_mm
        pushed = np.einsum("ijn,rjn->rin", self.stretch, rows)
        return pushed, np.einsum("rin,in->rn", rows, reach)

    def by_joint(self, joint: int, into: np.ndarray) -> None:
        """Motion (6, n) of the flange per rad, or mm, of a joint."""
        here = self.frames[joint][0]
        if self.dh.prismatic[joint]:
            self.shift(here, Z, into)
        else:
            self.turn(here, Z, into, None if self.stretch is None else self.inverse(here))

    def by_parameters(self) -> np.ndarray:
        """Motions (k, 5, 6, n) of the flange by theta, d, a, alpha, beta of every joint."""
        moved = np.empty((self.dh.joints, 5, 6, self.end.x.shape[1]))
        for into, (here, ahead, twisted) in zip(moved, self.frames, strict=True):
            self.turn(here, Z, into[0])
            self.shift(here, Z, into[1])
            self.shift(ahead, X, into[2])
            self.turn(ahead, X, into[3])
            self.turn(twisted, Y, into[4])
        return moved

    def by_errors(self) -> np.ndarray:
        """Motions (k, 6, 6, n) of the flange by the six errors in front of every joint."""
        moved = np.empty((self.dh.joints, 6, 6, self.end.x.shape[1]))
        for into, here, (following, *_) in zip(moved, self.before, self.frames, strict=True):
            behind = self.inverse(following)
            for axis in range(3):
                self.shift(here, axis, into[axis])
                self.turn(here, axis, into[3 + axis], behind)
        return moved
