"""What an error model offers: all that code outside the models' own files asks of one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar, Protocol, Self

import numpy as np

from kinacc.geometry import Pose

if TYPE_CHECKING:
    from kinacc.kinematics.dh import DHModel


class ErrorModel(Protocol):
    """An arm of k joints, as its maker states it or as it was fitted.

    Methods take DH joints ``q_rad`` (n, k), in mm where a joint slides, and travel directions ``s``
    (n, k), unknown where not given. Poses are of the last DH frame in the first one.
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
    def parameter_names(self) -> tuple[str, ...]:
        """Names (P,) in the order of ``parameter_jacobian``: j1.d_mm, j1.delta_x.0 and the like."""

    def pose(self, q_rad: np.ndarray, s: np.ndarray | None = None) -> Pose:
        """Poses (n, ...)."""

    def joint_jacobian(self, q_rad: np.ndarray, s: np.ndarray | None = None) -> np.ndarray:
        """Jacobian (n, 6, k) of ``pose``, position (mm) and small turn (rad), in the joints."""

    def parameter_jacobian(self, q_rad: np.ndarray, s: np.ndarray | None = None) -> np.ndarray:
        """Jacobian (n, 6, P) of ``pose`` in the parameters, rows as in ``joint_jacobian``."""

    def to_columns(self, std: np.ndarray) -> dict[str, np.ndarray]:
        """The table ``<kind>_model``; ``std`` (P,), NaN where undetermined."""

    @classmethod
    def from_columns(
        cls, columns: Mapping[str, np.ndarray], prismatic: np.ndarray | None = None
    ) -> Self:
        """The model of such a table; ``prismatic`` (k,): joints that slide, the robot's to say."""
