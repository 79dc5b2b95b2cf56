"""Poses beside each other, as tests compare them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.geometry import Pose


def of_matrices(matrices) -> Pose:
    """Poses of matrices (..., 4, 4)."""
    return Pose(np.asarray(matrices)[..., :3, :3], np.asarray(matrices)[..., :3, 3])


def movement(before: Pose, after: Pose) -> np.ndarray:
    """Shifts in mm and rotation vectors in rad (..., 6) from poses to others."""
    turn = Rotation.from_matrix(after.rotation @ np.swapaxes(before.rotation, -1, -2))
    return np.hstack([after.position_mm - before.position_mm, turn.as_rotvec()])


def assert_same(found: Pose, wanted: Pose, mm: float, matrix: float) -> None:
    """Positions are the same within ``mm``, and every number of the rotations within ``matrix``."""
    np.testing.assert_allclose(found.position_mm, wanted.position_mm, rtol=0, atol=mm)
    np.testing.assert_allclose(found.rotation, wanted.rotation, rtol=0, atol=matrix)
