"""What ``compensate`` is asked for, and its answer as a sheet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kinacc.cli import rows
from kinacc.cli.rows import Rows
from kinacc.cli.sheet import Field, Sheet
from kinacc.cli.tables import (
    UNLIKE,
    facts,
    joint_fields,
    joints_in_words,
    orientation_remark,
    pose_fields,
)
from kinacc.deployment.applicability import is_measured_there
from kinacc.deployment.compensate import (
    FEW_AXES_TURN_RAD,
    ROTATION_TOLERANCE_RAD,
    Compensation,
    PoseStatus,
)
from kinacc.deployment.record import Calibration
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, rotation_from_quaternion
from kinacc.kinematics.model import JointState
from kinacc.measurements.table import numbers_of

_NUMBERS = "7 numbers: x, y, z in mm, then a unit quaternion w, x, y, z"


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
        what = "is not given" if not any(sources) else "is given more than once"
        raise InputError(Problem("what is wanted", what, "a file of poses, --pose, or --program"))
    near = None
    if near_deg is not None:
        near = rows.of_arguments((near_deg,), "deg", calibration.robot, "--near-deg")
    if path is not None:
        given = rows.read(path, calibration.robot, joints=False, pose=True)
    else:
        pose = _of_arguments(texts)
        given = Rows(len(texts), np.arange(1, len(texts) + 1), None, None, pose, ())
    if given.joints is None and near is not None:
        given = replace(given, joints=np.broadcast_to(near, (given.count, near.shape[1])))
    if given.joints is not None:
        rows.require_within_limits(calibration.robot, given, path or "--near-deg")
    return given


def compensated(
    calibration: Calibration,
    given: Rows,
    found: Compensation,
    frame: str,
    point: str | None,
    unlike: np.ndarray,
) -> Sheet:
    """The sheet of ``kinacc compensate``.

    ``unlike`` (n,): joints that are unlike those measured.
    """
    angular = np.where(calibration.robot.dh.prismatic, np.nan, np.rad2deg(np.abs(found.change)))
    largest = np.max(np.nan_to_num(angular, nan=-1.0), axis=1)
    point = point or calibration.default_point
    fields = [
        Field("row", given.label, "", "the file's pose, or its line"),
        *joint_fields(calibration.robot.dh.prismatic, found.q_rad),
        Field(
            "status",
            _words(calibration, found, unlike),
            "",
            "why there are joints, or none",
        ),
        Field("solver_residual_mm", found.position_error_mm, "mm", "of the search for the joints"),
        Field(
            "orientation_error_mrad",
            1e3 * found.rotation_error_rad,
            "mrad",
            "left by the forward model",
        ),
        Field(
            "largest_change_deg",
            np.where(largest < 0.0, np.nan, largest),
            "deg",
            "largest movement of a joint from the joints it should be near to",
        ),
        *(replace(each, on_screen=False) for each in pose_fields(given.pose, frame)),
    ]
    model = calibration.choice
    title = f"{calibration.name}: joints for the {point} in the {frame} frame by the {model} model"
    title += orientation_remark(calibration, point)
    return Sheet(title, facts(calibration, frame, point), fields)


def reached(calibration: Calibration, found: Compensation) -> JointState:
    """The joints found, where there are any."""
    there = np.isfinite(found.q_rad).all(axis=1)
    return JointState(calibration.robot.dh_joints(found.q_rad[there]))


def unlike_measured(calibration: Calibration, found: Compensation, point: str | None) -> np.ndarray:
    """True (n,) for joints in their fitted ranges where the calibration was not measured."""
    there = np.isfinite(found.q_rad).all(axis=1)
    at = reached(calibration, found)
    unlike = np.zeros(len(found.status), dtype=bool)
    unlike[there] = ~is_measured_there(calibration, at, point)
    return unlike & ~calibration.outside_range(calibration.robot.dh_joints(found.q_rad)).any(axis=1)


def _words(calibration: Calibration, found: Compensation, unlike: np.ndarray) -> np.ndarray:
    words = []
    for row, status in enumerate(found.status):
        joints = joints_in_words(found.offending[row]) if found.offending[row].any() else ""
        off_mm, off_rad = found.position_error_mm[row], found.rotation_error_rad[row]
        left = f", {off_mm:.3g} mm left" if np.isfinite(off_mm) else ""
        if np.isfinite(off_mm) and off_rad > FEW_AXES_TURN_RAD:
            left += f" and {np.rad2deg(off_rad):.3g} deg"
        beyond = f" ({joints} outside the range the data cover)" if joints else ""
        said = {
            PoseStatus.CONVERGED: "converged",
            PoseStatus.EXTRAPOLATED: f"converged, extrapolated: {joints} outside the data's range",
            PoseStatus.OTHER_POSTURE: f"converged in another posture than the nearest{beyond}",
            PoseStatus.OUTSIDE_LIMITS: f"no joints: {joints} would be outside the limits",
            PoseStatus.OUTSIDE_RANGE: f"no joints: {joints} would be outside the data's range",
            PoseStatus.NOT_REACHED: f"no joints: not reached{left}",
        }[PoseStatus(status)]
        if status <= PoseStatus.OTHER_POSTURE:
            said += f", extrapolated: {UNLIKE}" if unlike[row] else ""
            said += _remarks(calibration, found, row)
        words.append(said)
    return np.array(words, dtype=object)


def _remarks(calibration: Calibration, found: Compensation, row: int) -> str:
    """What a person should know before the joints are used."""
    said, off_rad = "", found.rotation_error_rad[row]
    if off_rad > ROTATION_TOLERANCE_RAD:
        axes = calibration.robot.dh.joints
        said += f", turned {1e3 * off_rad:.3g} mrad away: {axes} axes reach no nearer"
    return said


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
