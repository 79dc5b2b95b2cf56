"""Denavit-Hartenberg model with a Hayati term: poses and their analytic Jacobians (eqs. 1-4).

Joint i moves frame i-1 to frame i by ``Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)``; beta is
the Hayati rotation for (nearly) parallel axes and 0 elsewhere. A prismatic joint slides along the
same axis instead: ``Rz(theta) Tz(q + d) ...``. Poses are of the last frame in the first one.

Joints ``q_rad`` are in rad; those of prismatic joints, columns of the same arrays, in mm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from types import ModuleType
from typing import ClassVar, Self

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import chain as _chain
from kinacc.kinematics.chain import Columns
from kinacc.kinematics.model import JointState

PARAMETERS = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad")

_BLOCK = 1024  # columns of one block stay in the cache
WORTH_NUMBA = 4_000_000  # joint values that the plain twins take the time of its start for


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

    @cached_property
    def rows(self) -> np.ndarray:
        """A row (k, 8) a joint, as kernels take them.

        theta, d, a, cosine and sine of alpha, cosine and sine of beta, and 1 where it slides.
        """
        (sa, sb), (ca, cb) = _chain.sincos(np.stack([self.alpha_rad, self.beta_rad]))
        first = self.theta_offset_rad, self.d_mm, self.a_mm
        return np.stack([*first, ca, sa, cb, sb, self.prismatic], axis=1, dtype=float)

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


def forward(
    model: DHModel, q_rad: np.ndarray, *, threads: int = 1, out: Pose | None = None
) -> Pose:
    """Flange poses (n, ...) in the robot base at joints ``q_rad`` (n, k) (eqs. 3-4).

    ``threads`` share many poses, with the same bits at any number; ``out`` is filled and returned.
    """
    q_rad = _joints(q_rad)
    pose = _empty_pose(len(q_rad)) if out is None else out
    _fill("forward", _forward, model, q_rad, tuple(pose), threads)
    return pose


def chain(model: DHModel, q_rad: np.ndarray) -> Pose:
    """Every frame of the arm, leading axes (n, k+1), from the base (0) to the flange (k)."""
    q_rad = _joints(q_rad)
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
    return pose_and_joint_jacobian(model, q_rad)[1]


def pose_and_joint_jacobian(
    model: DHModel,
    q_rad: np.ndarray,
    *,
    threads: int = 1,
    out: tuple[Pose, np.ndarray] | None = None,
) -> tuple[Pose, np.ndarray]:
    """``forward`` and ``joint_jacobian`` in one pass."""
    q_rad = _joints(q_rad)
    if out is None:
        out = _empty_pose(len(q_rad)), np.empty((len(q_rad), 6, model.joints))
    _fill("joint_jacobian", _joint_jacobian, model, q_rad, (*out[0], out[1]), threads)
    return out


def parameter_jacobian(model: DHModel, q_rad: np.ndarray) -> np.ndarray:
    """Jacobian (n, 6, k, 5) of the flange pose in the parameters, ordered as ``PARAMETERS``.

    Rows as in ``joint_jacobian``; columns per rad for angles and per mm for lengths.
    """
    return pose_and_parameter_jacobian(model, q_rad)[1]


def pose_and_parameter_jacobian(
    model: DHModel,
    q_rad: np.ndarray,
    *,
    threads: int = 1,
    out: tuple[Pose, np.ndarray] | None = None,
) -> tuple[Pose, np.ndarray]:
    """``forward`` and ``parameter_jacobian`` in one pass."""
    q_rad = _joints(q_rad)
    if out is None:
        shape = len(q_rad), 6, model.joints, len(PARAMETERS)
        out = _empty_pose(len(q_rad)), np.empty(shape)
    _fill("parameter_jacobian", _parameter_jacobian, model, q_rad, (*out[0], out[1]), threads)
    return out


def across_joint(model: DHModel, joint: int, frames: Columns, q_rad: np.ndarray) -> Columns:
    """Frames moved across one joint at its values ``q_rad`` (n,), eq. 4."""
    [(row, *motion)] = _motions(model.rows[joint : joint + 1], q_rad[:, None])
    return _twisted(row, _turned_and_shifted(row, frames, *motion))


def _joints(q_rad: np.ndarray) -> np.ndarray:
    return np.atleast_2d(np.asarray(q_rad, dtype=float))


def _empty_pose(count: int) -> Pose:
    return Pose(np.empty((count, 3, 3)), np.empty((count, 3)))


def _motions(rows: np.ndarray, q_rad: np.ndarray) -> Iterator[tuple[np.ndarray, ...]]:
    """Row, joint values, and sines and cosines of the angles (n,) of every joint."""
    values = q_rad.T
    angles = np.where(rows[:, 7:] > 0.0, 0.0, values) + rows[:, :1]
    return zip(rows, values, *_chain.sincos(angles), strict=True)


def _turned_and_shifted(
    row: np.ndarray, frames: Columns, q_rad: np.ndarray, s: np.ndarray, c: np.ndarray
) -> Columns:
    frames = _chain.rotate_z(frames, s, c)
    frames = _chain.shift(frames, frames.z, q_rad + row[1] if row[7] > 0.0 else row[1])
    return _chain.shift(frames, frames.x, row[2])


def _twisted(row: np.ndarray, frames: Columns) -> Columns:
    frames = _chain.rotate_x(frames, row[4], row[3])
    return _chain.rotate_y(frames, row[6], row[5]) if row[6] != 0.0 else frames


def walk(rows: np.ndarray, q_rad: np.ndarray) -> tuple[list[Columns], Columns]:
    """The frames before every joint, and those of the flange."""
    frames, before = _chain.start(len(q_rad)), []
    for row, *motion in _motions(rows, q_rad):
        before.append(frames)
        frames = _twisted(row, _turned_and_shifted(row, frames, *motion))
    return before, frames


def _forward(rows: np.ndarray, q_rad: np.ndarray, rotation: np.ndarray, p_mm: np.ndarray) -> None:
    _chain.write(walk(rows, q_rad)[1], rotation, p_mm)


def _joint_jacobian(
    rows: np.ndarray,
    q_rad: np.ndarray,
    rotation: np.ndarray,
    p_mm: np.ndarray,
    jacobian: np.ndarray,
) -> None:
    before, frames = walk(rows, q_rad)
    for joint, at in enumerate(before):
        if rows[joint, 7] > 0.0:
            jacobian[:, :3, joint], jacobian[:, 3:, joint] = at.z.T, 0.0
        else:
            jacobian[:, :3, joint] = _chain.cross(at.z, frames.p_mm - at.p_mm).T
            jacobian[:, 3:, joint] = at.z.T
    _chain.write(frames, rotation, p_mm)


def _parameter_jacobian(
    rows: np.ndarray,
    q_rad: np.ndarray,
    rotation: np.ndarray,
    p_mm: np.ndarray,
    jacobian: np.ndarray,
) -> None:
    frames = _chain.start(len(q_rad))
    turns: list[tuple[int, int, np.ndarray, np.ndarray]] = []  # joint, column, axis, origin
    jacobian[:, 3:, :, 1:3] = 0.0
    for joint, (row, *motion) in enumerate(_motions(rows, q_rad)):
        turns.append((joint, 0, frames.z, frames.p_mm))
        jacobian[:, :3, joint, 1] = frames.z.T
        frames = _turned_and_shifted(row, frames, *motion)
        jacobian[:, :3, joint, 2] = frames.x.T
        turns.append((joint, 3, frames.x, frames.p_mm))
        frames = _twisted(row, frames)
        turns.append((joint, 4, frames.y, frames.p_mm))
    for joint, column, axis, origin in turns:
        jacobian[:, :3, joint, column] = _chain.cross(axis, frames.p_mm - origin).T
        jacobian[:, 3:, joint, column] = axis.T
    _chain.write(frames, rotation, p_mm)


def _fill(
    name: str,
    twin: Callable[..., None],
    model: DHModel,
    q_rad: np.ndarray,
    outputs: tuple[np.ndarray, ...],
    threads: int,
) -> None:
    """Fill ``outputs``, each with leading axis n, by the kernel ``name`` or by its plain twin.

    Both give the same bits, so which one runs is a matter of time alone.
    """
    rows = model.rows
    kernels = compiled_for(q_rad.size)
    if kernels is None:
        for begin in range(0, len(q_rad), _BLOCK):
            block = slice(begin, begin + _BLOCK)
            twin(rows, q_rad[block], *(each[block] for each in outputs))
        return
    kernel = getattr(kernels, name)
    q_rad = np.require(q_rad, requirements=["C", "W"])  # each kind of array is compiled anew
    if threads > 1 and len(q_rad) > threads:
        from concurrent.futures import ThreadPoolExecutor

        edges = [len(q_rad) * part // threads for part in range(threads + 1)]
        parts = [slice(*pair) for pair in pairwise(edges)]
        with ThreadPoolExecutor(threads) as pool:
            far = any(
                pool.map(lambda at: kernel(rows, q_rad[at], *(each[at] for each in outputs)), parts)
            )
    else:
        far = kernel(rows, q_rad, *outputs)
    if far:  # angles that are left to libm
        angles = np.where(model.prismatic, 0.0, q_rad) + model.theta_offset_rad
        at = np.flatnonzero(~(np.abs(angles) <= _chain.LARGEST_RAD).all(axis=1))
        fresh = tuple(np.empty_like(each[at]) for each in outputs)
        twin(rows, q_rad[at], *fresh)
        for each, values in zip(outputs, fresh, strict=True):
            each[at] = values


_spent = 0


def compiled_for(values: int) -> ModuleType | None:
    """The compiled kernels, or None while importing numba would take longer than it saves.

    ``values``: joint values asked for now. Small problems never wait for numba; a process that has
    asked for many has paid for it, and all that follow are compiled.
    """
    global _spent
    _spent += values
    if _spent < WORTH_NUMBA:
        return None
    from kinacc.kinematics import kernels

    return kernels
