"""Poses that a calibrated arm is predicted to take, with standard deviations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from kinacc.deployment.applicability import deviations, is_measured_there
from kinacc.deployment.record import Calibration
from kinacc.geometry import Pose, quaternion_from_rotation
from kinacc.kinematics.model import JointState


@dataclass(frozen=True)
class Prediction:
    """Predicted poses of n joint configurations; NaN where a model has no prediction.

    Attributes
    ----------
    pose
        (n, ...) poses, mm, in the frame asked for.
    std
        (n, 6) standard deviations by the covariance of the parameters: x, y, z (mm) and small
        turns about x, y, z (rad).
    undetermined
        (n, 2) movement (mm, rad) by one unit (1 mm or 1 mrad) of what the calibration did not
        determine.
    unexplained
        (n, 2) rms position (mm) and orientation (rad) of what the model left of held-out poses.
    outside
        (n, k) whether a joint lies outside the measured range.
    near
        (n,) whether the configuration is near measured ones.
    """

    pose: Pose
    std: np.ndarray
    undetermined: np.ndarray
    unexplained: np.ndarray
    outside: np.ndarray
    near: np.ndarray

    @property
    def std_position_mm(self) -> np.ndarray:
        """Root (n,) of the summed variances of x, y and z."""
        return np.linalg.norm(self.std[:, :3], axis=1)

    @property
    def status(self) -> list[str]:
        """Whether each prediction is near measured poses, extrapolated, or absent."""
        absent = np.isnan(self.pose.position_mm[:, 0])
        texts = []
        for missing, outside, near in zip(absent, self.outside, self.near, strict=True):
            text = "no prediction" if missing else "extrapolated"
            if joints := ", ".join(map(str, np.flatnonzero(outside) + 1)):
                texts.append(f"{text}: joint {joints} outside the measured range")
            else:
                texts.append("ok" if near else f"{text}: joints unlike those measured")
        return texts

    def table(self) -> pd.DataFrame:
        """One row a pose: position, quaternion, standard deviations (mm, mrad), status."""
        std = self.std * [1.0, 1.0, 1.0, 1e3, 1e3, 1e3]
        names = [
            f"std_{name}" for name in ("x_mm", "y_mm", "z_mm", "rx_mrad", "ry_mrad", "rz_mrad")
        ]
        columns = {
            **pose_columns(self.pose),
            **dict(zip(names, std.T, strict=True)),
            "std_position_mm": self.std_position_mm,
            "std_orientation_mrad": np.linalg.norm(std[:, 3:], axis=1),
        }
        for name in ("unexplained", "undetermined"):
            values = getattr(self, name)
            columns |= {f"{name}_mm": values[:, 0], f"{name}_mrad": 1e3 * values[:, 1]}
        return pd.DataFrame({**columns, "status": self.status})


def pose_columns(pose: Pose) -> dict[str, np.ndarray]:
    """Columns x_mm .. and qw .. of poses (n, ...), NaN where there is none."""
    known = np.isfinite(pose.position_mm[:, 0])
    quaternion = np.full((len(known), 4), np.nan)
    quaternion[known] = quaternion_from_rotation(pose.rotation[known])
    names = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    return dict(zip(names, np.hstack([pose.position_mm, quaternion]).T, strict=True))


def predict(
    calibration: Calibration,
    q_rad: np.ndarray,
    s: np.ndarray | None = None,
    frame: str = "base",
    point: str | None = None,
    payload: np.ndarray | None = None,
) -> Prediction:
    """Predict poses at reported joints.

    Parameters
    ----------
    q_rad
        (n, k) reported joints, rad (mm where a joint slides).
    s
        (n, k) directions of travel, -1, 0 (unknown) or 1.
    frame
        ``base`` of the robot, or ``instrument``.
    point
        A target by name or ``flange``; the tool where not given.
    payload
        (n, 4) as in ``JointState``.

    Raises
    ------
    InputError
        For an unknown frame or point.
    """
    state = JointState(calibration.robot.dh_joints(np.atleast_2d(q_rad)), s, payload)
    outside = calibration.outside_range(state.q_rad)
    with np.errstate(all="ignore"):  # far outside its range a model may be no number
        pose = calibration.pose(state, frame, point)
        std, undetermined = deviations(calibration, state, frame, point)
    unexplained = np.full((len(state), 2), np.nan)
    if calibration.residual is not None:
        unexplained[:] = calibration.residual.position_mm, calibration.residual.orientation_rad
    if calibration.model.domain is not None:
        for values in (*pose, std, undetermined, unexplained):
            values[outside.any(axis=1)] = np.nan
    near = is_measured_there(calibration, state, point)
    return Prediction(pose, std, undetermined, unexplained, outside, near)
