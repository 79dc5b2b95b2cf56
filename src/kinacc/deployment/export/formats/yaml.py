"""A robot file that ``kinacc.kinematics.robot.load`` reads back to the same arm, bit by bit."""

from __future__ import annotations

from dataclasses import replace

from kinacc.deployment.export.source import CONVENTION, Source
from kinacc.deployment.record import TOOL
from kinacc.geometry import compose, invert
from kinacc.kinematics.robot import as_yaml

ENDING, ANY_MODEL = ".yaml", False


def text(source: Source) -> str:
    """The file, with what the poses leave open in comments."""
    arm = source.calibration
    robot, tool = arm.robot, arm.robot.tool
    if TOOL in arm.targets:
        tool = compose(invert(robot.flange), arm.targets[TOOL])
    calibrated = replace(
        robot, name=source.name, source=source.about, date="", dh=source.dh, tool=tool
    )
    heading = (
        f"{robot.name} as calibrated by data set {arm.name} ({arm.choice} model).",
        f"{CONVENTION}; angles in rad, lengths in mm.",
        *source.orientation_lines,
        *source.left_open_lines,
    )
    return as_yaml(calibrated, heading)
