"""Closed-form inverse of six-axis arms with parallel axes 2 and 3 and a spherical wrist.

Derived from the arm's own DH table (lengths, offsets and signs are not assumed), for all eight
branches. Shoulder: ``front`` when the wrist centre is on the side of axis 1 joint 1 faces.
Elbow: ``up`` when axis 3 lies above the line from axis 2 to the wrist centre of an arm reaching
the way it faces (mirrored for ``back``). Wrist: ``noflip`` when joint 5 is on the positive side of
the angle at which axes 4 and 6 align, ``flip`` on the negative side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.geometry import Pose, rotation_x, rotation_y
from kinacc.kinematics.dh import DHModel

SHOULDERS, ELBOWS, WRISTS = ("front", "back"), ("up", "down"), ("noflip", "flip")
BRANCHES = tuple(f"{a}-{b}-{c}" for a in SHOULDERS for b in ELBOWS for c in WRISTS)

_BLOCK = 2048  # poses per pass: the temporaries stay in cache
_TWO_PI = 2.0 * np.pi
_ALIGNED = 1e-12  # sine of joint 5 below which joint 4 is free and set to zero


@dataclass(frozen=True)
class SphericalWristArm:
    """Constants of the closed form, all read from the DH table by ``recognise``.

    ``sign_1``, ``sign_4``, ``sign_5``: sines of those twists (+-1); ``sign_2``: cosine of twist 2;
    ``twist_23_rad``: twist from axis 2 to axis 4; ``forearm_mm`` and ``forearm_rad``: length and
    direction of the forearm in the plane of axes 2 and 3; ``sideways_mm``: offset of the wrist
    centre out of that plane; ``flange`` and ``wrist_in_flange_mm``: what follows joint 6.
    """

    theta_offset_rad: np.ndarray  # (6,)
    height_mm: float
    shoulder_mm: float
    upper_arm_mm: float
    forearm_mm: float
    forearm_rad: float
    sideways_mm: float
    sign_1: float
    sign_2: float
    twist_23_rad: float
    sign_4: float
    sign_5: float
    flange: np.ndarray  # (3, 3)
    wrist_in_flange_mm: np.ndarray  # (3,)


@dataclass(frozen=True)
class Start:
    """How the closed form is bent into starts for a refinement onto a slightly different arm.

    Poses up to ``reach_margin_mm`` beyond reach start from the stretched (or folded) arm. A
    refinement cannot leave a singular posture sideways, nor tell there which branch was meant: so
    the elbow is bent by at least ``least_bend_rad``, and joint 1 faces the wrist centre as if that
    were at least ``least_radius_mm`` off axis 1.
    """

    reach_margin_mm: float = 20.0
    least_bend_rad: float = 0.02
    least_radius_mm: float = 10.0


def missing_properties(dh: DHModel, tolerance: float = 1e-9) -> list[str]:
    """What keeps ``dh`` from this closed form, in words; empty when it applies.

    ``tolerance`` bounds the sines and cosines of the twists (-) and the wrist offsets (mm).
    """
    if dh.joints != 6:
        return [f"it has {dh.joints} joints, the closed form needs 6"]
    found = [f"joint {joint + 1} slides" for joint in np.flatnonzero(dh.prismatic)]
    for joint in (1, 4, 5):
        if abs(np.cos(dh.alpha_rad[joint - 1])) > tolerance:
            angle = np.rad2deg(dh.alpha_rad[joint - 1])
            found.append(f"alpha of joint {joint} is {angle:.6g} deg, not +-90")
    if abs(np.sin(dh.alpha_rad[1])) > tolerance:
        found.append("axes 2 and 3 are not parallel")
    offsets = {"a of joint 4": dh.a_mm[3], "d of joint 5": dh.d_mm[4], "a of joint 5": dh.a_mm[4]}
    for name, value in offsets.items():
        if abs(value) > tolerance:
            found.append(f"the wrist is not spherical: {name} is {value:.6g} mm, not 0")
    if np.any(np.abs(dh.beta_rad[:5]) > tolerance):
        found.append("a joint before the last has a Hayati beta")
    if abs(dh.a_mm[1]) <= tolerance:
        found.append("the upper arm has no length")
    elif np.hypot(dh.a_mm[2], np.sin(dh.alpha_rad[2]) * dh.d_mm[3]) <= tolerance:
        found.append("the forearm has no length")
    return found


def recognise(dh: DHModel, tolerance: float = 1e-9) -> SphericalWristArm | None:
    """Constants of the closed form of ``dh``, or None where it does not apply."""
    if missing_properties(dh, tolerance):
        return None
    sine_3, cosine_3 = np.sin(dh.alpha_rad[2]), np.cos(dh.alpha_rad[2])
    along, across = dh.a_mm[2], -sine_3 * dh.d_mm[3]
    sign_2 = _sign(np.cos(dh.alpha_rad[1]))
    sideways = dh.d_mm[1] + sign_2 * (dh.d_mm[2] + cosine_3 * dh.d_mm[3])
    flange = rotation_x(dh.alpha_rad[5]) @ rotation_y(dh.beta_rad[5])
    return SphericalWristArm(
        theta_offset_rad=np.array(dh.theta_offset_rad, dtype=float),
        height_mm=float(dh.d_mm[0]),
        shoulder_mm=float(dh.a_mm[0]),
        upper_arm_mm=float(dh.a_mm[1]),
        forearm_mm=float(np.hypot(along, across)),
        forearm_rad=float(np.arctan2(across, along)),
        sideways_mm=float(sideways) if abs(sideways) > tolerance else 0.0,
        sign_1=_sign(np.sin(dh.alpha_rad[0])),
        sign_2=sign_2,
        twist_23_rad=float(dh.alpha_rad[1] + dh.alpha_rad[2]),
        sign_4=_sign(np.sin(dh.alpha_rad[3])),
        sign_5=_sign(np.sin(dh.alpha_rad[4])),
        flange=flange,
        wrist_in_flange_mm=-flange.T @ np.array([dh.a_mm[5], 0.0, dh.d_mm[5]]),
    )


def branch_indices(branches: tuple[str, ...] | None) -> np.ndarray:
    """Rows of ``BRANCHES`` named by ``branches`` (all when None)."""
    names = BRANCHES if branches is None else branches
    return np.array([BRANCHES.index(name) for name in names], dtype=int)


def solve(
    arm: SphericalWristArm,
    pose: Pose,
    branches: tuple[str, ...] | None = None,
    start: Start | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """DH joint angles (n, b, 6) in (-pi, pi] of flange poses (n, ...), and reached (n, b).

    ``branches`` names the b branches wanted, in that order; None means all eight of ``BRANCHES``.
    With ``start`` the angles are starts for a refinement onto a model close to this arm instead of
    solutions. Angles of unreached branches are those of the nearest posture of the arm.
    """
    start = start or Start(0.0, 0.0, 0.0)
    wanted = branch_indices(branches)
    count = len(pose.position_mm)
    q_rad = np.empty((count, len(wanted), 6))
    reached = np.empty((count, len(wanted)), dtype=bool)
    for begin in range(0, count, _BLOCK):
        block = slice(begin, begin + _BLOCK)
        part = Pose(pose.rotation[block], pose.position_mm[block])
        _solve_block(arm, part, wanted, start, q_rad[block], reached[block])
    return q_rad, reached


def _solve_block(
    arm: SphericalWristArm,
    pose: Pose,
    wanted: np.ndarray,
    start: Start,
    q_rad: np.ndarray,
    reached: np.ndarray,
) -> None:
    # Every entry of the rotation behind joint 6 as a contiguous (n,) array.
    stacked = pose.rotation.reshape(-1, 3)
    rows = np.ascontiguousarray((stacked @ arm.flange.T).reshape(-1, 9).T).reshape(3, 3, -1)
    arm_end = (stacked @ arm.wrist_in_flange_mm).reshape(-1, 3)
    centre = np.ascontiguousarray((pose.position_mm + arm_end).T)
    found = np.empty((len(wanted), 6, len(pose.position_mm)))
    for shoulder in range(2):
        columns = np.flatnonzero(wanted // 4 == shoulder)
        if len(columns) == 0:
            continue
        turn = _first_joint(arm, centre, shoulder, start)
        bend = _elbow_triangle(arm, turn, shoulder, start)
        for elbow in range(2):
            pair = columns[wanted[columns] // 2 % 2 == elbow]
            if len(pair) == 0:
                continue
            theta_2, theta_3, sine_23, cosine_23 = _second_and_third(arm, bend, elbow)
            wrist = _wrist_rotation(arm, rows, turn, sine_23, cosine_23)
            theta = (turn.theta_rad, theta_2, theta_3, *_wrist_joints(arm, wrist))
            for column in pair:
                _write(arm, theta, wanted[column] % 2, found[column])
                reached[:, column] = turn.reached & bend.reached
    q_rad[:] = np.moveaxis(found, 2, 0)


def _write(
    arm: SphericalWristArm, theta: tuple[np.ndarray, ...], flip: int, q_rad: np.ndarray
) -> None:
    """Joints (6, n) of the six angles (n,) of the ``noflip`` wrist, or of its mirror image."""
    for joint, angle in enumerate(theta):
        if flip and joint == 4:
            angle = -angle
        shift = (np.pi if flip and joint in (3, 5) else 0.0) - arm.theta_offset_rad[joint]
        turned = angle + shift
        turns = np.rint(turned * (1.0 / _TWO_PI))
        np.subtract(turned, turns * _TWO_PI, out=q_rad[joint])


@dataclass(frozen=True)
class _Turn:
    """Joint 1 and the wrist centre in the arm's plane, seen from axis 2; all (n,)."""

    theta_rad: np.ndarray
    sine: np.ndarray
    cosine: np.ndarray
    x_mm: np.ndarray
    y_mm: np.ndarray
    reached: np.ndarray


