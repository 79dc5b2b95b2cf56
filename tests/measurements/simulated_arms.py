"""Measured campaigns of five arms, simulated with forward kinematics of their own.

Angles in rad, lengths in mm. Every arm differs from its nominal table by small DH errors, stands
somewhere in the tracker's frame, carries three reflectors and a six-degree-of-freedom probe, and
is measured with a noise of 0.03 mm per axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

POSES = 40
NOISE_MM = 0.03
NOISE_RAD = 5e-5
REFLECTORS_MM = np.array([[105.0, 22.0, 61.0], [-38.0, 97.0, 58.0], [-44.0, -71.0, 93.0]])


@dataclass(frozen=True)
class Arm:
    """Nominal DH rows (theta deg, d mm, a mm, alpha deg), reported joints to DH joints, ranges."""

    rows: tuple[tuple[float, float, float, float], ...]
    joint_map: np.ndarray
    ranges_deg: tuple[tuple[float, float], ...]


def _signs(*signs: int) -> np.ndarray:
    return np.diag(np.array(signs, dtype=float))


_FANUC_ROWS = (
    (0, 670, 312, -90),
    (-90, 0, 1075, 0),
    (0, 0, 225, -90),
    (0, 1280, 0, 90),
    (0, 0, 0, -90),
    (0, 215, 0, 0),
)
_FANUC_COUPLED = _signs(1, 1, -1, -1, -1, -1)
_FANUC_COUPLED[2, 1] = -1  # the controller reports joint 3 against the horizontal

ARMS = {
    "ur10": Arm(
        (
            (0, 127.3, 0, 90),
            (0, 0, -612, 0),
            (0, 0, -572.3, 0),
            (0, 163.941, 0, 90),
            (0, 115.7, 0, -90),
            (0, 92.2, 0, 0),
        ),
        _signs(1, 1, 1, 1, 1, 1),
        ((-150, 150), (-150, -30), (-130, 130), (-200, 20), (-150, 150), (-170, 170)),
    ),
    "fanuc": Arm(
        _FANUC_ROWS,
        _FANUC_COUPLED,
        ((-95, 100), (-40, 60), (-70, 60), (-150, 150), (-100, 100), (-170, 170)),
    ),
    "fanuc_uncoupled": Arm(
        _FANUC_ROWS,
        _signs(1, 1, -1, -1, -1, -1),
        ((-95, 100), (-40, 60), (-60, 90), (-150, 150), (-100, 100), (-170, 170)),
    ),
    "irb120": Arm(
        (
            (0, 290, 0, -90),
            (-90, 0, 270, 0),
            (0, 0, 70, -90),
            (0, 302, 0, 90),
            (0, 0, 0, -90),
            (180, 72, 0, 0),
        ),
        _signs(1, 1, 1, 1, 1, 1),
        ((-120, 120), (-60, 80), (-80, 50), (-140, 140), (-100, 100), (-180, 180)),
    ),
    "kr10": Arm(
        (
            (0, 400, 25, -90),
            (0, 0, 560, 0),
            (-90, 0, 35, -90),
            (0, 515, 0, 90),
            (0, 0, 0, -90),
            (0, 80, 0, 0),
        ),
        _signs(-1, 1, 1, -1, 1, -1),
        ((-130, 130), (-130, -30), (30, 130), (-150, 150), (-100, 100), (-170, 170)),
    ),
    "mh180": Arm(
        (
            (0, 0, 325, -90),
            (-90, 0, 1150, 180),
            (0, 0, 300, -90),
            (-180, -1225, 0, -90),
            (-180, 0, 0, -90),
            (0, -225, 0, 180),
        ),
        _signs(1, 1, 1, 1, 1, 1),
        ((-120, 120), (-45, 60), (-60, 70), (-150, 150), (-110, 110), (-180, 180)),
    ),
}

KR10_YAML = """\
name: kr10_like
source: dimensions of a small six-axis arm; axes 1, 4 and 6 count against the right hand
dh:
  - {theta_offset_deg: 0, d_mm: 400, a_mm: 25, alpha_deg: -90, sign: -1}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 560, alpha_deg: 0}
  - {theta_offset_deg: -90, d_mm: 0, a_mm: 35, alpha_deg: -90}
  - {theta_offset_deg: 0, d_mm: 515, a_mm: 0, alpha_deg: 90, sign: -1}
  - {theta_offset_deg: 0, d_mm: 0, a_mm: 0, alpha_deg: -90}
  - {theta_offset_deg: 0, d_mm: 80, a_mm: 0, alpha_deg: 0, sign: -1}
