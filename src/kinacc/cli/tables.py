"""Answers of ``predict`` and ``compensate`` as sheets, with warnings, and the joints asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import click
import numpy as np

from kinacc.cli import rows
from kinacc.cli.rows import Rows
from kinacc.cli.sheet import Field, Sheet
from kinacc.errors import InputError, Problem
from kinacc.geometry import Pose, quaternion_from_rotation
from kinacc.kinematics.model import JointState
from kinacc.kinematics.robot import Robot

if TYPE_CHECKING:
    from kinacc.deployment.predict import Prediction
    from kinacc.deployment.record import Calibration

_MRAD = 1e3
_MOST_SAID = 2  # sentences of a warning
_MUCH_MOVED_MM = 0.1  # per mm or mrad of what is undetermined
UNLIKE = "the joints together are unlike those measured"


def given_joints(
    robot: Robot,
    path: str | None,
    in_deg: tuple[str, ...],
    in_rad: tuple[str, ...],
    answers: Mapping,
) -> Rows:
    """Joints of a file or of arguments. InputError where there are none, or outside the limits.

    ``answers`` to what the file leaves open, by option.
    """
    sources = [path is not None, bool(in_deg), bool(in_rad)]
    if sum(sources) != 1:
        what = "no joints are given" if not any(sources) else "joints are given more than once"
        raise InputError(Problem("joints", what, "a file, --joints-deg or --joints-rad"))
    if path is not None:
        given = rows.read(path, robot, answers=answers)
    else:
        unit = "deg" if in_deg else "rad"
        joints = rows.of_arguments(in_deg or in_rad, unit, robot, f"--joints-{unit}")
        label = np.arange(1, len(joints) + 1)
        given = Rows(len(joints), label, joints, None, None, ())
    rows.require_within_limits(robot, given, path or "joints")
    return given


def predicted(
    calibration: Calibration,
    given: Rows,
    found: Prediction,
    measured: np.ndarray,
    frame: str,
    point: str | None,
) -> Sheet:
    """The sheet of ``kinacc predict``; ``measured`` (n,): where the calibration was measured."""
    std = found.std * np.array([1.0, 1.0, 1.0, _MRAD, _MRAD, _MRAD])
    by = "standard deviation by the covariance of the fitted parameters, valid given the model"
    seen = "movement per mm or mrad of displacement along directions the calibration cannot see"
    poses = calibration.residual.poses if calibration.residual else "no poses"
    left = f"rms of what the model left of {poses}"
    fields = [
        Field("row", given.label, "", "the file's pose, or its line"),
        *joint_fields(calibration.robot.dh.prismatic, given.joints),
        *pose_fields(found.pose, frame),
        *(Field(f"std_{axis}_mm", std[:, i], "mm", by, False) for i, axis in enumerate("xyz")),
        *(
            Field(f"std_r{axis}_mrad", std[:, 3 + i], "mrad", by, False)
            for i, axis in enumerate("xyz")
        ),
        Field("std_position_mm", found.std_position_mm, "mm", f"{by}, three axes together"),
        Field("std_orientation_mrad", _MRAD * found.std_orientation_rad, "mrad", f"{by}, together"),
        Field("unexplained_mm", found.residual_mm, "mm", left),
        Field("unexplained_mrad", _MRAD * found.residual_rad, "mrad", left, False),
        Field("undetermined_mm", found.blind_mm, "mm per mm or mrad", seen),
        Field("undetermined_mrad", _MRAD * found.blind_rad, "mrad per mm or mrad", seen, False),
        Field(
            "status",
            _where(calibration, found.outside, measured),
            "",
            "whether the calibration was measured at such joints",
        ),
    ]
    point = point or calibration.default_point
    title = f"{calibration.name}: {point} in the {frame} frame by the {calibration.choice} model"
    title += orientation_remark(calibration, point)
    return Sheet(title, facts(calibration, frame, point), fields)


def facts(calibration: Calibration, frame: str, point: str) -> dict[str, object]:
    """What all rows of an answer have in common."""
    return {
        "calibration": calibration.name,
        "robot": calibration.robot.name,
        "model": calibration.choice,
        "frame": frame,
        "point": point,
        "orientation": calibration.orientation_source(point),
        **({"outdated": calibration.outdated} if calibration.outdated else {}),
    }


def orientation_remark(calibration: Calibration, point: str) -> str:
    """Where the orientation of a point comes from, if no reading has it, for a title."""
    stated = calibration.orientation_source(point) == "stated"
    return " (orientation as stated in the robot file)" if stated else ""


def joint_fields(prismatic: np.ndarray, joints: np.ndarray) -> list[Field]:
    """Reported joints (n, k) in degrees, or mm where a joint slides (k,)."""
    return [
        Field(f"q{i + 1}_mm", joints[:, i], "mm", f"joint {i + 1}")
        if slides
        else Field(f"q{i + 1}_deg", np.rad2deg(joints[:, i]), "deg", f"joint {i + 1}")
        for i, slides in enumerate(prismatic)
    ]


def pose_fields(pose: Pose, frame: str) -> list[Field]:
    """Position and unit quaternion of poses (n, ...), NaN where there is none."""
    known = np.isfinite(pose.position_mm[:, 0])
    quaternion = np.full((len(known), 4), np.nan)
    quaternion[known] = quaternion_from_rotation(pose.rotation[known])
    about = f"in the {frame} frame"
    position = [
        Field(f"{axis}_mm", pose.position_mm[:, i], "mm", about) for i, axis in enumerate("xyz")
    ]
    turn = [Field(f"q{part}", quaternion[:, i], "1", about) for i, part in enumerate("wxyz")]
    return position + turn


def joints_in_words(outside: np.ndarray) -> str:
    """The joints a mask (k,) marks: joint 2, or joints 2, 4."""
    numbers = [str(joint + 1) for joint in np.flatnonzero(outside)]
    return f"joint{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}"


def say_unlike(unlike: np.ndarray, calibration: Calibration) -> None:
    """Warn on the error stream of rows, True in ``unlike`` (n,), where it was not measured.

    What the measured poses left open is said with it: elsewhere it shows.
    """
    from kinacc.calibration import identifiability

    if not unlike.any():
        return
    told = identifiability.weak(calibration.left_open or ())
    click.echo(
        f"warning: {int(unlike.sum())} of {len(unlike)} poses lie where the calibration was not "
        "measured: status says why; errors there may be larger than those held out"
        + (f"; measured poses left open: {'; '.join(told[:_MOST_SAID])}" if told else ""),
        err=True,
    )


def say_convention(calibration: Calibration, at: JointState, frame: str, point: str | None) -> None:
    """Warn on the error stream where poses ``at`` joints hang on where the base is said to be.

    That is what the measured poses left open moves them in the base, and not as the instrument
    sees them.
    """
    if frame != "base" or calibration.known is None or not len(at):
        return
    from kinacc.deployment.predict import open_movement

    in_base, seen = (
        open_movement(calibration, at, each, point)[:, 0] for each in (frame, "instrument")
    )
    moved = (in_base > _MUCH_MOVED_MM) & (seen < 0.5 * in_base)
    if not moved.any():
        return
    click.echo(
        "warning: where the robot's base lies is a convention here: each mm or mrad of what the "
        f"measured poses left open moves {int(moved.sum())} of {len(at)} poses by up to "
        f"{in_base[moved].max():.2g} mm in the base frame, by {seen[moved].max():.2g} mm as the "
        "instrument sees them; a pose commanded in the robot's own base may be missed by as "
        "much, poses in the instrument's frame (--frame instrument) are not",
        err=True,
    )


def _where(calibration: Calibration, outside: np.ndarray, measured: np.ndarray) -> np.ndarray:
    said = "extrapolated" if calibration.model.domain is None else "no prediction"
    words = [
        f"{said}: {joints_in_words(row)} outside the range the data cover"
        if row.any()
        else "ok"
        if there
        else f"extrapolated: {UNLIKE}"
        for row, there in zip(outside, measured, strict=True)
    ]
    return np.array(words, dtype=object)
