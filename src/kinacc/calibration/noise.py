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
    base, target = observations.session, observations.target
    error_mm = observations.position_mm - frames.seen(nominal, observations).position_mm
    same = configurations(observations.pose, observations.q_rad)
    label = np.column_stack([same, base, target])
    group = np.unique(label, axis=0, return_inverse=True)[1].ravel()
    rows = np.flatnonzero(np.bincount(group)[group] > 1)
    if not rows.size:
        return UNKNOWN
    repeated = pd.DataFrame(error_mm[rows])
    medians = repeated.groupby(group[rows]).transform("median").to_numpy()
    distance = np.linalg.norm(error_mm[rows] - medians, axis=1)
    rows = rows[distance <= _GROSS * max(float(np.median(distance)), 1e-12)]
    rows = rows[np.bincount(group)[group[rows]] > 1]
    mean_square, freedom = scatter(error_mm[rows], pd.factorize(group[rows])[0])
    std_mm = np.sqrt(np.diag(mean_square)) if freedom else np.full(3, np.nan)
    return Noise(std_mm, freedom, len(rows), int(np.unique(same[rows]).size))


def scatter(values: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, int]:
    """Mean square of values about the means of their groups.

    Parameters
    ----------
    values : numpy.ndarray
        Shape (n, k).
    group : numpy.ndarray
        Number of the group of each row, shape (n,), from 0 without gaps.

    Returns
    -------
    mean_square : numpy.ndarray
        Shape (k, k), in the square of the unit of ``values``.
    freedom : int
        Rows beyond the first of each group.
    """
    mean, count = means(values, group)
    centred, freedom = values - mean[group], int(np.sum(count - 1))
    return centred.T @ centred / max(freedom, 1), freedom


def means(values: np.ndarray, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of values in every group.

    Parameters
    ----------
    values, group
        See ``scatter``.

    Returns
    -------
    mean : numpy.ndarray
        Shape (g, k).
    count : numpy.ndarray
        Rows of each group, shape (g,).
    """
    count = np.bincount(group)
    sums = [np.bincount(group, column) for column in values.T]
    return np.stack(sums, axis=1) / count[:, None], count
