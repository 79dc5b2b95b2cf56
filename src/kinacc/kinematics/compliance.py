"""DH arm whose joints give way to gravity: small turns, linear in the moments it exerts.

Joint j turns beyond its commanded angle by ``c_j tau_j + b_j lever_j`` about its own DH axis. tau_j
(N m) is the gravity moment of links of known mass and of the payload beyond the joint; lever_j (mm)
that of a unit weight at the last origin, for links of unknown mass: b_j is then the product of
weight and compliance, which cannot be told apart without a change of load. Moments are those of the
arm as commanded: bending does not change the levers, to first order.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.model import PAYLOAD_COLUMNS, JointState

STANDARD_GRAVITY = 9.80665  # m/s^2
COMPLIANCE, LEVER = "compliance_rad_per_nm", "lever_coefficient_rad_per_mm"
COEFFICIENTS = (COMPLIANCE, LEVER)
_NM_PER_KG_MM = STANDARD_GRAVITY * 1e-3
_LINK = ("link_mass_kg", "link_x_mm", "link_y_mm", "link_z_mm")
_GRAVITY = ("gravity_x", "gravity_y", "gravity_z")
_TURNS = np.array([True, False, False, True, True])  # of PARAMETERS: others shift


@dataclass(frozen=True)
class ComplianceModel:
    """Coefficients of k joints acting on ``dh``, each array (k,), NaN where a joint has none.

    ``gravity`` (3,): its direction in the first DH frame, of unit length. ``links`` (k, 4): mass in
    kg and centre in mm in the DH frame each joint carries, NaN where unknown. ``payload`` (4,): the
    same in the last DH frame, where a state says nothing of it.
    """

    dh: DHModel
    compliance_rad_per_nm: np.ndarray
    lever_coefficient_rad_per_mm: np.ndarray
    gravity: np.ndarray
    links: np.ndarray
    payload: np.ndarray

    kind: ClassVar[str] = "compliance"
    table: ClassVar[None] = None
    domain: ClassVar[None] = None

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.dh.joints

    @property
    def knows_loads(self) -> bool:
        """Whether a compliance was fitted; a lever's coefficient holds for the load measured."""
        return bool(np.isfinite(self.compliance_rad_per_nm).any())

    @property
    def coefficients(self) -> np.ndarray:
        """Both kinds of coefficients (k, 2) as ``COEFFICIENTS``, NaN where there is none."""
        return np.stack([self.compliance_rad_per_nm, self.lever_coefficient_rad_per_mm], axis=1)

    @property
    def comparable(self) -> np.ndarray:
        """All parameters (P,), ordered as ``to_vector``."""
        return to_vector(self)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names (P,) ordered as ``to_vector``: of the DH arm, then j2.compliance_rad_per_nm, .."""
        places = np.argwhere(np.isfinite(self.coefficients))
        own = (f"j{joint + 1}.{COEFFICIENTS[kind]}" for joint, kind in places)
        return (*self.dh.parameter_names, *own)

    def pose(self, at: JointState) -> Pose:
        """Poses (n, ...) of the bent arm."""
        return _dh.forward(self.dh, self._bent(at, self._moments(at)))

    def moments(self, at: JointState) -> np.ndarray:
        """What bends the joints (n, k, 2): moments of known masses, N m, and levers, mm."""
        return np.stack([each.values for each in self._moments(at)], axis=2)

    def joint_jacobian(self, at: JointState) -> np.ndarray:
        """Jacobian (n, 6, k) of ``pose`` in the joints."""
        moments = self._moments(at)
        slopes = self._turn_slopes(moments)
        joint = np.where(self.dh.prismatic, PARAMETERS.index("d_mm"), 0)
        by_joint = slopes[:, :, np.arange(self.joints), joint]
        bent = _dh.joint_jacobian(self.dh, self._bent(at, moments))
        return bent + bent @ by_joint

    def parameter_jacobian(self, at: JointState) -> np.ndarray:
        """Jacobian (n, 6, P) of ``pose`` in the parameters."""
        moments = self._moments(at)
        q_rad = self._bent(at, moments)
        bent = _dh.joint_jacobian(self.dh, q_rad)
        of_dh = _dh.parameter_jacobian(self.dh, q_rad).reshape(len(at), 6, -1)
        of_dh = of_dh + bent @ self._turn_slopes(moments).reshape(len(at), self.joints, -1)
        own = [
            bent[:, :, joint] * moments[kind].values[:, None, joint]
            for joint, kind in np.argwhere(np.isfinite(self.coefficients))
        ]
        return np.concatenate([of_dh, *(each[:, :, None] for each in own)], axis=2)

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """The table ``compliance_model``: ``std`` (P,), NaN where undetermined."""
        split = len(self.dh.parameter_names)
        own_std = np.full(self.coefficients.shape, np.nan)
        own_std[np.isfinite(self.coefficients)] = std[split:]
        columns = self.dh.to_columns(std[:split])
        for kind, name in enumerate(COEFFICIENTS):
            columns |= {name: self.coefficients[:, kind], f"std_{name}": own_std[:, kind]}
        columns |= {name: self.links[:, i] for i, name in enumerate(_LINK)}
        stated = zip((*_GRAVITY, *PAYLOAD_COLUMNS), (*self.gravity, *self.payload), strict=True)
        return columns | {name: np.full(self.joints, value) for name, value in stated}

    @classmethod
    def from_columns(
        cls, columns: Mapping[str, np.ndarray], prismatic: np.ndarray | None = None
    ) -> Self:
        """The model of a ``compliance_model`` table; ``prismatic`` (k,) is the robot's to say."""
        order = np.argsort(columns["joint"], kind="stable")

        def of(names: tuple[str, ...]) -> np.ndarray:
            return np.stack([np.asarray(columns[name], float)[order] for name in names], axis=1)

        coefficients = of(COEFFICIENTS)
        return cls(
            DHModel.from_columns(columns, prismatic),
            coefficients[:, 0],
            coefficients[:, 1],
            of(_GRAVITY)[0],
            of(_LINK),
            of(PAYLOAD_COLUMNS)[0],
        )

    def _bent(self, at: JointState, moments: Sequence[_Moments]) -> np.ndarray:
        """Joints (n, k) with the angles by which they give way."""
        values = np.stack([each.values for each in moments], axis=2)
        return at.q_rad + np.sum(values * np.nan_to_num(self.coefficients), axis=2)

    def _moments(self, at: JointState) -> tuple[_Moments, _Moments]:
        """Moments (N m) of known masses, and levers (mm) of a unit weight at the last origin."""
        frames = _dh.chain(self.dh, at.q_rad)
        own = np.broadcast_to(self.payload, (len(at), 4))
        payload = own if at.payload is None else np.where(np.isnan(at.payload), own, at.payload)
        count = len(at), self.joints
        mass = np.array(np.broadcast_to(np.nan_to_num(self.links[:, 0]), count))
        centre = np.nan_to_num(self.links[:, 1:])
        place = frames.position_mm[:, 1:] + (frames.rotation[:, 1:] @ centre[..., None])[..., 0]
        load = frames.rotation[:, -1] @ payload[:, 1:, None]
        load = frames.position_mm[:, -1] + load[..., 0]
        weighted = mass[..., None] * place
        weighted[:, -1] += payload[:, :1] * load
        mass[:, -1] += payload[:, 0]
        unit = np.zeros(count)
        unit[:, -1] = 1.0
        at_end = unit[..., None] * frames.position_mm[:, 1:]
        return (
            _Moments.of(self, frames, _NM_PER_KG_MM * mass, _NM_PER_KG_MM * weighted),
            _Moments.of(self, frames, unit, at_end),
        )

    def _turn_slopes(self, moments: Sequence[_Moments]) -> np.ndarray:
        """Derivatives (n, k, k, 5) of the angles of each joint in the DH parameters."""
        known = np.nan_to_num(self.coefficients)
        count = len(moments[0].values)
        total = np.zeros((count, self.joints, self.joints, len(PARAMETERS)))
        for kind, each in enumerate(moments):
            if known[:, kind].any():
                total += each.slopes() * known[:, kind, None, None]
        return total


