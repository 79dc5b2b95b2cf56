"""Closed-form inverse of six-axis arms whose axes 2, 3 and 4 are parallel (UR and its kin).

Axis 1 is at right angles to them, axes 4, 5 and 6 at right angles to their neighbours, axes 5 and 6
meet. Joint 1 follows from the point where they meet, which keeps its distance from the plane the
arm moves in; joint 5 from how the last axis stands to that plane; joint 6 from the rest of the
rotation; joints 2 to 4 from a triangle. Branches are named as those of ``closed_form``: the point
where axes 5 and 6 meet takes the place of the wrist centre for the shoulder, axis 4 for the elbow;
the wrist is aligned where axis 6 is parallel to axis 4.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from kinacc.geometry import Pose, rotation_x, rotation_y
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse.closed_form import Start, branch_indices

_ALIGNED = 1e-12
_NEARLY_ALIGNED_RAD = 0.05
_DIRECTIONS = 2.0 * np.pi * np.arange(8) / 8.0


@dataclass(frozen=True)
class ParallelAxesArm:
    """Constants of the closed form, all read from the DH table by ``recognise``.

    ``sign_1``, ``sign_4``, ``sign_5``: sines of those twists (+-1); ``sign_2``, ``sign_3``: cosines
    of twists 2 and 3; ``sideways_mm``: distance of the meeting point of axes 5 and 6 from axis 1
    along axis 2; ``flange`` and ``meeting_in_flange_mm``: what follows joint 6.
    """

    theta_offset_rad: np.ndarray  # (6,)
    d_mm: np.ndarray  # (6,)
    a_mm: np.ndarray  # (6,)
    sideways_mm: float
    sign_1: float
    sign_2: float
    sign_3: float
    sign_4: float
    sign_5: float
    flange: np.ndarray  # (3, 3)
    meeting_in_flange_mm: np.ndarray  # (3,)


def missing_properties(dh: DHModel, tolerance: float = 1e-9) -> list[str]:
    """What keeps ``dh`` from this closed form, in words; empty when it applies."""
    if dh.joints != 6:
        return [f"it has {dh.joints} joints, the closed form needs 6"]
    found = [f"joint {joint + 1} slides" for joint in np.flatnonzero(dh.prismatic)]
    for joint in (1, 4, 5):
        if abs(np.cos(dh.alpha_rad[joint - 1])) > tolerance:
            angle = np.rad2deg(dh.alpha_rad[joint - 1])
            found.append(f"alpha of joint {joint} is {angle:.6g} deg, not +-90")
    for joint in (2, 3):
        if abs(np.sin(dh.alpha_rad[joint - 1])) > tolerance:
            found.append(f"axes {joint} and {joint + 1} are not parallel")
        if abs(dh.a_mm[joint - 1]) <= tolerance:
            found.append(f"axes {joint} and {joint + 1} coincide")
    if abs(dh.a_mm[4]) > tolerance:
        found.append(f"axes 5 and 6 do not meet: a of joint 5 is {dh.a_mm[4]:.6g} mm")
    if np.any(np.abs(dh.beta_rad[:5]) > tolerance):
        found.append("a joint before the last has a Hayati beta")
    return found


def recognise(dh: DHModel, tolerance: float = 1e-9) -> ParallelAxesArm | None:
    """Constants of the closed form of ``dh``, or None where it does not apply."""
    if missing_properties(dh, tolerance):
        return None
    sines, cosines = np.sign(np.sin(dh.alpha_rad)), np.sign(np.cos(dh.alpha_rad))
    flange = rotation_x(dh.alpha_rad[5]) @ rotation_y(dh.beta_rad[5])
    along = dh.d_mm[1] + cosines[1] * (dh.d_mm[2] + cosines[2] * dh.d_mm[3])
    return ParallelAxesArm(
        theta_offset_rad=dh.theta_offset_rad,
        d_mm=dh.d_mm,
        a_mm=dh.a_mm,
        sideways_mm=float(along),
        sign_1=float(sines[0]),
        sign_2=float(cosines[1]),
        sign_3=float(cosines[2]),
        sign_4=float(sines[3]),
        sign_5=float(sines[4]),
        flange=flange,
        meeting_in_flange_mm=-flange.T @ np.array([dh.a_mm[5], 0.0, dh.d_mm[5]]),
    )


def solve(
    arm: ParallelAxesArm,
    pose: Pose,
    branches: tuple[str, ...] | None = None,
    start: Start | None = None,
    turn_6_rad: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """DH joint angles (n, b, 6) in (-pi, pi] of flange poses (n, ...), and reached (n, b).

    As ``closed_form.solve``. ``turn_6_rad`` turns joint 6 away from its solution, and joints 2 to
    4 with it so that they hold the meeting point: for starts where the wrist is nearly aligned.
    """
    start = start or Start(0.0, 0.0, 0.0)
    wanted = branch_indices(branches)
    rotation = pose.rotation @ arm.flange.T
    point = pose.position_mm + pose.rotation @ arm.meeting_in_flange_mm
    q_rad = np.empty((len(point), len(wanted), 6))
    reached = np.empty((len(point), len(wanted)), dtype=bool)
    for shoulder in range(2):
        for flip in range(2):
            columns = np.flatnonzero((wanted // 4 == shoulder) & (wanted % 2 == flip))
            if len(columns) == 0:
                continue
            theta_1, near = _first_joint(arm, point, shoulder, start)
            theta_5, theta_6, fourth = _wrist(arm, rotation, theta_1, flip, start, turn_6_rad)
            for column in columns:
                up = (wanted[column] // 2 % 2 == 0) == (shoulder == 0)
                middle, within = _triangle(arm, point, theta_1, fourth, up, start)
                theta = np.stack([theta_1, *middle, theta_5, theta_6], axis=1)
                q_rad[:, column] = _one_turn(theta - arm.theta_offset_rad)
                reached[:, column] = near & within
    return q_rad, reached


def starts(
    arm: ParallelAxesArm, pose: Pose, branches: tuple[str, ...]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Second starts: joints (n, b, 6) and where to try them (n, b); the exact ones come first."""
    yield solve(arm, pose, branches)
    bent = Start(least_bend_rad=0.005)
    for angle in _DIRECTIONS:
        joints, reached = solve(arm, pose, branches, bent, angle)
        theta_5 = joints[..., 4] + arm.theta_offset_rad[4]
        yield joints, reached & (np.abs(np.sin(theta_5)) < _NEARLY_ALIGNED_RAD)


