"""Closed-form inverse of seven-axis arms with spherical shoulder and wrist, joint 1 given.

Axes 1 to 3 meet in the shoulder, 3 to 5 in the elbow, 5 to 7 in the wrist, neighbours at right
angles (LBR iiwa and its kin). Joint 4 follows from the distance of the wrist, joints 2 and 3 from
its direction, the wrist joints from what is left of the rotation: two choices each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.geometry import Pose, compose, invert, rotation_x, rotation_y
from kinacc.kinematics.dh import DHModel

BRANCHES = 8

_ALIGNED = 1e-12


@dataclass(frozen=True)
class SphericalShoulderArm:
    """Constants of the closed form: sines (+-1) of twists 1 to 6, and lengths (mm).

    ``flange`` is what follows joint 7.
    """

    theta_offset_rad: np.ndarray  # (7,)
    signs: np.ndarray  # (6,)
    shoulder_mm: float
    upper_arm_mm: float
    forearm_mm: float
    flange: Pose


def recognise(dh: DHModel, tolerance: float = 1e-9) -> SphericalShoulderArm | None:
    """Constants of the closed form of ``dh``, or None where it does not apply."""
    if dh.joints != 7 or dh.prismatic.any():
        return None
    square = np.abs(np.cos(dh.alpha_rad[:6])).max() <= tolerance
    meeting = np.abs(dh.a_mm[:6]).max() <= tolerance
    meeting &= np.abs(dh.d_mm[[1, 3, 5]]).max() <= tolerance
    if not square or not meeting or np.abs(dh.beta_rad[:6]).max() > tolerance:
        return None
    if np.abs(dh.d_mm[[2, 4]]).min() <= tolerance:
        return None
    turn = rotation_x(dh.alpha_rad[6]) @ rotation_y(dh.beta_rad[6])
    return SphericalShoulderArm(
        theta_offset_rad=dh.theta_offset_rad,
        signs=np.sign(np.sin(dh.alpha_rad[:6])),
        shoulder_mm=float(dh.d_mm[0]),
        upper_arm_mm=float(dh.d_mm[2]),
        forearm_mm=float(dh.d_mm[4]),
        flange=Pose(turn, np.array([dh.a_mm[6], 0.0, dh.d_mm[6]])),
    )


def solve(
    arm: SphericalShoulderArm,
    pose: Pose,
    q1_rad: float,
    margin_mm: float = 0.0,
    least_bend_rad: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """DH joints 2 to 7 (n, 8, 6) of flange poses (n, ...) at joint 1, and by how much (mm) the
    wrist is out of reach (n, 8): zero for solutions, infinite beyond ``margin_mm``.

    With ``least_bend_rad`` the arm is kept that far from stretched, folded and aligned postures,
    which a refinement onto a slightly different arm cannot leave.
    """
    wrist = compose(pose, invert(arm.flange))
    s = arm.signs
    theta_1 = q1_rad + arm.theta_offset_rad[0]
    first = _turned(theta_1, s[0])
    w = (wrist.position_mm - [0.0, 0.0, arm.shoulder_mm]) @ first
    upper, fore = arm.upper_arm_mm, arm.forearm_mm
    distance = np.linalg.norm(w, axis=1)
    longest, shortest = abs(upper) + abs(fore), abs(abs(upper) - abs(fore))
    beyond = np.maximum(distance - longest, shortest - distance)
    cosine = (upper**2 + fore**2 - distance**2) / (2.0 * upper * fore * s[2] * s[3])
    straightest = np.cos(least_bend_rad)
    bend = np.arccos(np.clip(cosine, -straightest, straightest))
    found = np.empty((len(distance), BRANCHES, 6))
    missed = np.empty((len(distance), BRANCHES))
    for branch in range(BRANCHES):
        theta_4 = bend if branch // 2 % 2 == 0 else -bend
        x = fore * s[3] * np.sin(theta_4)
        z = upper - fore * s[2] * s[3] * np.cos(theta_4)
        aside = np.abs(w[:, 2]) - np.abs(x)
        sine_3 = np.clip(s[1] * w[:, 2] / np.where(x == 0.0, 1.0, x), -straightest, straightest)
        cosine_3 = np.sqrt(1.0 - sine_3**2) * (1.0 if branch // 4 == 0 else -1.0)
        theta_3 = np.arctan2(sine_3, cosine_3)
        theta_2 = np.arctan2(w[:, 1], w[:, 0]) - np.arctan2(-s[1] * z, x * cosine_3)
        rotation = first @ _turned(theta_2, s[1]) @ _turned(theta_3, s[2]) @ _turned(theta_4, s[3])
        left = np.swapaxes(rotation, 1, 2) @ wrist.rotation
        last = _wrist(left, s, branch % 2, np.sin(least_bend_rad))
        theta = np.stack([theta_2, theta_3, theta_4, *last], axis=1)
        turned = theta - arm.theta_offset_rad[1:]
        found[:, branch] = turned - 2.0 * np.pi * np.rint(turned / (2.0 * np.pi))
        # Rounding may put a stretched arm a hair out of reach; what it costs is checked later.
        missed[:, branch] = np.maximum(np.maximum(beyond, aside), 0.0)
    missed[missed < 1e-9] = 0.0
    missed[missed > margin_mm] = np.inf
    return found, missed


def _wrist(left: np.ndarray, s: np.ndarray, flip: int, least_sine: float) -> tuple[np.ndarray, ...]:
    sine = np.hypot(left[:, 0, 2], left[:, 1, 2])
    sign = -1.0 if flip else 1.0
    theta_6 = np.arctan2(sign * np.maximum(sine, least_sine), -s[4] * s[5] * left[:, 2, 2])
    free = sine < _ALIGNED
    theta_5 = np.arctan2(s[5] * sign * left[:, 1, 2], s[5] * sign * left[:, 0, 2])
    theta_5 = np.where(free, 0.0, theta_5)
    # Joint 7 from the frame behind joint 5 as it was found, so that close to alignment, where joint
    # 5 is ill-determined, the two still make the wanted rotation together.
    c, n = np.cos(theta_5)[:, None], np.sin(theta_5)[:, None]
    across = s[4] * s[5] * (n * left[:, 0, :2] - c * left[:, 1, :2])
    return theta_5, theta_6, np.arctan2(across[:, 0], across[:, 1])


def _turned(theta_rad: np.ndarray | float, sign: float) -> np.ndarray:
    """Rotation (..., 3, 3) across a joint whose twist has the sine ``sign`` and no cosine."""
    c, s = np.cos(theta_rad), np.sin(theta_rad)
    zero = np.zeros_like(c)
    rows = [[c, zero, sign * s], [s, zero, -sign * c], [zero, zero + sign, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
