"""Read or synthesise the measured poses, deal them into folds, and write down the robot."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from kinacc.config.records import Settings
from kinacc.kinematics import region, robot
from kinacc.measurements.folds import split
from kinacc.measurements.reader import read
from kinacc.synthetic import measure
from kinacc.tables.columns import Tables
from kinacc.tables.contract import columns_of


def run(inputs: Mapping[str, Any], settings: Settings) -> Tables:
    """``measurements`` of the configured source, with fold and subset, and ``robot``."""
    arm, section = robot.load(settings["robot"]), settings["measurements"]
    if section["source"] == "synthetic":
        columns = measure(arm, section["synthetic"], attitude(settings["evaluation"]))
    else:
        reading = read(section["file"], arm)
        for message in reading.left_out():
            warnings.warn(message, stacklevel=1)
        columns = reading.columns
    row = (arm.name, arm.source or None, arm.date or None, robot.as_yaml(arm))
    return {"measurements": split(columns, settings), "robot": columns_of("robot", [row])}


def attitude(evaluation: Settings) -> region.Attitude:
    """The flange's attitude in the ``evaluation`` settings, which a calibration has to cover."""
    euler_rad = np.deg2rad(evaluation["reference_orientation_deg"])
    return region.Attitude(region.reference_rotation(euler_rad), evaluation["reference_frame"])
