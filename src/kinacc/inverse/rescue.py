"""Second starts for branches the first refinement missed.

Two cases: the first start was bent away from a singular posture the model does have, or the wrist
centre is so close to axis 1 that the nominal arm faces the wrong way altogether. For the second the
pose is moved aside in all directions, and the arm starts facing each.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinacc.geometry import Pose
from kinacc.inverse import closed_form
from kinacc.inverse.closed_form import SphericalWristArm

NEAR_AXIS_MM = 25.0

_ASIDE_MM = 15.0
_DIRECTIONS = 8


def starts(
    arm: SphericalWristArm, pose: Pose, branches: tuple[str, ...]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Start after start: joints (n, b, 6) and where to try them (n, b)."""
    exact, reached = closed_form.solve(arm, pose, branches)
    yield exact, reached
    centre = pose.position_mm + pose.rotation @ arm.wrist_in_flange_mm
    near = np.hypot(centre[:, 0], centre[:, 1]) < NEAR_AXIS_MM
    if not near.any():
        return
    for angle in 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS:
        aside = _ASIDE_MM * np.array([np.cos(angle), np.sin(angle), 0.0]) - centre * [1, 1, 0]
        joints, reached = closed_form.solve(
            arm, Pose(pose.rotation, pose.position_mm + aside), branches
        )
        yield joints, reached & near[:, None]
