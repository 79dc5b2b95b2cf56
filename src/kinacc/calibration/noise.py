"""The noise of one reading, by the readings taken again at one configuration."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from kinacc.calibration.frames import closed_form_start
from kinacc.calibration.observations import Observations, from_columns
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.robot import Robot
from kinacc.measurements.folds import configurations

_GROSS = 6.0  # medians: a reading this far from the others of its configuration is no noise


@dataclass(frozen=True)
class Noise:
    """Standard deviation of one reading, pooled over configurations with several readings.

    Attributes
    ----------
    std_mm
        Per axis of the instrument, shape (3,); NaN without repeated readings.
    freedom
        Degrees of freedom of each axis.
    readings, configurations
        Repeated readings that were used, and at how many configurations.
    """

    std_mm: np.ndarray
    freedom: int
    readings: int
    configurations: int

    @property
    def per_axis_mm(self) -> float:
        """Root mean square of the three axes."""
        return per_axis_mm(self.std_mm)


def per_axis_mm(std_mm: np.ndarray) -> float:
    """One number for the standard deviations (3,) of the axes: their root mean square."""
    return float(np.sqrt(np.mean(np.square(std_mm))))


UNKNOWN = Noise(np.full(3, np.nan), 0, 0, 0)


def of_measurements(columns: Mapping[str, np.ndarray], robot: Robot) -> Noise:
    """Noise of one reading, see :func:`of_readings`.

    Parameters
    ----------
    columns : mapping
        Table ``measurements``.
    robot : Robot
        The arm that was measured.

    Returns
    -------
    Noise
        Standard deviations per axis of the instrument, mm.
    """
    return of_readings(from_columns(columns, robot), robot.dh)


def of_readings(observations: Observations, nominal: DHModel) -> Noise:
    """Noise of one reading: the estimate for checks, calibrations, pages and campaigns.

    Readings of one session and target are compared where the arm stands in one configuration, as
    held-out folds define it: the same pose, or joints that agree within 0.1 degrees. The nominal
    model takes out what these joints differ. The noise contains the instrument and, where the arm
    came back, how well it repeats a configuration. Readings more than six medians from the median
    of their configuration are left out.

    Parameters
    ----------
    observations
        Readings of one file. Two readings of a configuration give one degree of freedom.
    nominal
        DH model of the robot. Where the flange turns, errors of 4 mrad and 2 mm change the noise
        by 2 % or less. Where it points one way they hide the tool, and the noise is overstated.
    """
    frames = closed_form_start(observations, nominal.pose(observations.at))
    error_mm = observations.position_mm - frames.seen(nominal, observations).position_mm
    same = configurations(observations.pose, observations.q_rad)
    groups, axes = ["configuration", "session", "target"], ["x_mm", "y_mm", "z_mm"]
    readings = pd.DataFrame(error_mm, columns=axes).assign(
        configuration=same, session=observations.session, target=observations.target
    )
    readings = readings[readings.duplicated(groups, keep=False)]
    if readings.empty:
        return UNKNOWN
    medians = readings.groupby(groups)[axes].transform("median")
    distance = np.linalg.norm(readings[axes] - medians, axis=1)
    readings = readings[distance <= _GROSS * max(float(np.median(distance)), 1e-12)]
    readings = readings[readings.duplicated(groups, keep=False)]
    by_group = readings.groupby(groups)[axes]
    freedom = len(readings) - by_group.ngroups
    squares = ((readings[axes] - by_group.transform("mean")) ** 2).sum()
    std_mm = np.sqrt(squares.to_numpy() / freedom) if freedom else np.full(3, np.nan)
    return Noise(std_mm, freedom, len(readings), readings["configuration"].nunique())
