"""A robot as the text of a robot YAML, which reads back to the same numbers."""

from __future__ import annotations

import json
from collections.abc import Iterable

import numpy as np

from kinacc.geometry import IDENTITY, Pose, quaternion_from_rotation
from kinacc.kinematics.dh import PARAMETERS
from kinacc.kinematics.robot.record import Robot


def as_yaml(robot: Robot, heading: Iterable[str] = ()) -> str:
    """Robot file of ``robot`` in standard DH, lengths in mm and angles in rad.

    ``heading`` are lines of comment at the top. ``kinacc.kinematics.robot.of_text`` reads joints
    and limits back bit by bit, and turns of the frames to rounding.
    """
    lines = [f"# {line}" for line in heading]
    about = {"name": robot.name, "source": robot.source, "date": robot.date}
    lines += [f"{key}: {json.dumps(value)}" for key, value in about.items() if value]
    signs = np.diag(robot.joint_map)
    simple = np.array_equal(robot.joint_map, np.diag(signs)) and (np.abs(signs) == 1.0).all()
    lines.append("dh:")
    lines += [_row(robot, joint, simple) for joint in range(robot.dh.joints)]
    if not simple:
        lines.append("joint_map: # DH joints = joint_map times reported joints")
        lines += [f"  - {[float(value) for value in row]}" for row in robot.joint_map]
    for name in ("base", "flange", "tool"):
        lines += _frame(name, getattr(robot, name))
    return "\n".join(lines) + "\n"


def _row(robot: Robot, joint: int, signed: bool) -> str:
    entries = [f"{name}: {float(getattr(robot.dh, name)[joint])!r}" for name in PARAMETERS]
    if robot.joint_names and robot.joint_names[joint] != f"joint {joint + 1}":
        entries.insert(0, f"name: {json.dumps(robot.joint_names[joint])}")
    limits = [float(robot.q_min_rad[joint]), float(robot.q_max_rad[joint])]
    if robot.dh.prismatic[joint]:
        entries += ["joint: prismatic", f"limits_mm: {limits}"]
    else:
        entries.append(f"limits_rad: {limits}")
    if signed and robot.joint_map[joint, joint] < 0.0:
        entries.append("sign: -1")
    return f"  - {{{', '.join(entries)}}}"


def _frame(name: str, pose: Pose) -> list[str]:
    if all(np.array_equal(own, none) for own, none in zip(pose, IDENTITY, strict=True)):
        return []
    position = [float(value) for value in pose.position_mm]
    turn = [float(value) for value in quaternion_from_rotation(pose.rotation)]
    return [f"{name}:", f"  position_mm: {position}", f"  quaternion_wxyz: {turn}"]
