"""Closed-form inverses of six axes with a spherical wrist or parallel axes 2 to 4.

Derived from the arm's own DH table (lengths, offsets and signs are not assumed), for all eight
branches. Shoulder: ``front`` when the wrist centre (of parallel axes: the point where axes 5 and 6
meet) is on the side of axis 1 joint 1 faces. Elbow: ``up`` when axis 3 lies above the line from
axis 2 to the wrist centre (axis 4) of an arm reaching the way it faces (mirrored for ``back``).
Wrist: ``noflip`` when joint 5 is on the positive side of the angle at which the wrist is aligned
(axes 4 and 6 parallel), ``flip`` on the negative side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kinacc.geometry import Pose, compose, invert, rotation_x, rotation_y, rotation_z
from kinacc.kinematics.dh import DHModel

SHOULDERS, ELBOWS, WRISTS = ("front", "back"), ("up", "down"), ("noflip", "flip")
BRANCHES = tuple(f"{a}-{b}-{c}" for a in SHOULDERS for b in ELBOWS for c in WRISTS)

_TOLERANCE = 1e-9  # of sines and cosines of twists, and of lengths in mm
_ALIGNED = 1e-12  # sine of the middle wrist joint below which the first is free
_SIDES = np.array([1.0, -1.0])


class Start(NamedTuple):
    """Changes that make the closed form a start for a refinement onto a slightly different arm.

    A refinement cannot leave a singular posture sideways, nor tell there which branch was meant.

    Attributes
    ----------
    reach_margin_mm : float
        Poses up to this far beyond reach start from the stretched (or folded) arm.
    least_bend_rad : float
        Least angle between the elbow and its stretched or folded posture.
    least_radius_mm : float
        Joint 1 faces the wrist centre as if that were at least this far from axis 1.
    """

    reach_margin_mm: float = 20.0
    least_bend_rad: float = 0.02
    least_radius_mm: float = 10.0


EXACT = Start(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class SixAxes:
    """An arm of six axes with a closed form.

    Attributes
    ----------
    dh : DHModel
        The arm.
    parallel : bool
        True: axes 2 to 4 are parallel. False: the wrist is spherical.
    """

    dh: DHModel
    parallel: bool

    def solve(self, pose: Pose, start: Start = EXACT) -> tuple[np.ndarray, np.ndarray]:
        """Joints of flange poses in all eight branches.

        Aligned wrists have joint 4 (of parallel axes: joint 6) at zero, a wrist centre on axis 1
        has theta_1 at zero.

        Parameters
        ----------
        pose : Pose
            Poses (n, ...) of the last DH frame in the first one, mm.
        start : Start
            Changes for a later refinement; none by default.

        Returns
        -------
        q_rad : numpy.ndarray
            DH joints in (-pi, pi], shape (n, 8, 6), columns as ``BRANCHES``; out of reach those of
            the nearest posture.
        reached : numpy.ndarray
            Whether a pose is in reach, shape (n, 8).
        """
        # Arrays (n, 2, 2, 2): poses, then the sides of shoulder, elbow and wrist.
        shoulder, elbow, wrist = _SIDES[:, None, None], _SIDES[:, None], _SIDES
        dh = self.dh
        sine, cosine = np.sign(np.sin(dh.alpha_rad)), np.sign(np.cos(dh.alpha_rad))
        s1, s2, s3, s4, s5 = sine[0], cosine[1], cosine[2], sine[3], sine[4]
        rotation, point = before_last(dh, pose)
        sideways = dh.d_mm[1] + s2 * (dh.d_mm[2] + np.cos(dh.alpha_rad[2]) * dh.d_mm[3])
        side = -s1 * sideways if abs(sideways) > _TOLERANCE else 0.0
        x, y, z = point.T[..., None, None, None]
        square = x * x + y * y
        ahead = shoulder * np.sqrt(np.maximum(square - side * side, start.least_radius_mm**2))
        theta_1 = np.arctan2(y * ahead - x * side, x * ahead + y * side)
        reached = square >= max(abs(side) - start.reach_margin_mm, 0.0) ** 2 * (1.0 - 1e-12)
        plane = rotation_z(theta_1) @ rotation_x(dh.alpha_rad[0])  # along axes 2, 3 and 4
        turned = np.swapaxes(plane, -1, -2) @ rotation[:, None, None, None]
        u, v = ahead - dh.a_mm[0], s1 * (z - dh.d_mm[0])
        elbow = -s1 * np.sign(dh.a_mm[1]) * shoulder * elbow
        flips = wrist * (1.0 if np.cos(dh.theta_offset_rad[4]) >= 0.0 else -1.0)
        if self.parallel:
            # Rz(phi) Rx(alpha) Rz(theta_5) Rx(alpha_5) Rz(theta_6), from its end.
            alpha = dh.alpha_rad[1:4].sum()
            theta_6, theta_5, phi = np.negative(
                _wrist(
                    np.swapaxes(turned, -1, -2),
                    (-s5, -np.sign(np.sin(alpha))),
                    -flips,
                    -dh.theta_offset_rad[5],
                    np.sin(start.least_bend_rad),
                )
            )
            reach = np.sin(alpha) * dh.d_mm[4]
            u = u - reach * np.sin(phi) - dh.a_mm[3] * np.cos(phi)
            v = v + reach * np.cos(phi) - dh.a_mm[3] * np.sin(phi)
            elbow = elbow * np.sign(dh.a_mm[2])
            theta_2, bend, within = _triangle(u, v, dh.a_mm[1], dh.a_mm[2], elbow, start)
            theta_3, theta_4 = s2 * bend, s2 * s3 * (phi - theta_2 - bend)
        else:
            along, across = dh.a_mm[2], -np.sin(dh.alpha_rad[2]) * dh.d_mm[3]
            forearm = np.hypot(along, across)
            theta_2, bend, within = _triangle(u, v, dh.a_mm[1], forearm, elbow, start)
            theta_3 = s2 * bend - np.arctan2(across, along)
            arm = rotation_z(theta_2 + s2 * theta_3) @ rotation_x(dh.alpha_rad[1:3].sum())
            left = np.swapaxes(arm, -1, -2) @ turned
            theta_4, theta_5, theta_6 = _wrist(left, (s4, s5), flips, dh.theta_offset_rad[3])
        theta = theta_1, theta_2, theta_3, theta_4, theta_5, theta_6
        shape = len(point), 2, 2, 2
        q_rad = np.stack([np.broadcast_to(part, shape) for part in theta], axis=-1)
        q_rad = _one_turn(q_rad - dh.theta_offset_rad).reshape(-1, 8, 6)
        return q_rad, np.broadcast_to(reached & within, shape).reshape(-1, 8)


def recognise(dh: DHModel) -> SixAxes | None:
    """Closed form of an arm of six axes.

    Parameters
    ----------
    dh : DHModel
        The arm.

    Returns
    -------
    SixAxes or None
        None where no closed form applies.
    """
    if dh.joints != 6 or dh.prismatic.any():
        return None
    sine = np.sin(dh.alpha_rad)
    zero = *np.cos(dh.alpha_rad[[0, 3, 4]]), sine[1], dh.a_mm[4], *dh.beta_rad[:5]
    if np.abs(zero).max() > _TOLERANCE or abs(dh.a_mm[1]) <= _TOLERANCE:
        return None
    if abs(sine[2]) <= _TOLERANCE < abs(dh.a_mm[2]):
        return SixAxes(dh, True)
    wrist, forearm = np.hypot(dh.a_mm[3], dh.d_mm[4]), np.hypot(dh.a_mm[2], sine[2] * dh.d_mm[3])
    return SixAxes(dh, False) if wrist <= _TOLERANCE < forearm else None


def before_last(dh: DHModel, pose: Pose) -> Pose:
    """Frames (n, ...) on the last axis, behind its joint at d = 0, of flange poses (n, ...)."""
    turn = rotation_x(dh.alpha_rad[-1]) @ rotation_y(dh.beta_rad[-1])
    return compose(pose, invert(Pose(turn, np.array([dh.a_mm[-1], 0.0, dh.d_mm[-1]]))))


def _triangle(
    u: np.ndarray, v: np.ndarray, first: float, second: float, sign: np.ndarray, start: Start
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angle of the first side, and from it to the second, of an arm that ends at (u, v); reached.

    The second angle has the sign of ``sign``.
    """
    square = u * u + v * v
    longest, shortest = abs(first) + abs(second), abs(abs(first) - abs(second))
    reached = square <= (longest + start.reach_margin_mm) ** 2 * (1.0 + 1e-14)
    reached &= square >= max(shortest - start.reach_margin_mm, 0.0) ** 2 * (1.0 - 1e-14)
    inside = np.clip(square, shortest**2, longest**2)
    cosine = (inside - (first * first + second * second)) / (2.0 * first * second)
    # (1 - c)(1 + c) keeps its digits for the stretched and the folded arm, 1 - c^2 does not.
    sine = np.sqrt((longest**2 - inside) * (inside - shortest**2)) / (2.0 * abs(first * second))
    straight = sine < np.sin(start.least_bend_rad)
    cosine = np.where(straight, np.copysign(np.cos(start.least_bend_rad), cosine), cosine)
    sine = sign * np.maximum(sine, np.sin(start.least_bend_rad))
    turned = np.arctan2(v, u) - np.arctan2(second * sine, first + second * cosine)
    return turned, np.arctan2(sine, cosine), reached


