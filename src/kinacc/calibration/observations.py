"""Measured points and poses as one frozen record of columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from kinacc.geometry import Pose, rotation_from_quaternion
from kinacc.kinematics.model import PAYLOAD_COLUMNS, JointState
from kinacc.kinematics.robot import Robot

TOOL = "tool"


@dataclass(frozen=True)
class Observations:
    """n measurements of targets carried by a k-joint arm; a pose may show several targets.

    Attributes
    ----------
    q_rad : numpy.ndarray
        DH joints, shape (n, k), rad or mm.
    s : numpy.ndarray
        Travel directions -1, 0 (unknown) or 1, shape (n, k).
    position_mm : numpy.ndarray
        In the instrument's frame, shape (n, 3).
    rotation : numpy.ndarray
        In the instrument's frame, shape (n, 3, 3); NaN where only the position was measured.
    pose, target, repeat, fold : numpy.ndarray
        Integers, shape (n,): target an index into ``target_names``, fold -1 where none is assigned.
    session : numpy.ndarray
        Index into ``session_names``, shape (n,), each with a base of its own.
    payload : numpy.ndarray
        Mass in kg and centre in the last DH frame in mm, shape (n, 4); NaN where not stated.
    """

    q_rad: np.ndarray
    s: np.ndarray
    position_mm: np.ndarray
    rotation: np.ndarray
    pose: np.ndarray
    target: np.ndarray
    repeat: np.ndarray
    fold: np.ndarray
    session: np.ndarray
    payload: np.ndarray
    target_names: tuple[str, ...] = (TOOL,)
    session_names: tuple[str | None, ...] = (None,)

    def __len__(self) -> int:
        return len(self.q_rad)

    @property
    def joints(self) -> int:
        """Number of joints k."""
        return self.q_rad.shape[1]

    @property
    def at(self) -> JointState:
        """How the arm stood."""
        return JointState(self.q_rad, self.s, self.payload)

    @property
    def has_rotation(self) -> np.ndarray:
        """True (n,) where the orientation was measured."""
        return np.isfinite(self.rotation[:, 0, 0])

    @property
    def components(self) -> int:
        """Number of scalar residuals: three per position and three per orientation."""
        return 3 * len(self) + 3 * int(self.has_rotation.sum())

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and axis (components,) of every residual: 0 to 2 of position, 3 to 5 of rotation."""
        measured = np.stack([np.ones(len(self), bool), self.has_rotation], axis=1)
        row, axis = np.nonzero(np.repeat(measured, 3, axis=1))
        return row, axis

    @property
    def measured(self) -> Pose:
        """Measured frames (n,); rotations are NaN where none was measured."""
        return Pose(self.rotation, self.position_mm)

    def select(self, rows: np.ndarray | slice) -> Self:
        """The observations of ``rows`` (mask, indices or slice)."""
        columns = {
            column.name: getattr(self, column.name)[rows]
            for column in fields(self)
            if not column.name.endswith("_names")
        }
        return replace(self, **columns)


def full_poses(q_rad: np.ndarray, poses: Pose, s: ArrayLike = 0) -> Observations:
    """Observations of one full-pose target, one row per pose.

    Parameters
    ----------
    q_rad : numpy.ndarray
        DH joints, shape (n, k), rad or mm.
    poses : Pose
        Measured poses in the instrument's frame, shape (n, ...) in mm.
    s : numpy.ndarray, optional
        Travel directions, shape (n, k); unknown if not given.

    Returns
    -------
    Observations
        n rows of the target ``tool``, none in a fold.
    """
    q_rad = np.asarray(q_rad, dtype=float)
    count = len(q_rad)
    zeros = np.zeros(count, dtype=np.int64)
    return Observations(
        q_rad=q_rad,
        s=np.broadcast_to(np.asarray(s, np.int8), q_rad.shape),
        position_mm=np.asarray(poses.position_mm, dtype=float),
        rotation=np.asarray(poses.rotation, dtype=float),
        pose=np.arange(count),
        target=zeros,
        repeat=zeros,
        fold=np.full(count, -1),
        session=zeros,
        payload=np.full((count, 4), np.nan),
    )


def from_columns(columns: Mapping[str, np.ndarray], robot: Robot) -> Observations:
    """Observations from the columns of ``measurements``.

    Parameters
    ----------
    columns : mapping
        Reported joints ``q1`` .., directions ``s1`` .., position in mm, quaternion, and the numbers
        of pose, target, repeat; session, fold and payload where there are any.
    robot : Robot
        The arm they were made with, which turns reported joints into DH joints.

    Returns
    -------
    Observations
        One row for each of the table.
    """

    def stack(*names: str) -> np.ndarray:
        return np.stack([np.asarray(columns[name], dtype=float) for name in names], axis=1)

    count, numbers = len(columns["pose"]), range(1, robot.dh.joints + 1)
    target, target_names = pd.factorize(np.array(columns["target"], dtype=object).astype(str))
    sessions = list(columns.get("session", [None] * count))
    session_names = tuple(dict.fromkeys(sessions))
    fold = np.asarray(columns.get("fold", np.full(count, np.nan)), dtype=float)
    return Observations(
        q_rad=robot.dh_joints(stack(*(f"q{i}" for i in numbers))),
        s=stack(*(f"s{i}" for i in numbers)).astype(np.int8),
        position_mm=stack("x_mm", "y_mm", "z_mm"),
        rotation=rotation_from_quaternion(stack("qw", "qx", "qy", "qz")),
        pose=np.asarray(columns["pose"]).astype(np.int64),
        target=target,
        repeat=np.asarray(columns["repeat"]).astype(np.int64),
        fold=np.nan_to_num(fold, nan=-1.0).astype(np.int64),
        target_names=tuple(target_names.tolist()),
        session=np.array([session_names.index(name) for name in sessions], dtype=np.int64),
        session_names=session_names,
        payload=stack(*PAYLOAD_COLUMNS)
        if PAYLOAD_COLUMNS[0] in columns
        else np.full((count, 4), np.nan),
    )
