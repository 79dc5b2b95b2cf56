"""Answers of ``predict`` and ``compensate`` as sheets, with warnings, and the joints asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kinacc.cli.sheet import Field
from kinacc.geometry import Pose, quaternion_from_rotation

if TYPE_CHECKING:
    from kinacc.deployment.record import Calibration

UNLIKE = "the joints together are unlike those measured"


def facts(calibration: Calibration, frame: str, point: str) -> dict[str, str]:
    """What all rows of an answer have in common."""
    return calibration.facts(frame, point)


def orientation_remark(calibration: Calibration, point: str) -> str:
    """Where the orientation of a point comes from, if no reading has it, for a title."""
    stated = calibration.orientation_source(point) == "stated"
    return " (orientation as stated in the robot file)" if stated else ""


def joint_fields(prismatic: np.ndarray, joints: np.ndarray) -> list[Field]:
    """Reported joints (n, k) in degrees, or mm where a joint slides (k,)."""
    return [
        Field(f"q{i + 1}_mm", joints[:, i], "mm", f"joint {i + 1}")
        if slides
        else Field(f"q{i + 1}_deg", np.rad2deg(joints[:, i]), "deg", f"joint {i + 1}")
        for i, slides in enumerate(prismatic)
    ]


def pose_fields(pose: Pose, frame: str) -> list[Field]:
    """Position and unit quaternion of poses (n, ...), NaN where there is none."""
    known = np.isfinite(pose.position_mm[:, 0])
    quaternion = np.full((len(known), 4), np.nan)
    quaternion[known] = quaternion_from_rotation(pose.rotation[known])
    about = f"in the {frame} frame"
    position = [
        Field(f"{axis}_mm", pose.position_mm[:, i], "mm", about) for i, axis in enumerate("xyz")
    ]
    turn = [Field(f"q{part}", quaternion[:, i], "1", about) for i, part in enumerate("wxyz")]
    return position + turn


def joints_in_words(outside: np.ndarray) -> str:
    """The joints a mask (k,) marks: joint 2, or joints 2, 4."""
    numbers = [str(joint + 1) for joint in np.flatnonzero(outside)]
    return f"joint{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}"