def _first_joint(arm: SphericalWristArm, centre: np.ndarray, shoulder: int, start: Start) -> _Turn:
    x, y, z = centre
    side = -arm.sign_1 * arm.sideways_mm
    distance_sq = x * x + y * y
    forward_sq = distance_sq - side * side
    reached = distance_sq >= max(abs(side) - start.reach_margin_mm, 0.0) ** 2 * (1.0 - 1e-12)
    forward = np.sqrt(np.maximum(forward_sq, start.least_radius_mm**2))
    if shoulder == 1:
        forward = -forward
    # A wrist centre on axis 1 leaves joint 1 free: take theta_1 = 0.
    free = distance_sq == 0.0
    scale = np.where(free, 1.0, 1.0 / np.where(free, 1.0, np.sqrt(distance_sq)))
    length = np.where(free, 1.0, 1.0 / np.hypot(forward, side) if side else 0.0)
    if side == 0.0:
        sign = 1.0 if shoulder == 0 else -1.0
        cosine = np.where(free, sign, sign * x * scale)
        sine = np.where(free, 0.0, sign * y * scale)
    else:
        cosine = (x * forward + y * side) * scale * length
        sine = (y * forward - x * side) * scale * length
    return _Turn(
        np.arctan2(sine, cosine),
        sine,
        cosine,
        forward - arm.shoulder_mm,
        arm.sign_1 * (z - arm.height_mm),
        reached,
    )


