"""The nominal arm as a record, and what follows from it alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from kinacc.errors import input_error
from kinacc.geometry import IDENTITY, Pose, compose, numbers
from kinacc.kinematics import dh as _dh
from kinacc.kinematics.dh import DHModel

FEWEST_JOINTS, MOST_JOINTS = 4, 7


@dataclass(frozen=True)
class Robot:
    """An arm as its maker describes it.

    Attributes
    ----------
    name : str
        Name of the arm.
    dh : DHModel
        Nominal model of k joints.
    q_min_rad, q_max_rad : numpy.ndarray
        Limits of the reported joints, each (k,), rad (mm where a joint slides).
    joint_map : numpy.ndarray
        Matrix (k, k) from reported to DH joints: signs and couplings.
    source, date : str
        Origin of the figures.
    base : Pose
        First DH frame in the arm's own base frame, mm.
    flange : Pose
        Mechanical flange in the last DH frame, mm. It and ``base`` differ from identity only where
        the description was converted from another form.
    tool : Pose
        Tool centre point in the flange frame, mm.
    joint_names : tuple of str
        Names (k,) of the joints.
    """

    name: str
    dh: DHModel
    q_min_rad: np.ndarray
    q_max_rad: np.ndarray
    joint_map: np.ndarray
    source: str
    date: str = ""
    base: Pose = IDENTITY
    flange: Pose = IDENTITY
    tool: Pose = IDENTITY
    joint_names: tuple[str, ...] = ()

    @classmethod
    def from_name(cls, name: str | Path) -> Robot:
        """Load a shipped robot by its name, or a robot file (YAML, URDF) by its path.

        Raises
        ------
        InputError
            For an unknown name, with the nearest; for a file, with all its problems.

        Examples
        --------
        >>> Robot.from_name("ur10")
        <Robot 'ur10', 6 joints>
        """
        from kinacc.kinematics.robot.description import load

        return load(name)

    def __repr__(self) -> str:
        return f"<Robot {self.name!r}, {self.dh.joints} joints>"

    def forward(self, q_rad: np.ndarray) -> Pose:
        """Poses of the flange by the nominal model.

        Parameters
        ----------
        q_rad
            (n, k) or (k,) joints as the controller reports them, rad (mm where a joint slides).

        Returns
        -------
        Pose
            (n, ...) poses of the flange in the robot's base frame, mm.

        Raises
        ------
        InputError
            For joints of another shape, and NaN.

        Examples
        --------
        >>> Robot.from_name("ur10").forward([0, 0, 0, 0, 0, 0]).position_mm
        array([[-1184.3  ,  -256.141,    11.6  ]])
        """
        end = _dh.forward(self.dh, self.dh_joints(self.finite_joints(q_rad)))
        return compose(compose(self.base, end), self.flange)

    def dh_joints(self, reported: np.ndarray) -> np.ndarray:
        """Convert reported joints to DH joints; ``limits.reported_joints`` goes back.

        Parameters
        ----------
        reported : numpy.ndarray
            Joints as the controller reports them, shape (..., k), rad (mm where a joint slides).

        Returns
        -------
        numpy.ndarray
            DH joints, shape (..., k).

        Raises
        ------
        InputError
            For joints of another shape.
        """
        joints = numbers("joints", reported)
        if joints.shape[-1:] != (self.dh.joints,):
            allowed = f"an array (n, {self.dh.joints}) for the joints of {self.name}"
            raise input_error("joints", f"shape {joints.shape}", allowed)
        return joints @ self.joint_map.T

    def finite_joints(self, reported: ArrayLike, name: str = "joints") -> np.ndarray:
        """Reported joints as an array (n, k); InputError, by ``name``, where they are none."""
        joints = np.atleast_2d(numbers(name, reported))
        finite = np.isfinite(joints)
        if joints.shape[1:] != (self.dh.joints,) or not joints.size or not finite.all():
            received = f"shape {joints.shape}, {finite.sum()} numbers"
            allowed = f"finite numbers (n, {self.dh.joints}) for the joints of {self.name}"
            raise input_error(name, received, allowed)
        return joints

    def dh_box(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Range of the DH joints over a box of reported joints.

        Parameters
        ----------
        low, high : numpy.ndarray
            Ends of the box, each (k,), rad (mm where a joint slides).

        Returns
        -------
        tuple of numpy.ndarray
            Ends (k,), (k,) of the DH joints.
        """
        centre, half = 0.5 * (low + high), 0.5 * (high - low)
        centre, half = self.joint_map @ centre, np.abs(self.joint_map) @ half
        return centre - half, centre + half


forward = Robot.forward


def in_own_units(robot: Robot, joints: np.ndarray) -> np.ndarray:
    """Convert reported joints from degrees to rad; joints that slide stay in mm.

    Parameters
    ----------
    robot : Robot
        Arm of k joints.
    joints : numpy.ndarray
        Joints, shape (..., k), deg (mm where a joint slides).

    Returns
    -------
    numpy.ndarray
        Joints, shape (..., k), rad and mm.
    """
    return np.where(robot.dh.prismatic, joints, np.deg2rad(joints))


def carried(robot: Robot) -> Pose:
    """Tool centre point of the description in the last DH frame: flange, then tool.

    Parameters
    ----------
    robot : Robot
        The arm.

    Returns
    -------
    Pose
        Pose (3, 3), (3,), mm.
    """
    return compose(robot.flange, robot.tool)


@dataclass(frozen=True)
class OutsideLimits:
    """Rows in which a reported joint is beyond its limits.

    Attributes
    ----------
    joint : int
        Number of the joint, from 1.
    rows : numpy.ndarray
        Indices of the rows, shape (m,).
    values : numpy.ndarray
        Joint in these rows, shape (m,), in ``unit``.
    unit : str
        deg, or mm where the joint slides.
    allowed : str
        The limits as text.
    looks_like_degrees : bool
        Whether the joint turns by more than two turns either way.
    """

    joint: int
    rows: np.ndarray
    values: np.ndarray
    unit: str
    allowed: str
    looks_like_degrees: bool


def outside_limits(robot: Robot, joints: np.ndarray, slack: float) -> Iterator[OutsideLimits]:
    """Find the joints that are beyond their limits in some row.

    Parameters
    ----------
    robot : Robot
        Arm of k joints.
    joints : numpy.ndarray
        Reported joints, shape (n, k), rad (mm where a joint slides).
    slack : float
        Excess that is allowed, rad (mm where a joint slides).

    Yields
    ------
    OutsideLimits
        One per joint with such rows.
    """
    limits = zip(joints.T, robot.q_min_rad, robot.q_max_rad, robot.dh.prismatic, strict=True)
    for joint, (values, low, high, slides) in enumerate(limits, 1):
        rows = np.flatnonzero((values < low - slack) | (values > high + slack))
        if rows.size:
            size, unit = (1.0, "mm") if slides else (np.pi / 180.0, "deg")
            allowed = f"{low / size:g} to {high / size:g} {unit} ({robot.name})"
            far = not slides and np.max(np.abs(values)) > 4.0 * np.pi
            yield OutsideLimits(joint, rows, values[rows] / size, unit, allowed, bool(far))
