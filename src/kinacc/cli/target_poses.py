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
    PoseStatus.NOT_REACHED: "no joints: not reached, {left:.3g} mm left",
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
    sources = [path is not None, bool(texts)]
    if sum(sources) != 1:
        message = "is not given" if not any(sources) else "is given more than once"
        raise InputError(
            Problem("what is wanted", message, "a file of poses, --pose, or --program")
        )
    near = None
    if near_deg is not None:
        near = rows.of_arguments((near_deg,), "deg", calibration.robot, "--near-deg")
    if path is not None:
        inputs = rows.read(path, calibration.robot, joints=False, pose=True)
    else:
        pose = _of_arguments(texts)
        inputs = Rows(len(texts), np.arange(1, len(texts) + 1), None, None, pose, ())
    if inputs.joints is None and near is not None:
        inputs = replace(inputs, joints=np.broadcast_to(near, (inputs.count, near.shape[1])))
    if inputs.joints is not None:
        rows.require_within_limits(calibration.robot, inputs, path or "--near-deg")
    return inputs


def answer_table(
    calibration: Calibration, given: Rows, found: Compensation, unlike: np.ndarray
) -> pd.DataFrame:
    """A row for each wanted pose: joints, status, what is left, and the pose.

    ``unlike`` (n,): joints that are unlike those measured.
    """
    prismatic = calibration.robot.dh.prismatic
    texts = []
    for row, status in enumerate(found.status):
        numbers = ", ".join(map(str, np.flatnonzero(found.offending[row]) + 1))
        left_mm, turned_mrad = found.position_error_mm[row], 1e3 * found.rotation_error_rad[row]
        text = _TEXTS[PoseStatus(status)].format(joints=f"joint {numbers}", left=left_mm)
        if status <= PoseStatus.OTHER_POSTURE:
            if unlike[row]:
                text += ", extrapolated: the joints together are unlike those measured"
            if turned_mrad > 1e3 * ROTATION_TOLERANCE_RAD:
                text += (
                    f", turned {turned_mrad:.3g} mrad away: {len(prismatic)} axes reach no nearer"
                )
        texts.append(text)
    change_deg = np.where(prismatic, -1.0, np.rad2deg(np.abs(found.change)))
    table = {
        "row": given.label,
        **rows.joint_columns(prismatic, found.q_rad),
        "status": texts,
        "solver_residual_mm": found.position_error_mm,
        "orientation_error_mrad": 1e3 * found.rotation_error_rad,
        "largest_change_deg": change_deg.max(axis=1),
    }
    return pd.DataFrame(table | pose_columns(given.pose))


def _of_arguments(texts: tuple[str, ...]) -> Pose:
    values, problems = [], []
    for text in texts:
        row = numbers_of(text)
        length = np.linalg.norm(row[3:]) if len(row) == 7 else 0.0
        if abs(length - 1.0) > 1e-3:
            problems.append(Problem("--pose", repr(text), _NUMBERS))
            continue
        values.append([*row[:3], *(row[3:] / length)])
    refuse(problems)
    table = np.array(values)
    return Pose(rotation_from_quaternion(table[:, 3:]), table[:, :3])