@dataclass(frozen=True)
class _Bend:
    """Elbow triangle of the ``up`` elbow; ``down`` mirrors it; all (n,)."""

    centre_rad: np.ndarray  # direction of the wrist centre seen from axis 2
    opening_rad: np.ndarray  # from the upper arm to that direction, in the turning sense of axis 2
    bend_rad: np.ndarray  # from the upper arm to the forearm, in the turning sense of axis 3
    reached: np.ndarray


def _elbow_triangle(arm: SphericalWristArm, turn: _Turn, shoulder: int, start: Start) -> _Bend:
    first, second = arm.upper_arm_mm, arm.forearm_mm
    distance_sq = turn.x_mm * turn.x_mm + turn.y_mm * turn.y_mm
    longest, shortest = abs(first) + second, abs(abs(first) - second)
    reached = distance_sq <= (longest + start.reach_margin_mm) ** 2 * (1.0 + 1e-14)
    reached &= distance_sq >= max(shortest - start.reach_margin_mm, 0.0) ** 2 * (1.0 - 1e-14)
    inside_sq = np.clip(distance_sq, shortest**2, longest**2)
    scale = 0.5 / (first * second)
    cosine = (inside_sq - (first * first + second * second)) * scale
    # (1 - c)(1 + c) keeps its digits for the stretched and the folded arm, 1 - c^2 does not.
    sine = np.sqrt((longest**2 - inside_sq) * (inside_sq - shortest**2)) * abs(scale)
    up = -arm.sign_1 * arm.sign_2 * _sign(first) * (1.0 if shoulder == 0 else -1.0)
    if start.least_bend_rad > 0.0:
        straight = sine < np.sin(start.least_bend_rad)
        sine = np.where(straight, np.sin(start.least_bend_rad), sine)
        cosine = np.where(straight, np.copysign(np.cos(start.least_bend_rad), cosine), cosine)
    sine *= up
    return _Bend(
        np.arctan2(turn.y_mm, turn.x_mm),
        np.arctan2(arm.sign_2 * second * sine, first + second * cosine),
        np.arctan2(sine, cosine),
        reached,
    )


