"""The first poses of a file as they were understood, for people to look at before they go on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from kinacc.measurements.intake.guess import Guess
    from kinacc.measurements.reader import MeasuredFile

_POSES = 3


def first_poses(reading: MeasuredFile, prismatic: np.ndarray) -> list[dict[str, object]]:
    """Line, joints and targets of the first poses, in deg and mm, each as it was read first.

    ``again`` counts the readings after that. Orientations are a turn in deg about an axis of the
    instrument's frame.
    """
    columns = reading.columns
    shown = []
    for pose in list(dict.fromkeys(columns["pose"].tolist()))[:_POSES]:
        rows = np.flatnonzero(columns["pose"] == pose)
        _, first, times = np.unique(
            columns["target"][rows].astype(str), return_index=True, return_counts=True
        )
        q = np.array([columns[f"q{i + 1}"][rows[0]] for i in range(len(prismatic))])
        line = int(columns["row"][rows[0]])
        shown.append(
            {
                "line": line,
                "where": reading.row_names.one(line),
                "joints": np.round(np.where(prismatic, q, np.rad2deg(q)), 4).tolist(),
                "targets": [_target(columns, row) for row in rows[np.sort(first)]],
                "again": int(times.max()) - 1,
            }
        )
    return shown


def poses_without_robot(guess: Guess) -> list[dict[str, object]]:
    """The same where no robot is known: joints need none to be read."""
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.intake.write import template_text
    from kinacc.measurements.reader import read

    arm = robots.of_text(template_text("any", guess.joints), "any.yaml")
    return first_poses(read(guess.section, arm, strict=False), arm.dh.prismatic)


def _target(columns, row: int) -> dict[str, object]:
    target: dict[str, object] = {"target": str(columns["target"][row])}
    target |= {f"{a}_mm": round(float(columns[f"{a}_mm"][row]), 4) for a in "xyz"}
    quaternion = [float(columns[f"q{part}"][row]) for part in "xyzw"]
    if np.isfinite(quaternion).all():
        vector = Rotation.from_quat(quaternion).as_rotvec(degrees=True)
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])
        target |= {"turned_deg": round(angle, 4), "about": np.round(axis, 4).tolist()}
    return target


def in_words(shown: list[dict]) -> list[str]:
    """The poses as lines of text."""
    lines = ["the first poses, as they are understood (joints in deg, positions in mm):"]
    for pose in shown:
        lines.append(f"  {pose['where']}: joints {', '.join(f'{q:.3f}' for q in pose['joints'])}")
        for target in pose["targets"]:
            point = ", ".join(f"{target[f'{axis}_mm']:.3f}" for axis in "xyz")
            turn = ""
            if "about" in target:
                about = ", ".join(f"{part:.3f}" for part in target["about"])
                turn = f", turned by {target['turned_deg']:.3f} deg about ({about})"
            lines.append(f"    {target['target']} at {point}{turn}")
        if pose["again"]:
            lines.append(f"    more readings of it: {pose['again']}")
    return lines
