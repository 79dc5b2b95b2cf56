"""Denavit-Hartenberg model with a Hayati term: poses and their analytic Jacobians (eqs. 1-4).

Joint i moves frame i-1 to frame i by ``Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)``; beta is
the Hayati rotation for (nearly) parallel axes and 0 elsewhere. A prismatic joint slides along the
same axis instead: ``Rz(theta) Tz(q + d) ...``. Poses are of the last frame in the first one.

Joints ``q_rad`` are in rad; those of prismatic joints, columns of the same arrays, in mm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import chain as _chain
from kinacc.kinematics.model import ErrorModel, JointState

PARAMETERS = ("theta_offset_rad", "d_mm", "a_mm", "alpha_rad", "beta_rad")
_UNITS = ("rad", "mm", "mm", "rad", "rad")
_PRIOR_STD = (5e-3, 1.0, 1.0, 1e-3, 1e-3)  # of an arm about its table; joint zeros are set last
_BLOCK = 4096  # poses of one block stay in the cache


@dataclass(frozen=True)
class DHModel(ErrorModel):
    """Denavit-Hartenberg arm of k joints with Hayati terms (eqs. 1-4).

    Attributes
    ----------
    theta_offset_rad, d_mm, a_mm, alpha_rad, beta_rad : numpy.ndarray
        Parameters of the joints, each of shape (k,).
    prismatic : numpy.ndarray
        Joints that slide, shape (k,), bool; none when not given.
    """

    theta_offset_rad: np.ndarray
    d_mm: np.ndarray
    a_mm: np.ndarray
    alpha_rad: np.ndarray
    beta_rad: np.ndarray
    prismatic: np.ndarray = None  # type: ignore[assignment]  # until __post_init__

    kind: ClassVar[str] = "dh"

    def __post_init__(self) -> None:
        if self.prismatic is None:
            object.__setattr__(self, "prismatic", np.zeros(np.size(self.d_mm), dtype=bool))
        for field in fields(self):
            value = np.array(
                getattr(self, field.name), bool if field.name == "prismatic" else float
            )
            value.setflags(write=False)
            object.__setattr__(self, field.name, value)

    def part(self, joints: slice) -> DHModel:
        """Some consecutive joints as an arm by themselves.

        Parameters
        ----------
        joints : slice
            The joints, from 0.

        Returns
        -------
        DHModel
            The arm of these joints.
        """
        return DHModel(*(getattr(self, field.name)[joints] for field in fields(self)))

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.theta_offset_rad.size

    @property
    def travel_unit(self) -> np.ndarray:
        """Movement (k,) of each joint that counts as a radian: 1 rad, 1000 mm where it slides."""
        return np.where(self.prismatic, 1000.0, 1.0)

    @property
    def dh(self) -> Self:
        """The model itself: it has no errors but those in its parameters."""
        return self

    table = dh

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names (5k,) of the parameters: j1.theta_offset_rad, ..."""
        return tuple(f"j{i}.{name}" for i in range(1, self.joints + 1) for name in PARAMETERS)

    @property
    def units(self) -> tuple[str, ...]:
        """Units (5k,) of the parameters."""
        return _UNITS * self.joints

    @property
    def start(self) -> np.ndarray:
        """Parameters (5k,): joint by joint, in the order of ``PARAMETERS``."""
        return np.stack([getattr(self, name) for name in PARAMETERS], axis=-1).ravel()

    @property
    def prior_std(self) -> np.ndarray:
        """Usual errors (5k,) of a table, as standard deviations."""
        return np.tile(_PRIOR_STD, self.joints)

    def with_parameters(self, x: np.ndarray) -> Self:
        """The model with parameters (5k,), ordered as ``start``."""
        return replace(
            self, **dict(zip(PARAMETERS, np.reshape(x, (self.joints, 5)).T, strict=True))
        )

    def pose(self, state: JointState) -> Pose:
        """Poses (n, ...) by the joints alone; see ``forward``."""
        return forward(self, state.q_rad)

    def joint_jacobian(self, state: JointState) -> np.ndarray:
        """Jacobian (n, 6, k) of ``pose`` in the joints; columns of prismatic ones are per mm."""
        walk = _chain.Walk(self, state.q_rad)
        moved = np.empty((self.joints, 6, len(state)))
        for joint, into in enumerate(moved):
            walk.by_joint(joint, into)
        return np.ascontiguousarray(moved.transpose(2, 1, 0))

    def motions(self, state: JointState) -> tuple[Pose, np.ndarray, np.ndarray, None]:
        """Motions (5k, 6, n) of the flange by the parameters, exact."""
        walk = _chain.Walk(self, state.q_rad)
        moved = walk.by_parameters().reshape(5 * self.joints, 6, -1)
        return walk.pose, moved, np.arange(5 * self.joints), None

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """The table ``dh_model``: parameters and their ``std`` (5k,), NaN where undetermined."""
        columns = {"joint": np.arange(1, self.joints + 1)}
        columns |= {name: getattr(self, name) for name in PARAMETERS}
        stds = np.reshape(std, (self.joints, 5)).T
        return columns | {f"std_{name}": each for name, each in zip(PARAMETERS, stds, strict=True)}

    @classmethod
    def from_columns(cls, columns: Mapping[str, np.ndarray], nominal: DHModel) -> Self:
        """The model of a ``dh_model`` table; the joints that slide are the robot's to say."""
        order = np.argsort(columns["joint"], kind="stable")
        parameters = {name: np.asarray(columns[name], float)[order] for name in PARAMETERS}
        return cls(**parameters, prismatic=nominal.prismatic)


def forward(model: DHModel, q_rad: np.ndarray) -> Pose:
    """Flange poses: products of ``Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)`` (eqs. 3-4).

    Parameters
    ----------
    model : DHModel
        Arm of k joints.
    q_rad : numpy.ndarray
        DH joints, shape (n, k) or (k,), rad (mm where a joint slides).

    Returns
    -------
    Pose
        Poses (n, ...) of the last DH frame in the first one, mm.
    """
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    pose = Pose(np.empty((len(q_rad), 3, 3)), np.empty((len(q_rad), 3)))
    for begin in range(0, len(q_rad), _BLOCK):
        block = slice(begin, begin + _BLOCK)
        values = np.ascontiguousarray(q_rad[block].T)
        frames = _chain.start(values.shape[1])
        for joint in range(model.joints):
            *_, frames = _chain.across(model, joint, frames, values[joint])
        pose.rotation[block], pose.position_mm[block] = _chain.to_pose(frames)
    return pose


def chain(model: DHModel, q_rad: np.ndarray) -> Pose:
    """Compute every frame of the arm.

    Parameters
    ----------
    model : DHModel
        Arm of k joints.
    q_rad : numpy.ndarray
        DH joints, shape (n, k) or (k,), rad (mm where a joint slides).

    Returns
    -------
    Pose
        Poses (n, k + 1, ...) in the first DH frame, from itself (0) to the last one (k), mm.
    """
    walk = _chain.Walk(model, np.atleast_2d(np.asarray(q_rad, dtype=float)))
    poses = [_chain.to_pose(frames) for frames in (*walk.before, walk.end)]
    return Pose(*(np.stack(parts, axis=1) for parts in zip(*poses, strict=True)))
