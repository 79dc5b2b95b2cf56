"""One cell of the accuracy map by brute force (paper, section IV-B), for arms like the MH180."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from . import inverse, kinematics

SIGNS = [*itertools.product((-1, 1), repeat=3), (0, 0, 0)]
BRANCHES = ("front-up-noflip", "front-up-flip")


@dataclass(frozen=True)
class Arms:
    """The model under assessment ``dh`` and the true arm, as tables and Chebyshev series."""

    dh: np.ndarray
    nominal: np.ndarray
    series: np.ndarray
    low: np.ndarray
    high: np.ndarray
    dh_tool: np.ndarray
    true_tool: np.ndarray
    s: tuple[int, ...]
    offsets: np.ndarray

    def true_at(self, q) -> np.ndarray:
        flange = kinematics.vec_forward(
            self.nominal, self.series, self.low, self.high, self.offsets, q, self.s
        )
        return kinematics.projected(flange) @ self.true_tool

    def model_at(self, q) -> np.ndarray:
        return kinematics.dh_forward(self.dh, q) @ self.dh_tool


def branch_of(table, q: np.ndarray) -> str:
    """Shoulder, elbow and wrist of a posture, from where its axes stand."""
    behind, above = kinematics.posture(kinematics.dh_frames(table, q), q[0])
    shoulder, elbow = ("front", "back")[behind], ("down", "up")[above != behind]
    return f"{shoulder}-{elbow}-{'noflip' if q[4] > 0 else 'flip'}"


def starts(angle: float) -> np.ndarray:
    """Postures facing the slice with the elbow up, over the wrist."""
    upper = [(-0.1, -0.3), (0.5, 0.2), (0.9, -0.6)]
    wrist = itertools.product((-2.0, 0.5, 2.5), (-1.2, 1.2))
    return np.array([[angle, *arm, r, b, -r] for arm in upper for r, b in wrist])


def cell(arms: Arms, limits, angle: float, radius: float, height: float, reference, turn: float):
    """Largest errors over nine orientations and two wrists, the combination that gave the largest
    position error, and how many combinations were reached: (mm, mrad, name, count)."""
    low = np.maximum(limits[0], arms.low)
    high = np.minimum(limits[1], arms.high)
    place = kinematics.rot_z(angle) @ kinematics.trans(radius, 0, height)
    results = []
    for signs in SIGNS:
        wanted = place.copy()
        relative = Rotation.from_euler("XYZ", np.array(signs) * turn).as_matrix()
        wanted[:3, :3] = wanted[:3, :3] @ reference @ relative
        flange = wanted @ np.linalg.inv(arms.dh_tool)
        found = inverse.all_solutions(arms.dh, flange, starts(angle))
        for q in found:
            branch = branch_of(arms.dh, q)
            q = np.array([*map(inverse.best_turn, q, zip(low, high, strict=True))])
            if branch not in BRANCHES or not ((q >= low) & (q <= high)).all():
                continue
            apart = kinematics.apart(arms.true_at(q), arms.model_at(q))
            letters = " ".join(
                f"{axis}{'-0+'[sign + 1]}" for axis, sign in zip("XYZ", signs, strict=True)
            )
            results.append((*apart, f"{letters}, {branch}"))
    if not results:
        return math.nan, math.nan, None, 0
    return (
        max(r[0] for r in results),
        max(r[1] for r in results),
        max(results)[2],
        len(results),
    )
