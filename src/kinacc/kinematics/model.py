"""What an error model is asked, and what it offers: all that code outside its own files needs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Protocol, Self

import numpy as np

from kinacc.geometry import Pose

if TYPE_CHECKING:
    from kinacc.kinematics.dh import DHModel

# A state's payload, as tables name it.
PAYLOAD_COLUMNS = ("payload_kg", "payload_x_mm", "payload_y_mm", "payload_z_mm")


@dataclass(frozen=True)
class JointState:
    """How an arm of k joints stands, n times: all that its pose can depend on.

    ``q_rad`` (n, k): DH joints, in mm where a joint slides. ``s`` (n, k): directions they travelled
    in (-1, +1), 0 where unknown; None: all unknown. ``payload`` (n, 4): what the last DH frame
    carries, mass in kg and centre in that frame in mm; NaN, or None for all: as the model states.
    """

    q_rad: np.ndarray
    s: np.ndarray | None = None
    payload: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.q_rad)

    def select(self, rows: np.ndarray | slice) -> JointState:
        """The states of ``rows`` (mask, indices or slice)."""
        return JointState(
            self.q_rad[rows],
            None if self.s is None else self.s[rows],
            None if self.payload is None else self.payload[rows],
        )

    def moved(self, q_rad: np.ndarray) -> JointState:
        """These directions and payloads at joints (n, k); those of one state at all of them."""
        count = len(q_rad)
        return JointState(
            q_rad,
            None if self.s is None else np.broadcast_to(self.s, q_rad.shape),
            None if self.payload is None else np.broadcast_to(self.payload, (count, 4)),
        )


class ErrorModel(Protocol):
    """An arm of k joints, as its maker states it or as it was fitted.

    Poses are of the last DH frame in the first one.
    """

    kind: ClassVar[str]  # names its tables: ``<kind>_model``, ``<kind>_covariance``

    @property
    def joints(self) -> int:
        """Number of joints k."""

    @property
    def dh(self) -> DHModel:
        """The DH arm the errors act on, from which inverse kinematics starts."""

    @property
    def table(self) -> DHModel | None:
        """The model as a table of DH parameters, None where no such table says the same."""

    @property
    def domain(self) -> tuple[np.ndarray, np.ndarray] | None:
        """DH joints (k,), (k,) beyond which the model says nothing; None: it may extrapolate."""

    @property
    def knows_loads(self) -> bool:
        """Whether poses depend on the payload of a state."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names (P,) in the order of ``parameter_jacobian``: j1.d_mm, j1.delta_x.0 and the like."""

    @property
    def comparable(self) -> np.ndarray | None:
        """Values (P,) by ``parameter_names`` that two fits may be compared by, if there are."""

    def pose(self, at: JointState) -> Pose:
        """Poses (n, ...)."""

    def joint_jacobian(self, at: JointState) -> np.ndarray:
        """Jacobian (n, 6, k) of ``pose``, position (mm) and small turn (rad), in the joints."""

    def parameter_jacobian(self, at: JointState) -> np.ndarray:
        """Jacobian (n, 6, P) of ``pose`` in the parameters, rows as in ``joint_jacobian``."""

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """The table ``<kind>_model``; ``std`` (P,), NaN where undetermined."""

    @classmethod
    def from_columns(
        cls, columns: Mapping[str, np.ndarray], prismatic: np.ndarray | None = None
    ) -> Self:
        """The model of such a table; ``prismatic`` (k,): joints that slide, the robot's to say."""
