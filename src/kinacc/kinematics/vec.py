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
import pandas as pd
from numpy.polynomial import chebyshev

from kinacc.geometry import Pose
from kinacc.kinematics import chain as _chain
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.model import ErrorModel, JointState

ERRORS = ("delta_x", "delta_y", "delta_z", "eps_x", "eps_y", "eps_z")
_DIRECTIONS = {-1: "minus", 1: "plus"}


@dataclass(frozen=True)
class VECModel(ErrorModel):
    """Joint-dependent errors of k joints acting on a DH arm (eqs. 5-6).

    Attributes
    ----------
    dh : DHModel
        The arm of k joints.
    q_min_rad, q_max_rad : numpy.ndarray
        Range of the DH joints mapped to [-1, 1], each (k,), rad (mm where a joint slides).
    coefficients : numpy.ndarray
        Chebyshev coefficients of ``ERRORS``, shape (k, 6, order + 1), mm (delta) and rad (eps).
    direction_offsets_rad : numpy.ndarray
        Offsets of eps_z for travel directions s = -1 and s = +1, shape (k, 2).
    """

    dh: DHModel
    q_min_rad: np.ndarray
    q_max_rad: np.ndarray
    coefficients: np.ndarray
    direction_offsets_rad: np.ndarray

    kind: ClassVar[str] = "vec"

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
    def domain(self) -> tuple[np.ndarray, np.ndarray]:
        """The fitted range of the DH joints (k,), (k,): a polynomial says nothing beyond it."""
        return self.q_min_rad, self.q_max_rad

    @property
    def names(self) -> tuple[str, ...]:
        """Names (P,) of the coefficients, then of the direction offsets: j1.delta_x.0, ..."""
        joints, orders = range(1, self.joints + 1), range(self.order + 1)
        coefficients = [f"j{i}.{error}.{n}" for i in joints for error in ERRORS for n in orders]
        offsets = [f"j{i}.eps_z.{direction}" for i in joints for direction in _DIRECTIONS.values()]
        return (*coefficients, *offsets)

    @property
    def units(self) -> tuple[str, ...]:
        """Units (P,): mm of delta, rad of eps."""
        return tuple("mm" if ".delta" in name else "rad" for name in self.names)

    @property
    def start(self) -> np.ndarray:
        """Coefficients (P,): joint, error, order; then the direction offsets: joint, direction."""
        return np.concatenate([self.coefficients.ravel(), self.direction_offsets_rad.ravel()])

    @property
    def prior_std(self) -> np.ndarray:
        """Usual size (P,) of the coefficients: 1 mm and 1 mrad."""
        return np.where(np.array(self.units) == "mm", 1.0, 1e-3)

    def with_parameters(self, x: np.ndarray) -> Self:
        """The model with the coefficients and offsets of (P,), ordered as ``start``."""
        split = self.coefficients.size
        return replace(
            self,
            coefficients=np.reshape(x[:split], self.coefficients.shape),
            direction_offsets_rad=np.reshape(x[split:], self.direction_offsets_rad.shape),
        )

    def pose(self, state: JointState) -> Pose:
        """Poses (n, ...) with the rotation projected to SO(3)."""
        return self.walk(state).pose

    def walk(self, state: JointState) -> _chain.Walk:
        """Walk along the arm: n poses, and how the joints' errors move them (``by_errors``).

        An error is ``sum_n c_n T_n(q)``, that of eps_z with the direction offset beside.
        """
        values = _polynomials(self, state.q_rad, self.coefficients)
        if state.s is not None:
            values[..., 5] += np.sum(direction_basis(state.s) * self.direction_offsets_rad, axis=-1)
        return _chain.Walk(self.dh, state.q_rad, np.ascontiguousarray(values.transpose(1, 2, 0)))

    def joint_jacobian(self, state: JointState) -> np.ndarray:
        """Jacobian (n, 6, k) of ``pose`` in the joints. Exact."""
        moving = self.walk(state)
        slopes = _polynomials(self, state.q_rad, chebyshev.chebder(self.coefficients, axis=-1))
        slopes *= (2.0 / (self.q_max_rad - self.q_min_rad))[:, None]
        moved = np.empty((self.joints, 6, len(state)))
        for joint, (into, by_errors) in enumerate(zip(moved, moving.by_errors(), strict=True)):
            moving.by_joint(joint, into)
            into += np.einsum("ern,ne->rn", by_errors, slopes[:, joint])
        return np.ascontiguousarray(moved.transpose(2, 1, 0))

    def motions(self, state: JointState) -> tuple[Pose, np.ndarray, np.ndarray, np.ndarray]:
        """The joints' errors (6k, 6, n), spread over their Chebyshev polynomials. Exact."""
        moving, (joints, count, terms) = self.walk(state), self.coefficients.shape
        s = np.zeros(state.q_rad.shape) if state.s is None else state.s
        basis = _basis(self, state.q_rad, terms).transpose(1, 2, 0)
        basis = np.repeat(basis, count, axis=0).reshape(-1, len(state))
        travelled = direction_basis(s).transpose(1, 2, 0).reshape(-1, len(state))
        about_z = count * np.arange(joints) + ERRORS.index("eps_z")
        of = np.append(np.repeat(np.arange(joints * count), terms), np.repeat(about_z, 2))
        return (
            moving.pose,
            moving.by_errors().reshape(joints * count, 6, -1),
            of,
            np.append(basis, travelled, axis=0),
        )

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """The table ``vec_model``: coefficients of both directions, then offsets that have a std.

        ``std`` (P,) as ``start``.
        """
        joints, _, terms = self.coefficients.shape
        joint = range(1, joints + 1)
        series = pd.MultiIndex.from_product([joint, ERRORS, [0], range(terms)])
        offsets = pd.MultiIndex.from_product([joint, ["eps_z"], _DIRECTIONS, [0]])
        table = pd.DataFrame({"coefficient": self.start, "std": std}, series.append(offsets))
        table = table.rename_axis(["joint", "error", "direction", "order"]).reset_index()
        table = table[(table["direction"] == 0) | np.isfinite(table["std"])]
        columns, place = {name: table[name].to_numpy() for name in table}, table["joint"] - 1
        columns |= {name: getattr(self, name)[place] for name in ("q_min_rad", "q_max_rad")}
        return columns | {name: getattr(self.dh, name)[place] for name in PARAMETERS}

    @classmethod
    def from_columns(cls, columns: Mapping[str, np.ndarray], nominal: DHModel) -> Self:
        """The model of a ``vec_model`` table; coefficients it does not list are zero.

        The joints that slide are the robot's to say.
        """
        table = pd.DataFrame(dict(columns))
        arm = table.groupby("joint").first()
        shape = len(arm), len(ERRORS), table["order"].max() + 1
        dh = DHModel(**{name: arm[name] for name in PARAMETERS}, prismatic=nominal.prismatic)
        ends = arm["q_min_rad"], arm["q_max_rad"]
        empty = cls(dh, *ends, np.zeros(shape), np.zeros((len(arm), 2)))
        rows = table[["joint", "error", "direction", "order"]].itertuples(index=False)
        names = [f"j{joint}.{error}.{_DIRECTIONS.get(d, n)}" for joint, error, d, n in rows]
        values = table["coefficient"].set_axis(names).reindex(empty.names, fill_value=0.0)
        return empty.with_parameters(values.to_numpy())