limits_deg: [[-170, 170], [-190, 45], [-120, 156], [-185, 185], [-120, 120], [-350, 350]]
"""


def flange(rows: np.ndarray, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (n, 3, 3) and position (n, 3) of the flange for DH joints (n, k)."""
    turned = np.tile(np.eye(3), (len(joints), 1, 1))
    moved = np.zeros((len(joints), 3))
    for row, angle in zip(np.asarray(rows, dtype=float), joints.T, strict=True):
        theta, d, a, alpha = angle + row[0], row[1], row[2], row[3]
        about_z = Rotation.from_rotvec(theta[:, None] * [0, 0, 1]).as_matrix()
        link = about_z @ np.array([a, 0.0, 0.0]) + np.array([0.0, 0.0, d])
        moved = moved + np.einsum("nij,nj->ni", turned, link)
        turned = turned @ about_z @ Rotation.from_euler("x", alpha).as_matrix()
    return turned, moved


def nominal_rows(arm: Arm) -> np.ndarray:
    """DH rows with angles in rad, (k, 4)."""
    rows = np.array(arm.rows, dtype=float)
    rows[:, [0, 3]] = np.radians(rows[:, [0, 3]])
    return rows


@dataclass(frozen=True)
class Campaign:
    """Joints as reported, deg (n, k); reflectors (3, n, 3) and probe frame in the tracker, mm."""

    joints_deg: np.ndarray
    points_mm: np.ndarray
    rotations: np.ndarray
    nominal_rotations: np.ndarray
    nominal_mm: np.ndarray


def positions(arm: Arm, joints_deg: np.ndarray, rng: np.random.Generator) -> Campaign:
    """Measurements of given joints; the arm's errors and its place are those of its seed."""
    fixed = np.random.default_rng(abs(round(sum(row[2] for row in arm.rows))))
    rows = nominal_rows(arm)
    wrong = rows + fixed.normal(size=rows.shape) * [3e-4, 0.3, 0.3, 3e-4]
    base = Rotation.from_euler("zyx", [fixed.uniform(-2.5, 2.5), 0.004, -0.003]).as_matrix()
    place = fixed.uniform([1800, -1500, -700], [3400, 1500, -200])
    probe = Rotation.from_euler("xyz", fixed.uniform(-1, 1, 3)).as_matrix()
    joints = np.radians(joints_deg) @ arm.joint_map.T
    turned, moved = flange(wrong, joints)
    seen = np.einsum("nij,tj->tni", turned, REFLECTORS_MM) + moved
    seen = seen @ base.T + place + rng.normal(scale=NOISE_MM, size=seen.shape)
    shaken = Rotation.from_rotvec(rng.normal(scale=NOISE_RAD, size=(len(joints), 3))).as_matrix()
    return Campaign(joints_deg, seen, base @ turned @ probe @ shaken, *flange(rows, joints))


@cache
def campaign(name: str, decimals: int = 3) -> Campaign:
    """The one campaign of an arm: joints as its controller rounds them, measured once each."""
    arm = ARMS[name]
    rng = np.random.default_rng([11, *name.encode()])
    low, high = np.array(arm.ranges_deg, dtype=float).T
    return positions(arm, rng.uniform(low, high, (POSES, len(low))).round(decimals), rng)


def repeated(name: str, configurations: int, times: int) -> Campaign:
    """The first configurations of a campaign, each measured several times in a row."""
    first = campaign(name).joints_deg[:configurations]
    rng = np.random.default_rng([12, *name.encode()])
    return positions(ARMS[name], np.repeat(first, times, axis=0), rng)