def _second_and_third(
    arm: SphericalWristArm, bend: _Bend, elbow: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Angles 2 and 3, and sine and cosine of theta_2 + sign_2 theta_3."""
    if elbow == 0:
        theta_2 = bend.centre_rad - bend.opening_rad
        theta_3 = bend.bend_rad - arm.forearm_rad
    else:
        theta_2 = bend.centre_rad + bend.opening_rad
        theta_3 = -bend.bend_rad - arm.forearm_rad
    both = theta_2 + arm.sign_2 * theta_3
    return theta_2, theta_3, np.sin(both), np.cos(both)


@dataclass(frozen=True)
class _Wrist:
    """Entries of the rotation the wrist must make: rows x, y of columns 0, 1; column 2."""

    x: np.ndarray  # (3, n)
    y: np.ndarray  # (3, n)
    z2: np.ndarray  # (n,)


def _wrist_rotation(
    arm: SphericalWristArm,
    rows: np.ndarray,
    turn: _Turn,
    sine_23: np.ndarray,
    cosine_23: np.ndarray,
) -> _Wrist:
    ahead = turn.cosine * rows[0] + turn.sine * rows[1]
    aside = turn.cosine * rows[1] - turn.sine * rows[0]
    above = arm.sign_1 * rows[2]
    first = cosine_23 * ahead + sine_23 * above
    second = cosine_23 * above - sine_23 * ahead
    third = -arm.sign_1 * aside
    sine, cosine = np.sin(arm.twist_23_rad), np.cos(arm.twist_23_rad)
    return _Wrist(first, cosine * second + sine * third, cosine * third[2] - sine * second[2])


def _wrist_joints(
    arm: SphericalWristArm, wrist: _Wrist
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles 4, 5 and 6 of the ``noflip`` wrist."""
    offset_4, offset_5 = arm.theta_offset_rad[3:5]
    side = 1.0 if np.cos(offset_5) >= 0.0 else -1.0
    x, y = wrist.x[2], wrist.y[2]
    sine_5 = np.sqrt(x * x + y * y)
    free = sine_5 < _ALIGNED
    if free.any():
        x, y = np.where(free, np.cos(offset_4), x), np.where(free, np.sin(offset_4), y)
        scale = np.where(free, 1.0, side * arm.sign_5 / np.where(free, 1.0, sine_5))
    else:
        scale = side * arm.sign_5 / sine_5
    cosine_4, sine_4 = x * scale, y * scale
    # Joint 6 from the frame behind joint 4 as it was found, so that close to alignment, where
    # joint 4 is ill-determined, the two still make the wanted rotation together.
    sign = arm.sign_4 * arm.sign_5
    across = sine_4 * wrist.x[0] - cosine_4 * wrist.y[0]
    along = sine_4 * wrist.x[1] - cosine_4 * wrist.y[1]
    return (
        np.arctan2(sine_4, cosine_4),
        np.arctan2(side * sine_5, -sign * wrist.z2),
        np.arctan2(sign * across, sign * along),
    )


def _sign(value: float) -> float:
    return -1.0 if value < 0.0 else 1.0