def _first_joint(
    arm: ParallelAxesArm, point: np.ndarray, shoulder: int, start: Start
) -> tuple[np.ndarray, np.ndarray]:
    x, y = point[:, 0], point[:, 1]
    side = -arm.sign_1 * arm.sideways_mm
    distance_sq = x * x + y * y
    near = distance_sq >= max(abs(side) - start.reach_margin_mm, 0.0) ** 2 * (1.0 - 1e-12)
    forward = np.sqrt(np.maximum(distance_sq - side * side, start.least_radius_mm**2))
    if shoulder == 1:
        forward = -forward
    return np.arctan2(y * forward - x * side, x * forward + y * side), near


def _wrist(
    arm: ParallelAxesArm,
    rotation: np.ndarray,
    theta_1: np.ndarray,
    flip: int,
    start: Start,
    turn_6_rad: float,
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Angles 5 and 6, and the x and z axes (n, 3) of the frame behind joint 4."""
    parallel = arm.sign_2 * arm.sign_3
    axis_4 = _second_axis(arm, theta_1) * parallel
    seen = np.einsum("nji,nj->ni", rotation, axis_4)
    cosine_5 = -arm.sign_4 * arm.sign_5 * seen[:, 2]
    sine_5 = np.hypot(seen[:, 0], seen[:, 1])
    side = 1.0 if np.cos(arm.theta_offset_rad[4]) >= 0.0 else -1.0
    sign = -side if flip else side
    free = sine_5 < _ALIGNED
    theta_6 = np.where(
        free,
        arm.theta_offset_rad[5],
        np.arctan2(-arm.sign_4 * sign * seen[:, 1], arm.sign_4 * sign * seen[:, 0]),
    )
    theta_6 = theta_6 + turn_6_rad
    if start.least_bend_rad > 0.0:
        sine_5 = np.maximum(sine_5, np.sin(start.least_bend_rad))
    theta_5 = np.arctan2(sign * sine_5, cosine_5)
    # The frame behind joint 4 from the one on axis 6, turned back by joints 6 and 5.
    c6, s6 = np.cos(theta_6)[:, None], np.sin(theta_6)[:, None]
    x_5 = c6 * rotation[..., 0] - s6 * rotation[..., 1]
    y_5 = s6 * rotation[..., 0] + c6 * rotation[..., 1]
    y_5, z_5 = -arm.sign_5 * rotation[..., 2], arm.sign_5 * y_5
    c5, s5 = np.cos(theta_5)[:, None], np.sin(theta_5)[:, None]
    return theta_5, theta_6, (c5 * x_5 - s5 * y_5, z_5)


def _triangle(
    arm: ParallelAxesArm,
    point: np.ndarray,
    theta_1: np.ndarray,
    fourth: tuple[np.ndarray, np.ndarray],
    up: bool,
    start: Start,
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """Angles 2, 3 and 4, and whether axis 4 can be reached."""
    ahead = np.stack([np.cos(theta_1), np.sin(theta_1), np.zeros_like(theta_1)], axis=1)
    x_4, z_4 = fourth
    foot = point - arm.d_mm[4] * z_4 - arm.a_mm[3] * x_4
    u = np.einsum("ni,ni->n", foot, ahead) - arm.a_mm[0]
    v = arm.sign_1 * (foot[:, 2] - arm.d_mm[0])
    first, second = arm.a_mm[1], arm.a_mm[2]
    distance_sq = u * u + v * v
    longest, shortest = abs(first) + abs(second), abs(abs(first) - abs(second))
    within = distance_sq <= (longest + start.reach_margin_mm) ** 2 * (1.0 + 1e-14)
    within &= distance_sq >= max(shortest - start.reach_margin_mm, 0.0) ** 2 * (1.0 - 1e-14)
    inside_sq = np.clip(distance_sq, shortest**2, longest**2)
    cosine = (inside_sq - (first * first + second * second)) / (2.0 * first * second)
    # (1 - c)(1 + c) keeps its digits for the stretched and the folded arm, 1 - c^2 does not.
    sine = np.sqrt((longest**2 - inside_sq) * (inside_sq - shortest**2))
    sine /= 2.0 * abs(first * second)
    if start.least_bend_rad > 0.0:
        straight = sine < np.sin(start.least_bend_rad)
        sine = np.where(straight, np.sin(start.least_bend_rad), sine)
        cosine = np.where(straight, np.copysign(np.cos(start.least_bend_rad), cosine), cosine)
    sine *= -arm.sign_1 * np.sign(first * second) * (1.0 if up else -1.0)
    bend = np.arctan2(sine, cosine)
    theta_2 = np.arctan2(v, u) - np.arctan2(second * sine, first + second * cosine)
    heading = np.arctan2(arm.sign_1 * x_4[:, 2], np.einsum("ni,ni->n", x_4, ahead))
    theta_4 = arm.sign_2 * arm.sign_3 * (heading - theta_2 - bend)
    return (theta_2, arm.sign_2 * bend, theta_4), within


def _second_axis(arm: ParallelAxesArm, theta_1: np.ndarray) -> np.ndarray:
    """Direction (n, 3) of axis 2."""
    zero = np.zeros_like(theta_1)
    return arm.sign_1 * np.stack([np.sin(theta_1), -np.cos(theta_1), zero], axis=1)


def _one_turn(angle_rad: np.ndarray) -> np.ndarray:
    return angle_rad - 2.0 * np.pi * np.rint(angle_rad / (2.0 * np.pi))
