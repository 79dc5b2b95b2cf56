"""Shipped arms of five makers with errors, by 4 x 4 matrices; angles in rad, lengths in mm."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from oracles.kinematics import dh_frames, frame

DEG = np.pi / 180.0
KEYS = ("theta_offset_deg", "d_mm", "a_mm", "alpha_deg")
ROBOTS = Path(__file__).parents[3] / "src" / "kinacc" / "kinematics" / "robots"


@dataclass(frozen=True)
class Arm:
    """``rows``: theta offset (deg), d, a, alpha (deg) by joint; DH joints are ``matrix @ shown``.

    ``flange``: x, y, z (mm) and a rotation vector (deg) behind the last row. ``errors`` (6, 5): in
    theta, d, a, alpha and a turn about y, rad and mm; every axis runs ahead by ``wave sin(2 q)``
    (rad). ``middle`` and ``half`` (6,): joints shown
    (deg) at which programs and measurements are.
    """

    name: str
    rows: tuple
    matrix: np.ndarray
    flange: tuple
    middle: tuple
    half: tuple
    limits: tuple
    errors: np.ndarray
    wave: float = 0.0

    @property
    def table(self) -> np.ndarray:
        """Rows (6, 5) theta, d, a, alpha and beta of the arm as described, rad and mm."""
        return np.pad(np.array(self.rows) * [DEG, 1.0, 1.0, DEG], ((0, 0), (0, 1)))

    def frames(self, shown: np.ndarray, true: bool = False) -> list[np.ndarray]:
        """The base frame and the frame after each joint, at joints shown (..., 6)."""
        q = shown @ self.matrix.T
        return dh_frames(self.table + true * self.errors, q + true * self.wave * np.sin(2.0 * q))

    def pose(self, shown: np.ndarray, true: bool = False) -> np.ndarray:
        """The flange in the base."""
        return self.frames(shown, true)[-1] @ self.behind

    @property
    def behind(self) -> np.ndarray:
        """The flange behind the last row."""
        return frame(*self.flange[:3], Rotation.from_rotvec(self.flange[3:], degrees=True))

    def joints(self, wanted: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Joints shown (n, 6) at which the arm as described puts its flange at poses, near others.

        Newton's method on differences (m and rad).
        """

        def off(q):
            apart = np.linalg.inv(wanted) @ self.pose(q)
            turn = Rotation.from_matrix(apart[:, :3, :3]).as_rotvec()
            return np.hstack([apart[:, :3, 3] / 1000.0, turn])

        q = np.array(near)
        for _ in range(8):
            gap = off(q)
            slopes = np.stack([off(q + step) - gap for step in 1e-6 * np.eye(6)], axis=2)
            q -= 1e-6 * np.linalg.solve(slopes, gap[..., None])[..., 0]
        assert np.abs(off(q)).max() < 1e-9, f"{self.name}: out of reach"
        return q

    def draw(self, rng: np.random.Generator, count: int, part: float = 1.0) -> np.ndarray:
        """Joints shown (count, 6), evenly in ``part`` of the ranges."""
        share = rng.uniform(-part, part, (count, 6))
        return np.deg2rad(np.array(self.middle) + share * np.array(self.half))

    def description(self) -> str:
        """The robot file."""
        place = {"position_mm": self.flange[:3], "rotation_vector_deg": self.flange[3:]}
        content = {
            "name": self.name,
            "dh": [dict(zip(KEYS, row, strict=True)) for row in self.rows],
            "joint_map": self.matrix.tolist(),
            "limits_deg": self.limits,
            "flange": place,
        }
        return yaml.safe_dump(content)


def errors(seed: int) -> np.ndarray:
    """Errors of about 4 mrad in joint zeros, 0.8 mm in lengths and 0.8 mrad in axes."""
    size = np.array([4e-3, 0.8, 0.8, 8e-4, 0.0])
    found = np.random.default_rng(seed).choice([-1.0, 1.0], (6, 5)) * size
    found[1:3, 4] = [5e-4, -8e-4]
    return found


def shipped(
    name: str, middle: tuple = (), half: tuple = (), seed: int = 0, flange: tuple = (0.0,) * 6
) -> Arm:
    """The arm of a shipped robot file, read without the package."""
    content = yaml.safe_load((ROBOTS / f"{name}.yaml").read_text())
    rows = tuple(tuple(row[key] for key in KEYS) for row in content["dh"])
    signs = np.diag([row.get("sign", 1) for row in content["dh"]])
    matrix = np.array(content.get("joint_map", signs), dtype=float)
    limits = tuple(map(tuple, content["limits_deg"]))
    return Arm(name, rows, matrix, flange, middle, half, limits, errors(seed))


_TURNED = (0.0, 0.0, 10.0, 0.0, 0.0, 180.0)
ARMS = {
    "kuka": shipped(
        "kr6_r900_sixx", (0, -75, 85, 10, 60, 20), (60, 25, 25, 60, 35, 90), 1, _TURNED
    ),
    "abb": shipped("irb2400_12_155", (0, 20, 20, 10, 50, 20), (60, 30, 25, 50, 30, 80), 2),
    "fanuc": shipped("fanuc_m20ia", (0, 20, -10, 10, -70, 20), (60, 25, 20, 50, 30, 80), 3),
    "ur": shipped("ur10", (0, -80, 90, -100, -80, 0), (70, 30, 35, 40, 35, 90), 4),
    "yaskawa": shipped("gp25", (0, 10, -10, 10, 65, 20), (60, 30, 25, 50, 30, 80), 5),
}
