"""Second starts for branches the first refinement missed or found twice.

Three cases: the first start was bent away from a singular posture the model does have; the wrist
centre is so close to axis 1 that the nominal arm faces the wrong way altogether; axes 4 and 6 are
so nearly aligned that the nominal joint 4 says nothing about the model's. In the second the pose is
moved aside in all directions and the arm starts facing each, in the third joints 4 and 6 are turned
against each other.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kinacc.geometry import Pose
from kinacc.kinematics.inverse import closed_form
from kinacc.kinematics.inverse.closed_form import SphericalWristArm

_NEAR_AXIS_MM, _ASIDE_MM = 25.0, 15.0
_NEARLY_ALIGNED_RAD, _LEAST_BEND_RAD = 0.03, 0.005
_DIRECTIONS = 2.0 * np.pi * np.arange(8) / 8.0


def starts(
    arm: SphericalWristArm, pose: Pose, branches: tuple[str, ...]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Start after start: joints (n, b, 6) and where to try them (n, b)."""
    exact, reached = closed_form.solve(arm, pose, branches)
    yield exact, reached
    yield from _facing_all_round(arm, pose, branches)
    yield from _turned_wrists(arm, *closed_form.solve(arm, pose, branches, closed_form.Start()))


def _facing_all_round(
    arm: SphericalWristArm, pose: Pose, branches: tuple[str, ...]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    centre = pose.position_mm + pose.rotation @ arm.wrist_in_flange_mm
    near = np.hypot(centre[:, 0], centre[:, 1]) < _NEAR_AXIS_MM
    if not near.any():
        return
    to_axis = centre * [-1.0, -1.0, 0.0]
    for angle in _DIRECTIONS:
        aside = to_axis + _ASIDE_MM * np.array([np.cos(angle), np.sin(angle), 0.0])
        joints, reached = closed_form.solve(
            arm, Pose(pose.rotation, pose.position_mm + aside), branches
        )
        yield joints, reached & near[:, None]


def _turned_wrists(
    arm: SphericalWristArm, start: np.ndarray, reached: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    theta_5 = start[..., 4] + arm.theta_offset_rad[4]
    near = reached & (np.abs(np.sin(theta_5)) < _NEARLY_ALIGNED_RAD)
    if not near.any():
        return
    # Axis 6 points along axis 4 or against it: turning the one is undone by the other.
    along = -arm.sign_4 * arm.sign_5 * np.sign(np.cos(theta_5))
    straight = np.pi * np.rint(theta_5 / np.pi) - arm.theta_offset_rad[4]
    bend = start[..., 4] - straight
    bent = straight + np.copysign(np.maximum(np.abs(bend), _LEAST_BEND_RAD), bend)
    for angle in _DIRECTIONS:
        joints = start.copy()
        joints[..., 3] += angle
        joints[..., 4] = bent
        joints[..., 5] -= along * angle
        yield joints, near
