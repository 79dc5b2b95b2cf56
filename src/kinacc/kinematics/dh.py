"""Denavit-Hartenberg model with a Hayati term: poses and their analytic Jacobians (eqs. 1-4).

Joint i moves frame i-1 to frame i by ``Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)``; beta is
the Hayati rotation for (nearly) parallel axes and 0 elsewhere. A prismatic joint slides along the
same axis instead: ``Rz(theta) Tz(q + d) ...``. Poses are of the last frame in the first one.

Joints ``q_rad`` are in rad; those of prismatic joints, columns of the same arrays, in mm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import ClassVar, Self

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import chain as _chain
from kinacc.kinematics.chain import Columns
from kinacc.kinematics.model import JointState

PARAMETERS = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad")

_BLOCK = 2048  # columns of one block stay in the cache


@dataclass(frozen=True)
class DHModel:
    """DH parameters of k joints, each array (k,): angles in rad, lengths in mm.

    ``prismatic`` (k,) says which joints slide; none when not given.
    """

    theta_offset_rad: np.ndarray
    d_mm: np.ndarray
    a_mm: np.ndarray
    alpha_rad: np.ndarray
    beta_rad: np.ndarray
    prismatic: np.ndarray | None = None

    kind: ClassVar[str] = "dh"
    domain: ClassVar[None] = None
    knows_loads: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.prismatic is None:
            object.__setattr__(self, "prismatic", np.zeros(np.size(self.d_mm), dtype=bool))
        for field in fields(self):
            kind = bool if field.name == "prismatic" else float
            value = np.array(getattr(self, field.name), dtype=kind)
            value.setflags(write=False)
            object.__setattr__(self, field.name, value)

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.theta_offset_rad.size

    @property
    def dh(self) -> Self:
        """The model itself: it has no errors but those in its parameters."""
        return self

    table = dh

    @property
    def comparable(self) -> np.ndarray:
        """All parameters (5k,), ordered as ``to_vector``."""
        return to_vector(self)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names (5k,) ordered as ``to_vector``: j1.theta_offset_rad, ..."""
        return tuple(f"j{i}.{name}" for i in range(1, self.joints + 1) for name in PARAMETERS)

    def pose(self, at: JointState) -> Pose:
        """Poses (n, ...) by the joints alone; see ``forward``."""
        return forward(self, at.q_rad)

    def joint_jacobian(self, at: JointState) -> np.ndarray:
        """Jacobian (n, 6, k) of ``pose`` in the joints."""
        return joint_jacobian(self, at.q_rad)

    def parameter_jacobian(self, at: JointState) -> np.ndarray:
        """Jacobian (n, 6, 5k) of ``pose`` in the parameters."""
        return parameter_jacobian(self, at.q_rad).reshape(len(at), 6, -1)

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """The table ``dh_model``: parameters and their ``std`` (5k,), NaN where undetermined."""
        std = np.reshape(std, (self.joints, len(PARAMETERS)))
        columns = {"joint": np.arange(1, self.joints + 1)}
        columns |= {name: getattr(self, name) for name in PARAMETERS}
        return columns | {f"std_{name}": std[:, i] for i, name in enumerate(PARAMETERS)}

    @classmethod
    def from_columns(
        cls, columns: Mapping[str, np.ndarray], prismatic: np.ndarray | None = None
    ) -> Self:
        """The model of a ``dh_model`` table; ``prismatic`` (k,) is the robot's to say."""
        order = np.argsort(columns["joint"], kind="stable")
        return cls(*(np.asarray(columns[name], float)[order] for name in PARAMETERS), prismatic)


def to_vector(model: DHModel) -> np.ndarray:
    """Parameters as (5k,): joint by joint, in the order of ``PARAMETERS``."""
    return np.stack([getattr(model, name) for name in PARAMETERS], axis=-1).ravel()


def with_vector(model: DHModel, vector: np.ndarray) -> DHModel:
    """The model with the parameters of ``vector`` (5k,), ordered as ``to_vector``."""
    table = np.reshape(vector, (model.joints, len(PARAMETERS)))
    return replace(model, **{name: table[:, i] for i, name in enumerate(PARAMETERS)})


