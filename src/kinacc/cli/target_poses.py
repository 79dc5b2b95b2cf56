"""What ``compensate`` is asked for, and the table of its answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from kinacc.cli import rows
from kinacc.cli.rows import Rows
from kinacc.deployment.compensate import ROTATION_TOLERANCE_RAD, Compensation, PoseStatus
from kinacc.deployment.predict import pose_columns
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, rotation_from_quaternion
from kinacc.measurements.table import numbers_of

_NUMBERS = "7 numbers: x, y, z in mm, then a unit quaternion w, x, y, z"
_TEXTS = {
    PoseStatus.CONVERGED: "converged",
    PoseStatus.EXTRAPOLATED: "converged, extrapolated: {joints} outside the data's range",
    PoseStatus.OTHER_POSTURE: "converged in another posture than the nearest",
    PoseStatus.OUTSIDE_LIMITS: "no joints: {joints} would be outside the limits",
    PoseStatus.OUTSIDE_RANGE: "no joints: {joints} would be outside the data's range",
    PoseStatus.NOT_REACHED: "no joints: not reached, {error_mm:.3g} mm left",
}


def poses(
    calibration: Calibration,
    path: str | None,
    texts: tuple[str, ...],
    near_deg: str | None,
) -> Rows:
    """Wanted poses and, where given, joints the posture should be near to.

    Raises InputError listing all problems.
    """
    if (path is None) != bool(texts):
        message = "is given more than once" if path else "is not given"
        allowed = "a file of poses, --pose, or --program"
        raise InputError(Problem("the wanted pose", message, allowed))
    robot = calibration.robot
    near = rows.of_arguments((near_deg,), "deg", robot, "--near-deg") if near_deg else None
    if path is not None:
        inputs = rows.read(path, robot, "poses")
    else:
        inputs = Rows(np.arange(1, len(texts) + 1), pose=_of_arguments(texts))
    if inputs.joints is None and near is not None:
        inputs = replace(inputs, joints=np.repeat(near, len(inputs.label), axis=0))
    if inputs.joints is not None:
        rows.require_within_limits(robot, inputs, path or "--near-deg")
    return inputs


def answer_table(
    calibration: Calibration, inputs: Rows, answer: Compensation, unlike: np.ndarray
) -> pd.DataFrame:
    """A row for each wanted pose: joints, status, remaining error, and the pose.

    ``unlike`` (n,): joints that are unlike those measured.
    """
    prismatic = calibration.robot.dh.prismatic
    rotation_mrad, texts = 1e3 * answer.rotation_error_rad, []
    for row, status in enumerate(answer.status):
        joints = f"joint {', '.join(map(str, np.flatnonzero(answer.offending[row]) + 1))}"
        text = _TEXTS[PoseStatus(status)].format(
            joints=joints, error_mm=answer.position_error_mm[row]
        )
        if status <= PoseStatus.OTHER_POSTURE and unlike[row]:
            text += ", extrapolated: the joints together are unlike those measured"
        if status <= PoseStatus.OTHER_POSTURE and rotation_mrad[row] > 1e3 * ROTATION_TOLERANCE_RAD:
            text += f", turned {rotation_mrad[row]:.3g} mrad away: "
            text += f"{len(prismatic)} axes reach no nearer"
        texts.append(text)
    change_deg = np.where(prismatic, -1.0, np.rad2deg(np.abs(answer.change)))
    table = {
        "row": inputs.label,
        **rows.joint_columns(prismatic, answer.q_rad),
        "status": texts,
        "solver_residual_mm": answer.position_error_mm,
        "orientation_error_mrad": rotation_mrad,
        "largest_change_deg": change_deg.max(axis=1),
    }
    return pd.DataFrame(table | pose_columns(inputs.pose))


def _of_arguments(texts: tuple[str, ...]) -> Pose:
    rows = [numbers_of(text) for text in texts]
    refuse(Problem("--pose", repr(text), _NUMBERS) for text, row in zip(texts, rows, strict=True)
           if len(row) != 7 or abs(np.linalg.norm(row[3:]) - 1.0) > 1e-3)  # fmt: skip
    table = np.array(rows)
    unit = table[:, 3:] / np.linalg.norm(table[:, 3:], axis=1, keepdims=True)
    return Pose(rotation_from_quaternion(unit), table[:, :3])
