"""The first poses of a file as they were understood, for people to look at before they go on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

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
        of_target = columns["target"][rows].astype(str)
        _, first, times = np.unique(of_target, return_index=True, return_counts=True)
        line = int(columns["row"][rows[0]])
        q = np.array([columns[f"q{i + 1}"][rows[0]] for i in range(len(prismatic))])
        shown.append(
            {
                "line": line,
                "where": reading.row_names.one(line),
                "joints": [
                    float(f"{value:.4f}") for value in np.where(prismatic, q, np.rad2deg(q))
                ],
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
    told: dict[str, object] = {"target": str(columns["target"][row])}
    for axis in "xyz":
        told[f"{axis}_mm"] = float(f"{columns[f'{axis}_mm'][row]:.4f}")
    w, *vector = (float(columns[f"q{part}"][row]) for part in "wxyz")
    if np.isfinite(w):
        length = float(np.linalg.norm(vector))
        axis = np.array(vector) / length if length > 1e-12 else np.array([0.0, 0.0, 1.0])
        axis = axis if w >= 0.0 else -axis
        told["turned_deg"] = float(f"{np.rad2deg(2.0 * np.arctan2(length, abs(w))):.4f}")
        told["about"] = [float(f"{part:.4f}") for part in axis]
    return told


def in_words(shown: list[dict]) -> list[str]:
    """The poses as lines of text."""
    lines = ["the first poses, as they are understood (joints in deg, positions in mm):"]
    for pose in shown:
        joints = ", ".join(f"{value:.3f}" for value in pose["joints"])
        lines.append(f"  {pose['where']}: joints {joints}")
        for each in pose["targets"]:
            point = ", ".join(f"{each[f'{axis}_mm']:.3f}" for axis in "xyz")
            turn = ""
            if "about" in each:
                about = ", ".join(f"{part:.3f}" for part in each["about"])
                turn = f", turned by {each['turned_deg']:.3f} deg about ({about})"
            lines.append(f"    {each['target']} at {point}{turn}")
        if pose["again"]:
            more = "more reading" if pose["again"] == 1 else "more readings"
            lines.append(f"    and {pose['again']} {more} of it")
    return lines
