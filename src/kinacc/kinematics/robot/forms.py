"""Other forms of a kinematic chain turned into the standard one, exactly.

The chain of this package is ``Rz(q + theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)`` per joint.
"""

from __future__ import annotations

import numpy as np

from kinacc.geometry import Pose, rotation_x, rotation_y
from kinacc.kinematics.dh import DHModel


def from_modified(table: DHModel) -> tuple[DHModel, Pose]:
    """Standard chain and base of a modified (Craig) table.

    Row i of ``table`` reads ``Tx(a) Rx(alpha) Ry(beta) Rz(q + theta) Tz(d)``: a, alpha and beta lie
    before the joint. Regrouping the same product hands them to the row above; those of the first
    row become the base (first DH frame in the arm's base frame), those of the last row vanish.
    """

    def handed_up(column: np.ndarray) -> np.ndarray:
        return np.append(column[1:], 0.0)

    first = rotation_x(table.alpha_rad[0]) @ rotation_y(table.beta_rad[0])
    chain = DHModel(
        table.theta_offset_rad,
        table.d_mm,
        handed_up(table.a_mm),
        handed_up(table.alpha_rad),
        handed_up(table.beta_rad),
        table.prismatic,
    )
    return chain, Pose(first, np.array([table.a_mm[0], 0.0, 0.0]))