def to_vector(model: ComplianceModel) -> np.ndarray:
    """Parameters (P,): of the DH arm, then joint by joint the coefficients there are."""
    own = model.coefficients
    return np.concatenate([_dh.to_vector(model.dh), own[np.isfinite(own)]])


def with_vector(model: ComplianceModel, vector: np.ndarray) -> ComplianceModel:
    """The model with the parameters of ``vector`` (P,), ordered as ``to_vector``."""
    own, split = model.coefficients, len(model.dh.parameter_names)
    own[np.isfinite(own)] = vector[split:]
    return replace(
        model,
        dh=_dh.with_vector(model.dh, vector[:split]),
        compliance_rad_per_nm=own[:, 0],
        lever_coefficient_rad_per_mm=own[:, 1],
    )


class _Moments(NamedTuple):
    """Moments of weights about every joint, and what their slopes are made of.

    ``weight`` (n, k) beyond each joint and its first moment ``weighted`` (n, k, 3); ``axis`` (n, k,
    3) of the joints; ``arm`` (n, k, 3) axis x lever x weight, of which ``values`` (n, k) are the
    part along gravity; ``frames`` of the whole chain.
    """

    model: ComplianceModel
    frames: Pose
    weight: np.ndarray
    weighted: np.ndarray
    axis: np.ndarray
    arm: np.ndarray
    values: np.ndarray

    @classmethod
    def of(
        cls, model: ComplianceModel, frames: Pose, weight: np.ndarray, weighted: np.ndarray
    ) -> _Moments:
        """Of weights (n, k) of links and their first moments (n, k, 3)."""
        weight = np.cumsum(weight[:, ::-1], axis=1)[:, ::-1]
        weighted = np.cumsum(weighted[:, ::-1], axis=1)[:, ::-1]
        axis, origin = frames.rotation[:, :-1, :, 2], frames.position_mm[:, :-1]
        arm = np.cross(axis, weighted - weight[..., None] * origin)
        return cls(model, frames, weight, weighted, axis, arm, arm @ model.gravity)

    def slopes(self) -> np.ndarray:
        """Derivatives (n, k, k, 5) of the moments in the DH parameters of every joint."""
        gravity = self.model.gravity
        axes, origins = _motions(self.model.dh, self.frames)
        # A motion before the joint's axis turns axis and weights alike: a x (z x r) . g.
        whole = np.einsum("nji,nlpi->njlp", np.cross(self.arm, gravity), axes) * _TURNS
        # One behind it moves the weights it carries: z x (a x (p - o)) . g, or z x a . g.
        reach = self.weighted[:, :, None] - self.weight[:, :, None, None] * origins
        moved = np.where(
            _TURNS[:, None], np.cross(axes, reach), self.weight[:, :, None, None] * axes
        )
        behind = np.einsum("nji,nlpi->njlp", np.cross(gravity, self.axis), moved)
        joint = np.arange(self.model.joints)
        return np.where((joint >= joint[:, None])[..., None], behind, whole)


def _motions(dh: DHModel, frames: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Axes and origins (n, k, 5, 3) along or about which each DH parameter moves what follows."""
    before, behind = frames.rotation[:, :-1], frames.rotation[:, 1:]
    sine, cosine = np.sin(dh.beta_rad)[:, None], np.cos(dh.beta_rad)[:, None]
    across = cosine * behind[..., 0] + sine * behind[..., 2]  # x, before the Hayati turn
    z, y = before[..., 2], behind[..., 1]
    start, end = frames.position_mm[:, :-1], frames.position_mm[:, 1:]
    axes = np.stack([z, z, across, across, y], axis=2)
    return axes, np.stack([start, start, start, end, end], axis=2)
