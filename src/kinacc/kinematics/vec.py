"""Volumetric error compensation (VEC) model: joint-dependent Chebyshev errors (eqs. 5-6).

In front of every DH joint stands a first-order error matrix whose six elements (``ERRORS``) are
Chebyshev polynomials of that joint's angle (in mm of its travel, for a prismatic one), mapped from
``[q_min, q_max]`` to [-1, 1]. ``eps_z`` also takes an offset by travel direction s: none at 0, the
first at -1, the second at +1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import ClassVar, Self

import numpy as np

from kinacc.geometry import Pose, project_so3
from kinacc.kinematics import chain as _chain
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.model import JointState
from kinacc.kinematics.vec_motions import Motions

ERRORS = ("delta_x", "delta_y", "delta_z", "eps_x", "eps_y", "eps_z")
_DIRECTIONS = np.array([-1, 1])


@dataclass(frozen=True)
class VECModel:
    """Errors of k joints acting on ``dh``.

    ``coefficients`` (k, 6, order + 1) in mm (delta) and rad (eps); ``direction_offsets_rad`` (k, 2)
    of eps_z for s = -1 and s = +1; joint range ``q_min_rad``, ``q_max_rad`` (k,).
    """

    dh: DHModel
    q_min_rad: np.ndarray
    q_max_rad: np.ndarray
    coefficients: np.ndarray
    direction_offsets_rad: np.ndarray

    kind: ClassVar[str] = "vec"
    table: ClassVar[None] = None
    knows_loads: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for field in fields(self)[1:]:
            value = np.array(getattr(self, field.name), dtype=float)
            value.setflags(write=False)
            object.__setattr__(self, field.name, value)

    @property
    def order(self) -> int:
        """Order of the Chebyshev polynomials."""
        return self.coefficients.shape[-1] - 1

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.dh.joints

    @property
    def domain(self) -> tuple[np.ndarray, np.ndarray]:
        """The fitted range of the DH joints (k,), (k,): a polynomial says nothing beyond it."""
        return self.q_min_rad, self.q_max_rad

    @property
    def comparable(self) -> None:
        """None: constants of neighbouring joints can take each other's place."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names (P,) of the coefficients, ordered as ``to_vector``: j1.delta_x.0, ..."""
        joints, orders = range(1, self.joints + 1), range(self.order + 1)
        coefficients = [f"j{i}.{error}.{n}" for i in joints for error in ERRORS for n in orders]
        offsets = [f"j{i}.eps_z.{direction}" for i in joints for direction in ("minus", "plus")]
        return (*coefficients, *offsets)

    def pose(self, at: JointState) -> Pose:
        """Poses (n, ...) with the rotation projected to SO(3)."""
        return pose(self, at.q_rad, at.s)

    def joint_jacobian(self, at: JointState) -> np.ndarray:
        """Jacobian (n, 6, k) of ``pose`` in the joints."""
        return joint_jacobian(self, at.q_rad, at.s)

    def parameter_jacobian(self, at: JointState) -> np.ndarray:
        """Jacobian (n, 6, P) of ``pose`` in the coefficients."""
        return parameter_jacobian(self, at.q_rad, at.s)

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """The table ``vec_model``: coefficients of both directions, then offsets that have a std.

        ``std`` (P,) as ``to_vector``.
        """
        joints, errors, terms = self.coefficients.shape
        split = self.coefficients.size
        joint, error, order = (part.ravel() for part in np.indices((joints, errors, terms)))
        offset_std = std[split:].reshape(joints, 2)
        more, which = np.nonzero(np.isfinite(offset_std))
        joint = np.concatenate([joint, more])
        error = np.concatenate([error, np.full(more.size, ERRORS.index("eps_z"))])
        offsets = self.direction_offsets_rad[more, which]
        columns = {
            "joint": joint + 1,
            "error": np.array(ERRORS, dtype=object)[error],
            "direction": np.concatenate([np.zeros(split, int), _DIRECTIONS[which]]),
            "order": np.concatenate([order, np.zeros(more.size, int)]),
            "coefficient": np.concatenate([self.coefficients.ravel(), offsets]),
            "std": np.concatenate([std[:split], offset_std[more, which]]),
            "q_min_rad": self.q_min_rad[joint],
            "q_max_rad": self.q_max_rad[joint],
        }
        return columns | {name: getattr(self.dh, name)[joint] for name in PARAMETERS}

    @classmethod
    def from_columns(
        cls, columns: Mapping[str, np.ndarray], prismatic: np.ndarray | None = None
    ) -> Self:
        """The model of a ``vec_model`` table; coefficients it does not list are zero.

        ``prismatic`` (k,): joints that slide, which is the robot's to say.
        """
        joint = np.asarray(columns["joint"]).astype(int) - 1
        order = np.asarray(columns["order"]).astype(int)
        direction = np.asarray(columns["direction"]).astype(int)
        error = np.array([ERRORS.index(name) for name in columns["error"]])
        value = np.asarray(columns["coefficient"], dtype=float)
        first = [np.flatnonzero(joint == number)[0] for number in range(joint.max() + 1)]
        per_joint = {
            name: np.asarray(columns[name], dtype=float)[first]
            for name in (*PARAMETERS, "q_min_rad", "q_max_rad")
        }
        both = direction == 0
        coefficients = np.zeros((len(first), len(ERRORS), order.max() + 1))
        coefficients[joint[both], error[both], order[both]] = value[both]
        offsets = np.zeros((len(first), 2))
        offsets[joint[~both], (direction[~both] + 1) // 2] = value[~both]
        span = per_joint.pop("q_min_rad"), per_joint.pop("q_max_rad")
        return cls(DHModel(**per_joint, prismatic=prismatic), *span, coefficients, offsets)


def without_errors(
    dh: DHModel, q_min_rad: np.ndarray, q_max_rad: np.ndarray, order: int
) -> VECModel:
    """The model whose errors are all zero: it equals ``dh``."""
    shape = (dh.joints, len(ERRORS), order + 1)
    return VECModel(dh, q_min_rad, q_max_rad, np.zeros(shape), np.zeros((dh.joints, 2)))


def to_vector(model: VECModel) -> np.ndarray:
    """Coefficients (P,): joint, error, order; then the direction offsets: joint, direction."""
    return np.concatenate([model.coefficients.ravel(), model.direction_offsets_rad.ravel()])


def with_vector(model: VECModel, vector: np.ndarray) -> VECModel:
    """The model with the coefficients of ``vector`` (P,), ordered as ``to_vector``."""
    split = model.coefficients.size
    return replace(
        model,
        coefficients=np.reshape(vector[:split], model.coefficients.shape),
        direction_offsets_rad=np.reshape(vector[split:], model.direction_offsets_rad.shape),
    )


def mapped_joints(model: VECModel, q_rad: np.ndarray) -> np.ndarray:
    """Joints (n, k) mapped from the fitted range to [-1, 1]; beyond it the model extrapolates."""
    span = model.q_max_rad - model.q_min_rad
    return (2.0 * np.asarray(q_rad, dtype=float) - model.q_min_rad - model.q_max_rad) / span


def chebyshev_basis(model: VECModel, q_rad: np.ndarray) -> np.ndarray:
    """Chebyshev polynomials of the first kind (n, k, order + 1) at joints (n, k)."""
    return _basis(mapped_joints(model, q_rad), model.order)


def errors(model: VECModel, q_rad: np.ndarray, s: np.ndarray | None = None) -> np.ndarray:
    """Joint errors (n, k, 6) in mm and rad at joints (n, k) and travel directions s (n, k)."""
    return _errors(model, chebyshev_basis(model, np.atleast_2d(q_rad)), s)


def forward(model: VECModel, q_rad: np.ndarray, s: np.ndarray | None = None) -> Pose:
    """Flange poses (n, ...) as eqs. 5-6 print them: the rotation is not quite orthonormal."""
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    joint_errors = errors(model, q_rad, s)
    frames = _chain.start(len(q_rad))
    for joint in range(model.joints):
        frames = _chain.disturb(frames, joint_errors[:, joint].T)
        frames = _dh.across_joint(model.dh, joint, frames, q_rad[:, joint])
    return _chain.to_pose(frames)


def pose(model: VECModel, q_rad: np.ndarray, s: np.ndarray | None = None) -> Pose:
    """Flange poses (n, ...) with the rotation projected to SO(3)."""
    raw = forward(model, q_rad, s)
    return Pose(project_so3(raw.rotation), raw.position_mm)


def joint_jacobian(model: VECModel, q_rad: np.ndarray, s: np.ndarray | None = None) -> np.ndarray:
    """Jacobian (n, 6, k) of ``pose`` in the joints; rows as in ``dh.joint_jacobian``. Exact."""
    moved = motions(model, q_rad, s).in_joints(_slopes(model, q_rad))
    return np.ascontiguousarray(moved.transpose(2, 1, 0))


def motions(model: VECModel, q_rad: np.ndarray, s: np.ndarray | None = None) -> Motions:
    """Poses (n, ...) as ``pose``, and how the joints' errors move them."""
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    return Motions(model.dh, q_rad, errors(model, q_rad, s))


def parameter_jacobian(
    model: VECModel, q_rad: np.ndarray, s: np.ndarray | None = None
) -> np.ndarray:
    """Jacobian (n, 6, P) of ``pose`` in the coefficients, ordered as ``to_vector``. Exact."""
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    count, cut = len(q_rad), model.coefficients.size
    moved = motions(model, q_rad, s).jacobian().reshape(model.joints, len(ERRORS), 6, count)
    elementary, basis = moved.transpose(3, 2, 0, 1), chebyshev_basis(model, q_rad)
    jacobian = np.empty((count, 6, cut + model.direction_offsets_rad.size))
    expanded = jacobian[:, :, :cut].reshape(count, 6, *model.coefficients.shape)
    np.multiply(elementary[..., None], basis[:, None, :, None, :], out=expanded)
    offsets = jacobian[:, :, cut:].reshape(count, 6, model.joints, 2)
    if s is None:
        offsets[:] = 0.0
    else:
        chosen = direction_basis(s)[:, None]
        np.multiply(elementary[..., ERRORS.index("eps_z"), None], chosen, out=offsets)
    return jacobian


def direction_basis(s: np.ndarray) -> np.ndarray:
    """Indicators (n, k, 2) of the travel directions -1 and +1 in ``s`` (n, k)."""
    return (np.asarray(s)[..., None] == _DIRECTIONS).astype(float)


def _basis(x: np.ndarray, order: int) -> np.ndarray:
    basis = np.empty((*x.shape, order + 1))
    basis[..., 0] = 1.0
    if order >= 1:
        basis[..., 1] = x
    for n in range(2, order + 1):
        basis[..., n] = 2.0 * x * basis[..., n - 1] - basis[..., n - 2]
    return basis


def _errors(model: VECModel, basis: np.ndarray, s: np.ndarray | None) -> np.ndarray:
    values = np.matmul(basis.transpose(1, 0, 2), model.coefficients.transpose(0, 2, 1))
    values = np.ascontiguousarray(values.transpose(1, 0, 2))
    if s is not None:
        s = np.asarray(s)
        values[..., 5] += np.where(s == -1, model.direction_offsets_rad[:, 0], 0.0)
        values[..., 5] += np.where(s == 1, model.direction_offsets_rad[:, 1], 0.0)
    return values


def _slopes(model: VECModel, q_rad: np.ndarray) -> np.ndarray:
    """Derivatives (n, k, 6) of the joint errors in their own joint, per rad."""
    x = mapped_joints(model, np.atleast_2d(q_rad))
    slope = np.zeros((*x.shape, model.order + 1))
    # T_n' = n U_{n-1}, with U by the same recurrence.
    second = np.ones_like(x)
    previous = np.zeros_like(x)
    for n in range(1, model.order + 1):
        slope[..., n] = n * second
        second, previous = 2.0 * x * second - previous, second
    values = np.einsum("nkt,ket->nke", slope, model.coefficients)
    return values * (2.0 / (model.q_max_rad - model.q_min_rad))[:, None]
