"""Arms of five makers with errors of their own, by 4 x 4 matrices; angles in rad, lengths in mm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation


def frame(x=0.0, y=0.0, z=0.0, turn=None) -> np.ndarray:
    """A 4 x 4 matrix of a position and a scipy rotation."""
    found = np.eye(4)
    found[:3, 3] = x, y, z
    if turn is not None:
        found[:3, :3] = turn.as_matrix()
    return found


def about(axis: str, angle: float) -> np.ndarray:
    """A turn about x, y or z."""
    return frame(turn=Rotation.from_euler(axis, angle))


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

    def pose(self, shown: np.ndarray, true: bool = False) -> np.ndarray:
        """The flange in the base at joints shown on the pendant (6,)."""
        here = np.eye(4)
        error = self.errors if true else np.zeros((6, 5))
        for row, more, q in zip(self.rows, error, self.matrix @ shown, strict=True):
            theta, alpha = np.deg2rad(row[0]), np.deg2rad(row[3])
            q = q + true * self.wave * np.sin(2.0 * q)
            here = here @ about("z", q + theta + more[0])
            here = here @ frame(row[2] + more[2], 0.0, 0.0) @ frame(0.0, 0.0, row[1] + more[1])
            here = here @ about("x", alpha + more[3]) @ about("y", more[4])
        return here @ self.behind

    @property
    def behind(self) -> np.ndarray:
        """The flange behind the last row."""
        return frame(*self.flange[:3], Rotation.from_rotvec(self.flange[3:], degrees=True))

    def joints(self, wanted: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Joints shown at which the arm as described puts its flange at a pose, near others."""

        def off(q):
            apart = np.linalg.inv(wanted) @ self.pose(q)
            turn = Rotation.from_matrix(apart[:3, :3]).as_rotvec()
            return np.concatenate([apart[:3, 3] / 1000.0, turn])

        found = least_squares(off, near, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        assert np.abs(found.fun).max() < 1e-9, f"{self.name}: out of reach"
        return found.x

    def draw(self, rng: np.random.Generator, count: int, part: float = 1.0) -> np.ndarray:
        """Joints shown (count, 6), evenly in ``part`` of the ranges."""
        share = rng.uniform(-part, part, (count, 6))
        return np.deg2rad(np.array(self.middle) + share * np.array(self.half))

    def description(self) -> str:
        """The robot file."""
        lines = [f"name: {self.name}", "dh:"]
        for theta, d, a, alpha in self.rows:
            row = f"theta_offset_deg: {theta}, d_mm: {d}, a_mm: {a}, alpha_deg: {alpha}"
            lines.append(f"  - {{{row}}}")
        lines.append(f"joint_map: {self.matrix.tolist()}")
        lines.append(f"limits_deg: {[list(each) for each in self.limits]}")
        lines.append(f"flange: {{position_mm: {[*self.flange[:3]]}, ")
        lines[-1] += f"rotation_vector_deg: {[*self.flange[3:]]}}}"
        return "\n".join(lines) + "\n"


def errors(seed: int, zeros: float = 1.0, lengths: float = 1.0) -> np.ndarray:
    """Errors of about 4 mrad in joint zeros, 0.8 mm in lengths and 0.8 mrad in axes."""
    size = np.array([4e-3 * zeros, 0.8 * lengths, 0.8 * lengths, 8e-4 * lengths, 0.0])
    found = np.random.default_rng(seed).choice([-1.0, 1.0], (6, 5)) * size
    found[1:3, 4] = [5e-4 * lengths, -8e-4 * lengths]
    return found


def _signs(*signs: float) -> np.ndarray:
    return np.diag(np.array(signs, dtype=float))


def _coupled(matrix: np.ndarray, joint: int, to: int, by: float) -> np.ndarray:
    found = matrix.copy()
    found[joint - 1, to - 1] = by
    return found


_WIDE = ((-185, 185), (-155, 155), (-190, 190), (-350, 350), (-125, 125), (-350, 350))

KUKA = Arm(
    "kr6_like",
    ((0, 400, 25, -90), (0, 0, 455, 0), (-90, 0, 35, -90), (0, 420, 0, 90), (0, 0, 0, -90),
     (180, 70, 0, 0)),
    _signs(-1, 1, 1, -1, 1, -1),
    (0.0, 0.0, 10.0, 0.0, 0.0, 180.0),
    (0, -75, 85, 10, 60, 20), (60, 25, 25, 60, 35, 90), _WIDE, errors(1),
)  # fmt: skip
ABB = Arm(
    "irb2400_like",
    ((0, 615, 100, -90), (-90, 0, 705, 0), (0, 0, 135, -90), (0, 755, 0, 90), (0, 0, 0, -90),
     (180, 85, 0, 0)),
    _coupled(_signs(1, 1, 1, 1, 1, 1), 3, 2, -1.0),
    (0.0,) * 6,
    (0, 20, 20, 10, 50, 20), (60, 30, 25, 50, 30, 80), _WIDE, errors(2),
)  # fmt: skip
FANUC = Arm(
    "m20_like",
    ((0, 525, 150, -90), (-90, 0, 790, 0), (0, 0, 250, -90), (0, 835, 0, 90), (0, 0, 0, -90),
     (180, 100, 0, 180)),
    _coupled(_signs(1, 1, -1, -1, -1, -1), 3, 2, -1.0),
    (0.0,) * 6,
    (0, 20, -10, 10, -70, 20), (60, 25, 20, 50, 30, 80), _WIDE, errors(3),
)  # fmt: skip
UR = Arm(
    "ur10_like",
    ((0, 127.3, 0, 90), (0, 0, -612, 0), (0, 0, -572.3, 0), (0, 163.941, 0, 90),
     (0, 115.7, 0, -90), (0, 92.2, 0, 0)),
    _signs(1, 1, 1, 1, 1, 1),
    (0.0,) * 6,
    (0, -80, 90, -100, -80, 0), (70, 30, 35, 40, 35, 90), ((-360, 360),) * 6, errors(4),
)  # fmt: skip
YASKAWA = Arm(
    "gp25_like",
    ((0, 505, 150, -90), (-90, 0, 760, 180), (0, 0, -200, 90), (0, -795, 0, -90), (0, 0, 0, 90),
     (0, -100, 0, 180)),
    _signs(1, 1, 1, -1, 1, -1),
    (0.0,) * 6,
    (0, 10, -10, 10, 65, 20), (60, 30, 25, 50, 30, 80), _WIDE, errors(5),
)  # fmt: skip
ARMS = {"kuka": KUKA, "abb": ABB, "fanuc": FANUC, "ur": UR, "yaskawa": YASKAWA}
