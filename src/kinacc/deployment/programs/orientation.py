"""Frames as controllers write them: six numbers, or seven with a quaternion."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kinacc.errors import input_error
from kinacc.geometry import Pose

Orientation = Literal["ZYX", "xyz", "XYZ", "quaternion", "rotation vector"]
KUKA: Final = "ZYX"
FIXED: Final = "xyz"
INTRINSIC: Final = "XYZ"
QUATERNION: Final = "quaternion"
VECTOR: Final = "rotation vector"
_UNIT = 1e-3


class Convention(NamedTuple):
    """How a controller writes a frame.

    ``orientation``: KUKA, R = Rz(A) Ry(B) Rx(C); FIXED, R = Rz(R) Ry(P) Rx(W); INTRINSIC,
    R = Rx Ry Rz; QUATERNION w, x, y, z; VECTOR, a rotation vector. ``length_mm`` and
    ``angle_deg``: mm and degrees of the written units.
    """

    orientation: Orientation
    length_mm: float = 1.0
    angle_deg: float = 1.0

    def pose(self, numbers: np.ndarray, where: str = "orientation") -> Pose:
        """The frame of written numbers; InputError for a quaternion far from length 1."""
        position, turn = self.length_mm * np.asarray(numbers[:3]), np.asarray(numbers[3:])
        if self.orientation == QUATERNION:
            length = np.linalg.norm(turn)
            if abs(length - 1.0) > _UNIT:
                raise input_error(where, f"has a quaternion of length {length:.4g}", "1")
            rotation = Rotation.from_quat(turn, scalar_first=True)
        elif self.orientation == VECTOR:
            rotation = Rotation.from_rotvec(self.angle_deg * turn, degrees=True)
        else:
            rotation = Rotation.from_euler(self.orientation, self.angle_deg * turn, degrees=True)
        return Pose(rotation.as_matrix(), position)

    def numbers(self, pose: Pose, near: np.ndarray) -> np.ndarray:
        """The numbers of a frame, of equal ones those nearest to ``near``."""
        rotation, near = Rotation.from_matrix(pose.rotation), np.asarray(near[3:])
        unit = self.angle_deg
        if self.orientation == QUATERNION:
            quaternion, unit = rotation.as_quat(scalar_first=True), 1.0
            ways = [quaternion, -quaternion]
        elif self.orientation == VECTOR:
            vector = rotation.as_rotvec(degrees=True)
            turn = 360.0 * vector / max(float(np.linalg.norm(vector)), 1e-12)
            ways = [vector, vector - turn, vector + turn]
        else:
            first = rotation.as_euler(self.orientation, degrees=True, suppress_warnings=True)
            second = first * [1.0, -1.0, 1.0] + 180.0
            ways = [way + 360.0 * np.rint((unit * near - way) / 360.0) for way in (first, second)]
        best = min(ways, key=lambda way: float(np.linalg.norm(way - unit * near)))
        return np.concatenate([pose.position_mm / self.length_mm, best / unit])

    def typed(self, numbers: np.ndarray) -> Pose:
        """A frame as a person gives it, in mm and degrees; fixed angles for a quaternion."""
        orientation, count = self.orientation, len(numbers)
        if orientation == QUATERNION and count == 6:
            orientation = FIXED
        if count != 6 + (orientation == QUATERNION):
            raise input_error("frame", f"has {count} numbers", "6, mm and deg")
        return Convention(orientation).pose(numbers)
