"""Poses of a VEC model with their Jacobian in the six errors of every joint, poses last.

One array per number, a pose beside the other: products of many small matrices would cost several
times as much.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinacc.geometry import Pose, project_so3
from kinacc.kinematics import chain as _chain
from kinacc.kinematics.dh import DHModel


class Motions:
    """Projected poses (n, ...) of a DH arm under joint errors, and how these errors move them."""

    def __init__(self, dh: DHModel, q_rad: np.ndarray, errors: np.ndarray) -> None:
        """``q_rad`` (n, k), ``errors`` (n, k, 6) as ``vec.ERRORS``."""
        self.rows = dh.rows
        slides = self.rows[:, 7:] > 0.0
        self.lifts = self.rows[:, 1:2] + np.where(slides, q_rad.T, 0.0)
        turns = self.rows[:, :1] + np.where(slides, 0.0, q_rad.T)
        self.sines, self.cosines = _chain.sincos(turns)
        self.errors = np.ascontiguousarray(errors.transpose(1, 2, 0))
        frames, self.before = _chain.start(len(q_rad)), []  # axes (3, 3, n) at every error matrix
        for joint, row in enumerate(self.rows):
            self.before.append(np.stack(frames[:3], axis=1))
            frames = _chain.disturb(frames, self.errors[joint])
            frames = _chain.rotate_z(frames, self.sines[joint], self.cosines[joint])
            frames = _chain.shift(frames, frames.z, self.lifts[joint])
            frames = _chain.shift(frames, frames.x, row[2])
            frames = _chain.rotate_x(frames, row[4], row[3])
            if row[6] != 0.0:
                frames = _chain.rotate_y(frames, row[6], row[5])
        raw = np.stack(frames[:3], axis=1)  # row, column, pose
        turned = project_so3(raw.transpose(2, 0, 1))
        self.pose = Pose(turned, np.ascontiguousarray(frames.p_mm.T))
        self.rotation = np.ascontiguousarray(turned.transpose(1, 2, 0))
        self.rate = _rate(self.rotation, raw)

    def jacobian(self) -> np.ndarray:
        """Motions (6k, 6, n) by the errors, joint by joint: position and rotation vector. Exact."""
        count, joints = len(self.pose.position_mm), len(self.rows)
        jacobian = np.zeros((joints, 6, 6, count))
        for joint, after in self._after():
            stands, into = self.before[joint], jacobian[joint]
            into[:3, :3] = stands.transpose(1, 0, 2)
            reach, axes = after[:, 3], after[:, :3]
            seen = _product(self.rotation, stands)  # Q' before
            for axis in range(3):
                u, v = (axis + 1) % 3, (axis + 2) % 3
                # e_axis x r has two entries: -r_v along u and r_u along v.
                np.multiply(stands[:, v], reach[u], out=into[3 + axis, :3])
                into[3 + axis, :3] -= stands[:, u] * reach[v]
                # The skew part of Q' before [e_axis] after, written with columns and rows.
                apart = seen[:, v, None] * axes[u] - seen[:, u, None] * axes[v]
                for row in range(3):
                    one, other = (row + 1) % 3, (row + 2) % 3
                    twist = apart[other, one] - apart[one, other]
                    into[3 + axis, 3:] += self.rate[:, row] * twist
        return jacobian.reshape(6 * joints, 6, count)

    def in_joints(self, slopes: np.ndarray) -> np.ndarray:
        """Motions (k, 6, n) by the joints, whose errors change by ``slopes`` (n, k, 6). Exact."""
        moved = np.empty((len(self.rows), 6, len(slopes)))
        for joint, after in self._after():
            stands, into = self.before[joint], moved[joint]
            (dx, dy, dz), (wx, wy, wz) = slopes[:, joint].T.reshape(2, 3, -1)
            ex, ey, ez = self.errors[joint, 3:]
            none, one = np.zeros_like(ex), np.ones_like(ex)
            # What the error matrix changes by, and then the joint's own motion along or about z.
            if self.rows[joint, 7] > 0.0:
                spin = np.array([[none, -wz, wy], [wz, none, -wx], [-wy, wx, none]])
                shift = np.stack([dx + ey, dy - ex, dz + one])
            else:
                spin = np.array(
                    [[-ez, -one - wz, wy], [one + wz, -ez, -wx], [ex - wy, ey + wx, none]]
                )
                shift = np.stack([dx, dy, dz])
            spun = spin[:, 0, None] * after[0] + spin[:, 1, None] * after[1]
            spun += spin[:, 2, None] * after[2]
            into[:3] = np.sum(stands * (spun[:, 3] + shift), axis=1)
            twist = _product(_product(self.rotation, stands).transpose(1, 0, 2), spun[:, :3])
            into[3:] = self.rate[:, 0] * (twist[2, 1] - twist[1, 2])
            into[3:] += self.rate[:, 1] * (twist[0, 2] - twist[2, 0])
            into[3:] += self.rate[:, 2] * (twist[1, 0] - twist[0, 1])
        return moved

    def pulled(self, force: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """``jacobian`` (6k, n) times a force and a moment (3, n) on every flange, without it."""
        found = np.empty((len(self.rows), 6, force.shape[1]))
        along = np.sum(self.rate * moment[:, None], axis=0)
        for joint, after in self._after():
            stands, into = self.before[joint], found[joint]
            reach, axes = after[:, 3], after[:, :3].transpose(1, 0, 2)
            pull = np.sum(stands * force[:, None], axis=0)
            about = np.stack(
                [
                    along[1] * axes[2] - along[2] * axes[1],
                    along[2] * axes[0] - along[0] * axes[2],
                    along[0] * axes[1] - along[1] * axes[0],
                ]
            )
            twist = _product(_product(self.rotation, stands), about)
            into[:3] = pull
            for axis in range(3):
                u, v = (axis + 1) % 3, (axis + 2) % 3
                into[3 + axis] = pull[v] * reach[u] - pull[u] * reach[v]
                into[3 + axis] += twist[v, u] - twist[u, v]
        return found.reshape(6 * len(self.rows), -1)

    def _after(self) -> Iterator[tuple[int, np.ndarray]]:
        """Joints from the last on, with axes and origin (3, 4, n) of the flange from behind one."""
        after = np.zeros((3, 4, len(self.pose.position_mm)))
        after[0, 0] = after[1, 1] = after[2, 2] = 1.0
        for joint in range(len(self.rows) - 1, -1, -1):
            after = self._across(joint, after)
            yield joint, after
            after = _disturbed(self.errors[joint], after)

    def _across(self, joint: int, frames: np.ndarray) -> np.ndarray:
        """Rows (3, 4, n) of frames behind one joint as seen from before it."""
        x, y, z = frames
        row, s, c = self.rows[joint], self.sines[joint], self.cosines[joint]
        if row[6] != 0.0:
            x, z = row[5] * x + row[6] * z, row[5] * z - row[6] * x
        y, z = row[3] * y - row[4] * z, row[4] * y + row[3] * z
        x = x.copy()
        x[3] += row[2]
        z[3] += self.lifts[joint]
        return np.stack([c * x - s * y, s * x + c * y, z])


def _rate(rotation: np.ndarray, raw: np.ndarray) -> np.ndarray:
    """Q (tr(S) I - S)^-1 (3, 3, n) with raw = Q S: from a twist of the flange to its turning."""
    stretch = _product(rotation, raw)
    wanted = -0.5 * (stretch + stretch.transpose(1, 0, 2))
    trace = stretch[0, 0] + stretch[1, 1] + stretch[2, 2]
    for axis in range(3):
        wanted[axis, axis] += trace
    rows = [_chain.cross(wanted[(i + 1) % 3], wanted[(i + 2) % 3]) for i in range(3)]
    determinant = np.sum(wanted[0] * rows[0], axis=0)
    inverse = np.stack(rows, axis=1) / determinant
    return _product(np.ascontiguousarray(rotation.transpose(1, 0, 2)), inverse)


def _product(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Transposed ``one`` (3, 3, n) times ``other`` (3, 3, n)."""
    found = one[0, :, None] * other[0]
    found += one[1, :, None] * other[1]
    found += one[2, :, None] * other[2]
    return found


def _disturbed(errors: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Rows (3, 4, n) of frames behind an error matrix of ``errors`` (6, n) from before it."""
    x, y, z = frames
    shift, (ex, ey, ez) = errors[:3], errors[3:]
    moved = np.stack([x + ey * z - ez * y, y + ez * x - ex * z, z + ex * y - ey * x])
    moved[:, 3] += shift
    return moved
