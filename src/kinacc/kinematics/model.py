"""What an error model is asked, and what it offers: all that code outside its own files needs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from kinacc.geometry import Pose, log_so3

if TYPE_CHECKING:
    from kinacc.kinematics.dh import DHModel

_STEPS, _COEFFICIENT_STEP = {"rad": 1e-6, "mm": 1e-4}, 1e-9  # of central differences
# A state's payload, as tables name it.
PAYLOAD_COLUMNS = ("payload_kg", "payload_x_mm", "payload_y_mm", "payload_z_mm")


@dataclass(frozen=True)
class JointState:
    """States of an arm of k joints: all that its pose can depend on.

    Attributes
    ----------
    q_rad : numpy.ndarray
        DH joints, shape (n, k), rad (mm where a joint slides).
    s : numpy.ndarray or None
        Travel directions of the joints (-1, +1; 0: unknown), shape (n, k). None: all unknown.
    payload : numpy.ndarray or None
        Load on the last DH frame: mass in kg and centre in that frame in mm, shape (n, 4). NaN, or
        None for all: as the model states.
    """

    q_rad: np.ndarray
    s: np.ndarray | None = None
    payload: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.q_rad)

    def select(self, rows: np.ndarray | slice) -> JointState:
        """Select states.

        Parameters
        ----------
        rows : numpy.ndarray or slice
            Mask (n,), indices (m,) or slice.

        Returns
        -------
        JointState
            The m states.
        """
        return JointState(
            self.q_rad[rows],
            None if self.s is None else self.s[rows],
            None if self.payload is None else self.payload[rows],
        )

    def moved(self, q_rad: np.ndarray) -> JointState:
        """These travel directions and payloads at other joints.

        Parameters
        ----------
        q_rad : numpy.ndarray
            DH joints, shape (m, k), rad and mm; m = n, or any m for a single state.

        Returns
        -------
        JointState
            The m states.
        """
        return JointState(
            q_rad,
            None if self.s is None else np.broadcast_to(self.s, q_rad.shape),
            None if self.payload is None else np.broadcast_to(self.payload, (len(q_rad), 4)),
        )


class ErrorModel:
    """An arm of k joints with P parameters, as its maker states it or as it was fitted.

    A model of one's own is a frozen dataclass that inherits this class and states ``kind``, ``dh``,
    ``names``, ``units``, ``start``, ``prior_std``, ``with_parameters`` and ``pose``; the Jacobians
    here are by central differences. Poses are of the last DH frame in the first one. Rows of a
    Jacobian: position (mm), then the rotation vector w (rad) with R(x + dx) = exp(w) R(x).
    """

    kind: ClassVar[str]  # names its tables: ``<kind>_model``, ``<kind>_covariance``

    if TYPE_CHECKING:  # fields or properties of the model itself

        @property
        def dh(self) -> DHModel:
            """The DH arm the errors act on, from which inverse kinematics starts."""

        @property
        def names(self) -> tuple[str, ...]:
            """Names (P,) of the parameters: j1.d_mm, j1.delta_x.0 and the like."""

        @property
        def units(self) -> tuple[str, ...]:
            """Units (P,) of the parameters: mm, rad and the like."""

        @property
        def start(self) -> np.ndarray:
            """Parameters (P,) of this model, where a fit starts."""

        @property
        def prior_std(self) -> np.ndarray:
            """Usual size (P,) of the parameters' errors, in ``units``; inf: nothing is known."""

    def with_parameters(self, x: np.ndarray) -> Self:
        """Return the model with other parameters.

        Parameters
        ----------
        x : numpy.ndarray
            Parameters, shape (P,), ordered as ``names``, in ``units``.

        Returns
        -------
        ErrorModel
            A model of the same kind.
        """
        raise NotImplementedError

    def pose(self, state: JointState) -> Pose:
        """Compute poses of the last DH frame in the first one.

        Parameters
        ----------
        state : JointState
            n states.

        Returns
        -------
        Pose
            Poses (n, ...), mm.
        """
        raise NotImplementedError

    def motions(self, state: JointState) -> tuple[Pose, np.ndarray, np.ndarray, np.ndarray | None]:
        """Compute poses and how the parameters move the flange.

        Parameters
        ----------
        state : JointState
            n states.

        Returns
        -------
        pose : Pose
            Poses (n, ...).
        motions : numpy.ndarray
            E motions, shape (E, 6, n): mm and rad per unit, robot base.
        of : numpy.ndarray
            Index of the motion each parameter makes, shape (P,).
        factors : numpy.ndarray or None
            Factor of that motion, shape (P, n); None: one.
        """
        step = np.array([_STEPS.get(unit, _COEFFICIENT_STEP) for unit in self.units])
        moved = _differences(lambda x: self.with_parameters(x).pose(state), self.start, step)
        return self.pose(state), moved.transpose(2, 1, 0), np.arange(step.size), None

    def linearised(self, state: JointState) -> tuple[Pose, np.ndarray]:
        """Compute poses and their Jacobian in the parameters.

        Parameters
        ----------
        state : JointState
            n states.

        Returns
        -------
        pose : Pose
            Poses (n, ...), mm.
        jacobian : numpy.ndarray
            Shape (n, 6, P): mm and rad per unit of the parameter, in the robot base.
        """
        pose, motions, of, factors = self.motions(state)
        slopes = motions[of] if factors is None else motions[of] * factors[:, None]
        return pose, np.ascontiguousarray(slopes.transpose(2, 1, 0))

    def joint_jacobian(self, state: JointState) -> np.ndarray:
        """Compute the Jacobian of ``pose`` in the joints.

        Parameters
        ----------
        state : JointState
            n states.

        Returns
        -------
        numpy.ndarray
            Shape (n, 6, k): mm and rad per rad (per mm where a joint slides), in the robot base.
        """
        step = np.where(self.dh.prismatic, 1e-3, 1e-6)
        return _differences(
            lambda x: self.pose(state.moved(state.q_rad + x)), np.zeros(step.size), step
        )

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.dh.joints

    @property
    def table(self) -> DHModel | None:
        """The model as a table of DH parameters, None where no such table says the same."""
        return None

    @property
    def domain(self) -> tuple[np.ndarray, np.ndarray] | None:
        """DH joints (k,), (k,) beyond which the model says nothing; None: it may extrapolate."""
        return None

    @property
    def knows_loads(self) -> bool:
        """Whether poses depend on the payload of a state."""
        return False

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """Write the table ``<kind>_model``.

        Parameters
        ----------
        std : numpy.ndarray
            Standard deviations of the parameters, shape (P,), in ``units``; NaN where undetermined.

        Returns
        -------
        dict of numpy.ndarray
            Columns by name; of a model of one's own ``parameter``, ``value``, ``std``, ``unit``.
        """
        names, units = (np.array(texts, dtype=object) for texts in (self.names, self.units))
        return {"parameter": names, "value": self.start, "std": std, "unit": units}

    @classmethod
    def from_columns(cls, columns: Mapping[str, np.ndarray], nominal: DHModel) -> Self:
        """Read the model of a table that ``to_columns`` wrote.

        Parameters
        ----------
        columns : mapping of numpy.ndarray
            Columns by name.
        nominal : DHModel
            The nominal arm, which states the joints that slide.

        Returns
        -------
        ErrorModel
            The model.

        Raises
        ------
        LookupError, TypeError, ValueError
            For a table that lacks columns or rows.
        """
        start = cls(nominal)  # type: ignore[call-arg]  # a dataclass of one's own
        return start.with_parameters(np.asarray(columns["value"], dtype=float))


def _differences(pose: Callable[[np.ndarray], Pose], x: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Jacobian (n, 6, P) of poses (n, ...) in ``x`` (P,) by central differences."""
    columns = []
    for shift in np.diag(step):
        ahead, behind = pose(x + shift), pose(x - shift)
        turn = log_so3(ahead.rotation @ np.swapaxes(behind.rotation, 1, 2))
        moved = np.concatenate([ahead.position_mm - behind.position_mm, turn], axis=1)
        columns.append(moved / (2.0 * shift.max()))
    return np.stack(columns, axis=2)
