"""Names of postures: which branch joints belong to, read off the nominal arm.

Six joints that turn are named as the closed forms name them (``front-up-noflip``), whatever the
arm: by the side of axis 1 on which joint 1 faces the last axis, by axis 3 above or below the line
from axis 2 to the fourth frame, and by the side on which joint 5 bends. Arms with other joints are
named by the sides to which some of them turn from their DH zero (``q2+ q5-``); seven axes by
whether joint 3 turns less than a quarter (``fore``) or more (``aft``), and by the sides of joints 4
and 6. A general arm may have several postures of one name; they are numbered in the order of their
third joint.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.inverse.closed_form import BRANCHES

_BY_SIGN = {4: (1,), 5: (1, 2), 6: (1, 2, 4), 7: (3, 5)}


def names_of(dh: DHModel) -> tuple[str, ...]:
    """Names of the postures of an arm, before they are numbered."""
    if _by_sides(dh):
        return BRANCHES
    joints = _BY_SIGN[dh.joints]
    names = [
        " ".join(f"q{joint + 1}{sign}" for joint, sign in zip(joints, signs, strict=True))
        for signs in product("+-", repeat=len(joints))
    ]
    if dh.joints == 7:
        names = [f"{half} {name}" for half in ("fore", "aft") for name in names]
    return tuple(names)


def classes_of(dh: DHModel, q_rad: np.ndarray) -> np.ndarray:
    """Place (n,) of DH joints (n, k) in ``names_of``."""
    if _by_sides(dh):
        return _sides(dh, q_rad)
    place = np.zeros(len(q_rad), dtype=int)
    if dh.joints == 7:
        place += np.cos(_theta(dh, q_rad, 2)) < 0.0
    for joint in _BY_SIGN[dh.joints]:
        value = q_rad[:, joint] if dh.prismatic[joint] else np.sin(_theta(dh, q_rad, joint))
        place = 2 * place + (value < 0.0)
    return place


def _by_sides(dh: DHModel) -> bool:
    return dh.joints == 6 and not dh.prismatic.any()


def _sides(dh: DHModel, q_rad: np.ndarray) -> np.ndarray:
    frames = _dh.chain(dh, q_rad).position_mm
    theta_1, theta_5 = _theta(dh, q_rad, 0), _theta(dh, q_rad, 4)
    ahead = np.stack([np.cos(theta_1), np.sin(theta_1)], axis=1)

    def forward(vector: np.ndarray) -> np.ndarray:
        return np.einsum("ni,ni->n", ahead, vector[:, :2])

    shoulder, elbow, centre = frames[:, 1], frames[:, 2], frames[:, 4]
    front = forward(frames[:, 5]) >= 0.0
    above = forward(centre - shoulder) * (elbow - shoulder)[:, 2]
    above -= (centre - shoulder)[:, 2] * forward(elbow - shoulder)
    up = (above > 0.0) == front
    bent = np.sin(theta_5) * (1.0 if np.cos(dh.theta_offset_rad[4]) >= 0.0 else -1.0)
    return 4 * ~front + 2 * ~up + (bent < 0.0)


def _theta(dh: DHModel, q_rad: np.ndarray, joint: int) -> np.ndarray:
    return q_rad[:, joint] + dh.theta_offset_rad[joint]
