"""Nominal description of an arm: joints, limits, how reported joints turn the axes.

A robot is one of the shipped ones, a YAML file or a URDF file (docs/robots.md).
"""

from kinacc.kinematics.robot.description import as_yaml, files, load, of_text, shipped
from kinacc.kinematics.robot.record import Robot, carried, forward, in_own_units, outside_limits

__all__ = [
    "Robot",
    "as_yaml",
    "carried",
    "files",
    "forward",
    "in_own_units",
    "load",
    "of_text",
    "outside_limits",
    "shipped",
]
