"""DH arm whose joints give way to gravity: small turns, linear in the moments it exerts.

Joint j turns beyond its commanded angle by ``c_j tau_j + b_j lever_j`` about its own DH axis. tau_j
(N m) is the gravity moment of links of known mass and of the payload beyond the joint; lever_j (mm)
that of a unit weight at the last origin, for links of unknown mass: b_j is then the product of
weight and compliance, which cannot be told apart without a change of load. Moments are those of the
arm as commanded: bending does not change the levers, to first order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from kinacc.geometry import Pose, cross
from kinacc.kinematics import chain as _chain
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import PAYLOAD_COLUMNS, ErrorModel, JointState

STANDARD_GRAVITY = 9.80665  # m/s^2
COMPLIANCE, LEVER = "compliance_rad_per_nm", "lever_coefficient_rad_per_mm"
COEFFICIENTS = (COMPLIANCE, LEVER)
_NM_PER_KG_MM = STANDARD_GRAVITY * 1e-3
_LINK = ("link_mass_kg", "link_x_mm", "link_y_mm", "link_z_mm")
_GRAVITY = ("gravity_x", "gravity_y", "gravity_z")


@dataclass(frozen=True)
class ComplianceModel(ErrorModel):
    """Joint compliance of k joints acting on a DH arm; coefficients are NaN where a joint has none.

    Attributes
    ----------
    dh : DHModel
        The arm of k joints.
    coefficients : numpy.ndarray
        As ``COEFFICIENTS``, shape (k, 2): turn per gravity moment of known masses, rad/(N m), and
        per lever of a unit weight at the last origin, rad/mm.
    gravity : numpy.ndarray
        Direction of gravity in the first DH frame, unit length, shape (3,).
    links : numpy.ndarray
        Mass in kg and centre in mm in the DH frame each joint carries, shape (k, 4); NaN: unknown.
    payload : numpy.ndarray
        The same in the last DH frame, shape (4,), for states without a payload of their own.
    """

    dh: DHModel
    coefficients: np.ndarray
    gravity: np.ndarray
    links: np.ndarray
    payload: np.ndarray

    kind: ClassVar[str] = "compliance"

    @property
    def knows_loads(self) -> bool:
        """Whether a compliance was fitted; a lever's coefficient holds for the load measured."""
        return bool(np.isfinite(self.coefficients[:, 0]).any())

    @property
    def names(self) -> tuple[str, ...]:
        """Names (P,): of the DH arm, then j2.compliance_rad_per_nm, .."""
        places = np.argwhere(np.isfinite(self.coefficients))
        coefficients = (f"j{joint + 1}.{COEFFICIENTS[kind]}" for joint, kind in places)
        return (*self.dh.names, *coefficients)

    @property
    def units(self) -> tuple[str, ...]:
        """Units (P,) of the parameters."""
        kinds = np.argwhere(np.isfinite(self.coefficients))[:, 1]
        return (*self.dh.units, *(("rad/Nm", "rad/mm")[kind] for kind in kinds))

    @property
    def start(self) -> np.ndarray:
        """Parameters (P,): of the DH arm, then joint by joint the coefficients there are."""
        return np.append(self.dh.start, self.coefficients[np.isfinite(self.coefficients)])

    @property
    def prior_std(self) -> np.ndarray:
        """Those of the DH arm (P,); nothing is known of coefficients."""
        return np.append(self.dh.prior_std, np.full(len(self.names) - len(self.dh.names), np.inf))

    def with_parameters(self, x: np.ndarray) -> Self:
        """The model with parameters (P,), ordered as ``start``."""
        coefficients, split = self.coefficients.copy(), len(self.dh.names)
        coefficients[np.isfinite(coefficients)] = x[split:]
        return replace(self, dh=self.dh.with_parameters(x[:split]), coefficients=coefficients)

    def pose(self, state: JointState) -> Pose:
        """Poses (n, ...) of the bent arm."""
        turns = np.sum(self.moments(state) * np.nan_to_num(self.coefficients), axis=2)
        return _dh.forward(self.dh, state.q_rad + turns)

    def moments(self, state: JointState) -> np.ndarray:
        """Compute the moments that bend the joints.

        Parameters
        ----------
        state : JointState
            n states.

        Returns
        -------
        numpy.ndarray
            Shape (n, k, 2): gravity moments of known masses, N m, and levers of a unit weight, mm,
            about the axes of the unbent arm.
        """
        walk = _chain.Walk(self.dh, state.q_rad)
        payload = np.full((len(state), 4), np.nan) if state.payload is None else state.payload
        payload = np.where(np.isnan(payload), self.payload, payload)
        links = np.nan_to_num(self.links)
        # Weights and their first moments (3, n) beyond a joint, from the last joint on.
        weight, first = payload[:, 0], payload[:, 0] * _place(walk.end, payload[:, 1:].T)
        moments = np.empty((len(state), self.joints, 2))
        ends = [*walk.before[1:], walk.end]
        for joint in range(self.joints - 1, -1, -1):
            weight = weight + links[joint, 0]
            first = first + links[joint, 0] * _place(ends[joint], links[joint, 1:])
            axis, origin = walk.before[joint].z, walk.before[joint].p_mm
            known = cross(axis, first - weight * origin)
            moments[:, joint, 0] = _NM_PER_KG_MM * (self.gravity @ known)
            moments[:, joint, 1] = self.gravity @ cross(axis, walk.end.p_mm - origin)
        return moments

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """The table ``compliance_model``: ``std`` (P,), NaN where undetermined."""
        split = len(self.dh.names)
        own_std = np.full(self.coefficients.shape, np.nan)
        own_std[np.isfinite(self.coefficients)] = std[split:]
        columns = self.dh.to_columns(std[:split])
        for kind, name in enumerate(COEFFICIENTS):
            columns |= {name: self.coefficients[:, kind], f"std_{name}": own_std[:, kind]}
        columns |= {name: self.links[:, i] for i, name in enumerate(_LINK)}
        stated = zip((*_GRAVITY, *PAYLOAD_COLUMNS), (*self.gravity, *self.payload), strict=True)
        return columns | {name: np.full(self.joints, value) for name, value in stated}

    @classmethod
    def from_columns(cls, columns: Mapping[str, np.ndarray], nominal: DHModel) -> Self:
        """The model of a ``compliance_model`` table; see ``DHModel.from_columns``."""
        order = np.argsort(columns["joint"], kind="stable")

        def of(names: tuple[str, ...]) -> np.ndarray:
            return np.stack([np.asarray(columns[name], float)[order] for name in names], axis=1)

        return cls(
            DHModel.from_columns(columns, nominal),
            of(COEFFICIENTS),
            of(_GRAVITY)[0],
            of(_LINK),
            of(PAYLOAD_COLUMNS)[0],
        )


def _place(frames: _chain.Columns, centre: np.ndarray) -> np.ndarray:
    """Points (3, n) in the robot base, given in the frames as (3,) or (3, n)."""
    return centre[0] * frames.x + centre[1] * frames.y + centre[2] * frames.z + frames.p_mm
