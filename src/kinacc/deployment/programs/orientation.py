"""Frames as controllers write them: six numbers, or seven with a quaternion."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, log_so3, quaternion_from_rotation, rotation_from_quaternion

KUKA, FIXED, INTRINSIC = "A, B, C", "W, P, R", "intrinsic x, y, z"
QUATERNION, VECTOR = "q1 .. q4", "rotation vector"
_AXES = {KUKA: "ZYX", FIXED: "xyz", INTRINSIC: "XYZ"}
_UNIT = 1e-3
_TURN = 360.0
_LOCKED = 1e-7


class Convention(NamedTuple):
    """How a controller writes a frame.

    ``orientation``: KUKA, R = Rz(A) Ry(B) Rx(C); FIXED, R = Rz(R) Ry(P) Rx(W); INTRINSIC,
    R = Rx Ry Rz; QUATERNION w, x, y, z; VECTOR, a rotation vector. ``length_mm`` and
    ``angle_deg``: mm and degrees of the written units.
    """

    orientation: str
    length_mm: float = 1.0
    angle_deg: float = 1.0

    def pose(self, numbers: np.ndarray) -> Pose:
        """The frame of written numbers; InputError for a quaternion far from length 1."""
        position, turn = self.length_mm * np.asarray(numbers[:3]), np.asarray(numbers[3:])
        if self.orientation == QUATERNION:
            length = np.linalg.norm(turn)
            if abs(length - 1.0) > _UNIT:
                what = f"the quaternion {list(map(float, turn))} has length {length:.4g}"
                raise InputError(Problem("orientation", what, "length 1"))
            return Pose(rotation_from_quaternion(turn / length), position)
        angles = self.angle_deg * turn
        if self.orientation == VECTOR:
            return Pose(Rotation.from_rotvec(angles, degrees=True).as_matrix(), position)
        axes = _AXES[self.orientation]
        return Pose(Rotation.from_euler(axes, angles, degrees=True).as_matrix(), position)

    def numbers(self, pose: Pose, near: np.ndarray) -> np.ndarray:
        """The numbers of a frame, of equal ones those nearest to ``near``."""
        near = np.asarray(near[3:])
        position = pose.position_mm / self.length_mm
        if self.orientation == QUATERNION:
            turn = quaternion_from_rotation(pose.rotation)
            return np.concatenate([position, -turn if turn @ near < 0.0 else turn])
        near = self.angle_deg * near
        if self.orientation == VECTOR:
            vector = np.rad2deg(log_so3(pose.rotation))
            angle = np.linalg.norm(vector)
            axis = vector / angle if angle > 0.0 else vector
            ways = [axis * (angle + whole * _TURN) for whole in (-1, 0, 1)]
        else:
            a, b, c = _euler(pose.rotation, _AXES[self.orientation], near)
            ways = [np.array([a, b, c]), np.array([a + 180.0, 180.0 - b, c + 180.0])]
            ways = [way + _TURN * np.rint((near - way) / _TURN) for way in ways]
        best = min(ways, key=lambda way: np.linalg.norm(way - near))
        return np.concatenate([position, best / self.angle_deg])

    def typed(self, numbers: np.ndarray) -> Pose:
        """A frame as --tool and --base give it, in mm and degrees.

        Six numbers; where the controller writes quaternions, fixed x, y, z angles or seven numbers.
        """
        numbers = np.asarray(numbers, dtype=float)
        if self.orientation == QUATERNION and len(numbers) == 6:
            return Convention(FIXED).pose(numbers)
        return Convention(self.orientation).pose(numbers)


def _euler(rotation: np.ndarray, axes: str, near: np.ndarray) -> np.ndarray:
    """Angles about three axes; where the first and the last turn alike, the last as in ``near``."""
    if axes.islower():
        return _euler(rotation, axes[::-1].upper(), near[::-1])[::-1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # at a middle angle of 90 deg, mended below
        a, b, c = Rotation.from_matrix(rotation).as_euler(axes, degrees=True)
    if np.cos(np.deg2rad(b)) < _LOCKED:
        sign = np.sign(b) if axes == "ZYX" else -np.sign(b)
        a, c = a + sign * (near[2] - c), near[2]
    return np.array([a, b, c])