def forward(model: DHModel, q_rad: np.ndarray) -> Pose:
    """Flange poses (n, ...) in the robot base at joints ``q_rad`` (n, k) (eqs. 3-4)."""
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    pose = Pose(np.empty((len(q_rad), 3, 3)), np.empty((len(q_rad), 3)))
    for begin in range(0, len(q_rad), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        frames = _chain.start(len(q_rad[block]))
        for joint in range(model.joints):
            frames = across_joint(model, joint, frames, q_rad[block, joint])
        for column, axis in enumerate(frames[:3]):
            pose.rotation[block, :, column] = axis.T
        pose.position_mm[block] = frames.p_mm.T
    return pose


def chain(model: DHModel, q_rad: np.ndarray) -> Pose:
    """Every frame of the arm, leading axes (n, k+1), from the base (0) to the flange (k)."""
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    frames = _chain.start(len(q_rad))
    poses = [_chain.to_pose(frames)]
    for joint in range(model.joints):
        frames = across_joint(model, joint, frames, q_rad[:, joint])
        poses.append(_chain.to_pose(frames))
    return Pose(
        np.stack([pose.rotation for pose in poses], axis=1),
        np.stack([pose.position_mm for pose in poses], axis=1),
    )


def joint_jacobian(model: DHModel, q_rad: np.ndarray) -> np.ndarray:
    """Jacobian (n, 6, k) of the flange pose in the joints, in the robot base.

    Rows 0-2: position, mm/rad. Rows 3-5: rotation vector w with R(q + dq) = exp(w) R(q), rad/rad.
    Columns of prismatic joints are per mm.
    """
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    frames = _chain.start(len(q_rad))
    axes, origins = [], []
    for joint in range(model.joints):
        axes.append(frames.z)
        origins.append(frames.p_mm)
        frames = across_joint(model, joint, frames, q_rad[:, joint])
    jacobian = np.empty((len(q_rad), 6, model.joints))
    for joint, (axis, origin) in enumerate(zip(axes, origins, strict=True)):
        if model.prismatic[joint]:
            jacobian[:, :3, joint], jacobian[:, 3:, joint] = axis.T, 0.0
            continue
        jacobian[:, :3, joint] = _chain.cross(axis, frames.p_mm - origin).T
        jacobian[:, 3:, joint] = axis.T
    return jacobian


def parameter_jacobian(model: DHModel, q_rad: np.ndarray) -> np.ndarray:
    """Jacobian (n, 6, k, 5) of the flange pose in the parameters, ordered as ``PARAMETERS``.

    Rows as in ``joint_jacobian``; columns per rad for angles and per mm for lengths.
    """
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    frames = _chain.start(len(q_rad))
    turns: list[tuple[int, int, np.ndarray, np.ndarray]] = []  # joint, column, axis, origin
    jacobian = np.zeros((len(q_rad), 6, model.joints, len(PARAMETERS)))
    for joint in range(model.joints):
        turns.append((joint, 0, frames.z, frames.p_mm))
        jacobian[:, :3, joint, 1] = frames.z.T
        frames = _turned_and_shifted(model, joint, frames, q_rad[:, joint])
        jacobian[:, :3, joint, 2] = frames.x.T
        turns.append((joint, 3, frames.x, frames.p_mm))
        frames = _chain.rotate_x(frames, model.alpha_rad[joint])
        turns.append((joint, 4, frames.y, frames.p_mm))
        frames = _chain.rotate_y(frames, model.beta_rad[joint])
    for joint, column, axis, origin in turns:
        jacobian[:, :3, joint, column] = _chain.cross(axis, frames.p_mm - origin).T
        jacobian[:, 3:, joint, column] = axis.T
    return jacobian


def _turned_and_shifted(model: DHModel, joint: int, frames: Columns, q_rad: np.ndarray) -> Columns:
    if model.prismatic[joint]:
        frames = _chain.rotate_z(frames, model.theta_offset_rad[joint])
        frames = _chain.shift(frames, frames.z, q_rad + model.d_mm[joint])
    else:
        frames = _chain.rotate_z(frames, q_rad + model.theta_offset_rad[joint])
        frames = _chain.shift(frames, frames.z, model.d_mm[joint])
    return _chain.shift(frames, frames.x, model.a_mm[joint])


def across_joint(model: DHModel, joint: int, frames: Columns, q_rad: np.ndarray) -> Columns:
    """Frames moved across one joint at its values ``q_rad`` (n,), eq. 4."""
    frames = _turned_and_shifted(model, joint, frames, q_rad)
    frames = _chain.rotate_x(frames, model.alpha_rad[joint])
    if model.beta_rad[joint] != 0.0:
        frames = _chain.rotate_y(frames, model.beta_rad[joint])
    return frames