def _wrist(
    rotation: np.ndarray,
    signs: tuple[float, float],
    side: np.ndarray,
    free_rad: float,
    least_sine: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (..., 2) with Rz(first) Rx(+-90) Rz(middle) Rx(+-90) Rz(last) = ``rotation``.

    ``rotation`` (..., 1, 3, 3); ``signs`` of the two twists; ``side`` (2,) the sign of the middle
    angle. An aligned wrist has its first angle at ``free_rad``.
    """
    x, y = rotation[..., 0, 2], rotation[..., 1, 2]
    sine = np.hypot(x, y)
    middle = np.arctan2(
        side * np.maximum(sine, least_sine), -signs[0] * signs[1] * rotation[..., 2, 2]
    )
    first = np.arctan2(signs[1] * side * y, signs[1] * side * x)
    first = np.where(sine < _ALIGNED, free_rad, first)
    # The last from the frame behind the first as it was found, so that close to alignment, where
    # the first is ill-determined, the two still make the wanted rotation together.
    c, s = np.cos(first), np.sin(first)
    across = s * rotation[..., 0, 0] - c * rotation[..., 1, 0]
    along = s * rotation[..., 0, 1] - c * rotation[..., 1, 1]
    sign = signs[0] * signs[1]
    return first, middle, np.arctan2(sign * across, sign * along)


def _one_turn(angle_rad: np.ndarray) -> np.ndarray:
    return angle_rad - 2.0 * np.pi * np.rint(angle_rad / (2.0 * np.pi))
