"""Poses of a VEC model with their Jacobian in the six errors of every joint, poses last.

One array per number, a pose beside the other: products of many small matrices would cost several
times as much.
"""

from __future__ import annotations

import numpy as np

from kinacc.geometry import Pose, project_so3
from kinacc.kinematics import chain as _chain
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.chain import Columns
from kinacc.kinematics.dh import DHModel


def linearised(dh: DHModel, q_rad: np.ndarray, errors: np.ndarray) -> tuple[Pose, np.ndarray]:
    """Projected poses (n, ...) of ``dh`` under joint ``errors`` (n, k, 6), and their Jacobian.

    The Jacobian (6k, 6, n) in the errors, joint by joint as ``vec.ERRORS``, has rows of position
    and rotation vector. Exact.
    """
    count, joints = len(q_rad), dh.joints
    errors = np.ascontiguousarray(errors.transpose(1, 2, 0))
    before, frames = _before(dh, q_rad, errors)
    raw = np.stack(frames[:3], axis=1)  # row, column, pose
    turned = project_so3(raw.transpose(2, 0, 1))
    rotation = np.ascontiguousarray(turned.transpose(1, 2, 0))
    rate = _rate(rotation, raw)
    jacobian = np.zeros((joints, 6, 6, count))
    after = np.zeros((3, 4, count))  # row; x, y, z and origin of the flange from behind a joint
    after[0, 0] = after[1, 1] = after[2, 2] = 1.0
    for joint in range(joints - 1, -1, -1):
        after = _across(dh, joint, q_rad[:, joint], after)
        stands, into = before[joint], jacobian[joint]
        into[:3, :3] = stands.transpose(1, 0, 2)
        reach, axes = after[:, 3], after[:, :3]
        seen = _product(rotation, stands)  # Q' before
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
                into[3 + axis, 3:] += rate[:, row] * twist
        if joint:
            after = _disturbed(errors[joint], after)
    pose = Pose(turned, np.ascontiguousarray(frames.p_mm.T))
    return pose, jacobian.reshape(6 * joints, 6, count)


def _before(dh: DHModel, q_rad: np.ndarray, errors: np.ndarray) -> tuple[list[np.ndarray], Columns]:
    """Axes (3, 3, n) that stand before every error matrix, and the frames of the flange."""
    frames, before = _chain.start(len(q_rad)), []
    for joint in range(dh.joints):
        before.append(np.stack(frames[:3], axis=1))
        frames = _chain.disturb(frames, errors[joint])
        frames = _dh.across_joint(dh, joint, frames, q_rad[:, joint])
    return before, frames


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


def _across(dh: DHModel, joint: int, q_rad: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Rows (3, 4, n) of frames behind one joint as seen from before it."""
    x, y, z = frames
    c, s = np.cos(dh.beta_rad[joint]), np.sin(dh.beta_rad[joint])
    if s != 0.0:
        x, z = c * x + s * z, c * z - s * x
    c, s = np.cos(dh.alpha_rad[joint]), np.sin(dh.alpha_rad[joint])
    y, z = c * y - s * z, s * y + c * z
    x = x.copy()
    x[3] += dh.a_mm[joint]
    slides = dh.prismatic[joint]
    z[3] += dh.d_mm[joint] + (q_rad if slides else 0.0)
    turn = dh.theta_offset_rad[joint] + (0.0 if slides else q_rad)
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([c * x - s * y, s * x + c * y, z])


def _disturbed(errors: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Rows (3, 4, n) of frames behind an error matrix of ``errors`` (6, n) from before it."""
    x, y, z = frames
    shift, (ex, ey, ez) = errors[:3], errors[3:]
    moved = np.stack([x + ey * z - ez * y, y + ez * x - ex * z, z + ex * y - ey * x])
    moved[:, 3] += shift
    return moved