def without_errors(
    dh: DHModel, q_min_rad: np.ndarray, q_max_rad: np.ndarray, order: int
) -> VECModel:
    """Model whose errors are all zero: its poses equal those of ``dh``.

    Parameters
    ----------
    dh : DHModel
        Arm of k joints.
    q_min_rad, q_max_rad : numpy.ndarray
        Range of the DH joints, each (k,), rad (mm where a joint slides).
    order : int
        Order of the Chebyshev polynomials.

    Returns
    -------
    VECModel
        The model.
    """
    shape = (dh.joints, len(ERRORS), order + 1)
    return VECModel(dh, q_min_rad, q_max_rad, np.zeros(shape), np.zeros((dh.joints, 2)))


def direction_basis(s: np.ndarray) -> np.ndarray:
    """Indicators of the travel directions -1 and +1.

    Parameters
    ----------
    s : numpy.ndarray
        Travel directions -1, 0, +1, shape (n, k).

    Returns
    -------
    numpy.ndarray
        0 or 1, shape (n, k, 2).
    """
    return (np.asarray(s)[..., None] == [*_DIRECTIONS]).astype(float)


def pose(model: VECModel, q_rad: np.ndarray, s: np.ndarray | None = None) -> Pose:
    """Compute flange poses (eqs. 5-6), the rotation projected to SO(3).

    Parameters
    ----------
    model : VECModel
        Model of k joints.
    q_rad : numpy.ndarray
        DH joints, shape (n, k) or (k,), rad (mm where a joint slides).
    s : numpy.ndarray, optional
        Travel directions -1, 0, +1, shape (n, k); unknown when not given.

    Returns
    -------
    Pose
        Poses (n, ...) of the last DH frame in the first one, mm.
    """
    return model.pose(JointState(np.atleast_2d(np.asarray(q_rad, dtype=float)), s))


def _polynomials(model: VECModel, q_rad: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Values (n, k, 6) at joints (n, k) of the polynomials with ``coefficients`` (k, 6, terms)."""
    basis = _basis(model, q_rad, coefficients.shape[-1])
    return np.einsum("nkt,ket->nke", basis, coefficients)


def _basis(model: VECModel, q_rad: np.ndarray, terms: int) -> np.ndarray:
    """Chebyshev polynomials (n, k, terms) of joints (n, k) mapped from their range to [-1, 1]."""
    span = model.q_max_rad - model.q_min_rad
    mapped = (2.0 * q_rad - model.q_min_rad - model.q_max_rad) / span
    return chebyshev.chebvander(mapped, terms - 1)
