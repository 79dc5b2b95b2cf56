"""The first poses of a file as they were understood, for people to look at before they go on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
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
    poses = []
    table = pd.DataFrame(reading.columns)
    for _, rows in list(table.groupby("pose", sort=False))[:_POSES]:
        joints = rows.iloc[0][[f"q{i + 1}" for i in range(len(prismatic))]].to_numpy(float)
        line, targets = int(rows["row"].iloc[0]), rows.drop_duplicates("target")
        pose = {"line": line, "where": reading.row_names.one(line)}
        pose["joints"] = np.round(np.where(prismatic, joints, np.rad2deg(joints)), 4).tolist()
        pose["targets"] = [_target(row) for _, row in targets.iterrows()]
        poses.append(pose | {"again": int(rows["target"].value_counts().max()) - 1})
    return poses


def poses_without_robot(guess: Guess) -> list[dict[str, object]]:
    """The same where no robot is known: joints need none to be read."""
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.intake.write import template_text
    from kinacc.measurements.reader import read

    arm = robots.of_text(template_text("any", guess.joints), "any.yaml")
    return first_poses(read(guess.section, arm, strict=False), arm.dh.prismatic)


def _target(row: pd.Series) -> dict[str, object]:
    target = {"target": str(row["target"])} | {f"{a}_mm": round(row[f"{a}_mm"], 4) for a in "xyz"}
    quaternion = row[["qx", "qy", "qz", "qw"]].to_numpy(float)
    if np.isfinite(quaternion).all():
        vector = Rotation.from_quat(quaternion).as_rotvec(degrees=True)
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])
        target |= {"turned_deg": round(angle, 4), "about": np.round(axis, 4).tolist()}
    return target


def in_words(poses: list[dict]) -> list[str]:
    """The poses as lines of text."""
    lines = ["the first poses, as they are understood (joints in deg, positions in mm):"]
    for pose in poses:
        lines.append(f"  {pose['where']}: joints {_numbers(pose['joints'])}")
        for target in pose["targets"]:
            line = f"    {target['target']} at {_numbers(target[f'{axis}_mm'] for axis in 'xyz')}"
            if "about" in target:
                line += f", turned by {target['turned_deg']:.3f} deg about "
                line += f"({_numbers(target['about'])})"
            lines.append(line)
        if pose["again"]:
            lines.append(f"    more readings of it: {pose['again']}")
    return lines


def _numbers(values) -> str:
    return ", ".join(f"{value:.3f}" for value in values)
