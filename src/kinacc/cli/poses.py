"""``kinacc predict`` and ``compensate``: joints to poses of a calibrated arm, and back."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import click
import numpy as np
import pandas as pd

from kinacc.cli import choice, rows
from kinacc.cli.choice import option
from kinacc.cli.output import Output, answers
from kinacc.cli.process import AGAINST
from kinacc.deployment import predict as prediction
from kinacc.deployment import programs
from kinacc.deployment.compensate import (
    ROTATION_TOLERANCE_RAD,
    Compensation,
    PoseStatus,
)
from kinacc.deployment.compensate import compensate as joints_for
from kinacc.deployment.record import Calibration
from kinacc.errors import first_few, input_error
from kinacc.geometry import Pose, rotation_from_quaternion
from kinacc.measurements.rows import Rows, joint_columns
from kinacc.measurements.table import numbers_of
from kinacc.progress import reporting
from kinacc.report.rendering import lines

_SHOWN = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "std_position_mm",
          "std_orientation_mrad", "unexplained_mm", "undetermined_mm", "status")  # fmt: skip
_TITLE = "{calibration}: {point} ({orientation} orientation), {frame} frame, {model} model"
_STATUS = {
    PoseStatus.CONVERGED: "converged",
    PoseStatus.EXTRAPOLATED: "converged, extrapolated: {joints} outside the data's range",
    PoseStatus.OTHER_POSTURE: "converged in another posture than the nearest",
    PoseStatus.OUTSIDE_LIMITS: "no joints: {joints} would be outside the limits",
    PoseStatus.OUTSIDE_RANGE: "no joints: {joints} would be outside the data's range",
    PoseStatus.NOT_REACHED: "no joints: not reached, {error_mm:.3g} mm left",
}


@click.command("predict")
@choice.FOLDER
@choice.SELECTED
@click.argument("joints", type=choice.PATH, required=False)
@option("--joints-deg", multiple=True, help='One configuration, e.g. "0,-20,30,0,45,0".')
@choice.joint_file_options
@choice.point_options
@answers(table=True, verbose=True)
def predict(
    folder: str,
    model: str | None,
    joints: str | None,
    joints_deg: tuple[str, ...],
    frame: str,
    point: str | None,
    session: str | None,
    out: Output,
    **file: Any,
) -> None:
    """Predict the pose of the tool at given joints, with standard deviations.

    JOINTS is a file with q1_deg or q1_rad and so on (q1_mm where a joint slides), or any file that
    `kinacc init` reads. Exit code 1: a row has no pose.

    \b
    std_*           standard deviation by the covariance of the fit, valid given the model
    unexplained_*   rms error of the model at held-out poses, not part of std
    undetermined_*  movement per mm or mrad of what the calibration did not determine

    \b
    Example:
      kinacc predict results/mh180 --joints-deg "10,-20,30,0,45,0"
    """
    calibration = choice.calibration_of(folder, model, session)
    arm = calibration.robot
    inputs, q = rows.joints_of(arm, joints, joints_deg, file)
    with reporting("predict"):
        result = prediction.predict(calibration, q, inputs.directions, frame, point, inputs.payload)
    named = pd.DataFrame({"row": inputs.label, **joint_columns(arm.dh.prismatic, q)})
    table = named.join(result.table())
    facts = calibration.facts(frame, point)
    shown = table if out.verbose else table[["row", *_SHOWN]]
    out.show(facts | {"rows": table}, table, [_TITLE.format(**facts)], shown)
    unlike = (table["status"] != "ok").to_numpy()
    rows.print_remarks(inputs, calibration, unlike, result.undetermined[:, 0], frame)
    rows.end_where_missing(result.pose.position_mm, "a pose")


@click.command("compensate")
@choice.FOLDER
@choice.SELECTED
@click.argument("poses", type=choice.PATH, required=False)
@option("--pose", "texts", multiple=True, help='A pose in mm: "x,y,z,qw,qx,qy,qz".')
@option("--near-deg", help="Joints near the posture, where none is stated.")
@option("--program", type=choice.PATH,
        help="Robot program: .src, .mod, .prg, .ls, .script, .jbi or .csv.")  # fmt: skip
@option("--tool", "tools", multiple=True, help="Tool of a program: [NUMBER=]x,y,z,a,b,c.")
@option("--base", "bases", multiple=True, help="Base of a program: [NUMBER=]x,y,z,a,b,c.")
@option("--frames", multiple=True, type=choice.PATH, help="File with tools and bases.")
@option("--pulses-per-deg", help="Pulses of a Yaskawa job: one number an axis.")
@option("--base-is-fixed", is_flag=True, help="No external axis moves the robot's base.")
@option("--at-most-mm", type=float, default=programs.AT_MOST_MM, help="Largest change of a pose.")
@option("--dry-run", is_flag=True, help="Corrections without a written program.")
@option("--table", type=choice.PATH, help="Corrections of a program, as a table.")
@choice.point_options
@option("--out", "-o", "target", type=choice.PATH, help="Program, or table of joints.")
@answers(picture="Corrections of a program, as a picture.", force=True)
def compensate(
    folder: str,
    model: str | None,
    poses: str | None,
    texts: tuple[str, ...],
    near_deg: str | None,
    program: str | None,
    target: str | None,
    frame: str,
    point: str | None,
    session: str | None,
    out: Output,
    **options: Any,
) -> None:
    """Correct a robot program, or find joints that reach poses.

    A program keeps its text; only coordinates change (docs/robot-programs.md). POSES is a file with
    x_mm, y_mm, z_mm and qw, qx, qy, qz (or rvx_deg .. a rotation vector, or rx_deg .. intrinsic XYZ
    angles). Columns q1_deg .. are joints near the posture. Exit code 1: a position has no joints.

    \b
    Example:
      kinacc compensate results/kr6 --program weld.src -o weld_cal.src
      kinacc compensate results/ur10_b target_poses.csv -o joints.csv
    """
    calibration, near = choice.calibration_of(folder, model, session), None
    if near_deg is not None:
        near = rows.joints_given("--near-deg", near_deg, calibration.robot.dh.prismatic)
    if program is not None:
        if poses is not None or texts:
            raise click.UsageError("--program stands alone: give no poses beside it")
        if frame != "base":
            raise input_error("--frame", "programs are in the robot's own base", "base")
        _correct(calibration, program, near, point, target, options, out)
        return
    out = replace(out, table=target)
    inputs = _wanted(calibration, poses, texts, near)
    wanted = inputs.pose
    assert wanted is not None  # read_rows refuses a file without poses
    with reporting("compensate"):
        result = joints_for(
            calibration, wanted, inputs.joints, inputs.directions, frame, point, inputs.payload
        )
        unlike = np.isfinite(result.q_rad).all(axis=1)
        there = prediction.predict(calibration, result.q_rad[unlike], None, frame, point)
        unlike[unlike] = ~there.near & ~there.outside.any(axis=1)
    table = _table_of(calibration, inputs.label, wanted, result, unlike)
    facts = calibration.facts(frame, point)
    shown = table.drop(columns=[*prediction.pose_columns(wanted)])
    out.show(facts | {"rows": table}, table, ["Joints of " + _TITLE.format(**facts)], shown)
    rows.print_remarks(inputs, calibration, unlike, there.undetermined[:, 0], frame)
    rows.end_where_missing(result.q_rad, "joints")


def _wanted(
    calibration: Calibration, path: str | None, texts: Sequence[str], near: np.ndarray | None
) -> Rows:
    """Wanted poses and, where given, joints near the posture. InputError with all problems.

    ``near``: joints (k,), where the rows state none.
    """
    if (path is None) != bool(texts):
        message = "is given more than once" if path else "is not given"
        allowed = "a file of poses, --pose, or --program"
        raise input_error("the wanted pose", message, allowed)
    if path is not None:
        inputs = rows.read(path, calibration.robot, "poses")
    else:
        table = np.array([rows.numbers_given("--pose", text, 7) for text in texts])
        lengths = np.linalg.norm(table[:, 3:], axis=1, keepdims=True)
        if (np.abs(lengths - 1.0) > 1e-3).any():
            allowed = "x, y, z in mm, then a unit quaternion w, x, y, z"
            raise input_error("--pose", "has no unit quaternion", allowed)
        wanted = Pose(rotation_from_quaternion(table[:, 3:] / lengths), table[:, :3])
        inputs = Rows(np.arange(1, len(texts) + 1), pose=wanted)
    if inputs.joints is None and near is not None:
        inputs = replace(inputs, joints=np.tile(near, (len(inputs.label), 1)))
    if inputs.joints is not None:
        where = path or "--near-deg"
        rows.require_within_limits(calibration.robot, inputs.label, inputs.joints, where)
    return inputs


def _table_of(
    calibration: Calibration,
    label: np.ndarray,
    wanted: Pose,
    answer: Compensation,
    unlike: np.ndarray,
) -> pd.DataFrame:
    """A row for each wanted pose: joints, status, remaining error, and the pose.

    ``unlike`` (n,): joints that are unlike those measured.
    """
    prismatic = calibration.robot.dh.prismatic
    rotation_mrad, texts = 1e3 * answer.rotation_error_rad, []
    for row, status in enumerate(answer.status):
        joints = f"joint {', '.join(map(str, np.flatnonzero(answer.offending[row]) + 1))}"
        error_mm = answer.position_error_mm[row]
        text = _STATUS[PoseStatus(status)].format(joints=joints, error_mm=error_mm)
        if status <= PoseStatus.OTHER_POSTURE and unlike[row]:
            text += ", extrapolated: the joints together are unlike those measured"
        if status <= PoseStatus.OTHER_POSTURE and rotation_mrad[row] > 1e3 * ROTATION_TOLERANCE_RAD:
            text += f", turned {rotation_mrad[row]:.3g} mrad away: "
            text += f"{len(prismatic)} axes reach no nearer"
        texts.append(text)
    change_deg = np.where(prismatic, -1.0, np.rad2deg(np.abs(answer.change)))
    table = {
        "row": label,
        **joint_columns(prismatic, answer.q_rad),
        "status": texts,
        "solver_residual_mm": answer.position_error_mm,
        "orientation_error_mrad": rotation_mrad,
        "largest_change_deg": change_deg.max(axis=1),
    }
    return pd.DataFrame(table | prediction.pose_columns(wanted))


def _correct(
    calibration: Calibration,
    program: str,
    near_rad: np.ndarray | None,
    point: str | None,
    target: str | None,
    options: dict[str, Any],
    out: Output,
) -> None:
    """Correct a program, write it, and print its corrections; exit code 1 where one is refused."""
    pulses = options["pulses_per_deg"]
    answer = programs.compensate_program(
        calibration,
        program,
        _frames(options["tools"]),
        _frames(options["bases"]),
        options["frames"],
        near_rad,
        pulses and np.array(numbers_of(pulses)),
        point,
        options["at_most_mm"],
        options["base_is_fixed"],
        _asked if sys.stdin.isatty() else None,
    )
    if out.picture:
        from kinacc.figures.calibration import draw_program

        out.draw(draw_program(answer.table))
    facts = {name: value for name, value in vars(answer).items() if name != "files"}
    out.show(facts, answer.table, lines("program.txt", p=answer))
    warnings = lines("program_warnings.txt", p=answer, first_few=first_few)
    for text in () if out.as_json else warnings:
        click.echo(text, err=True)
    if answer.refused:
        raise SystemExit(AGAINST)
    if not options["dry_run"] and target is not None:
        written = answer.write(target, out.force)
        click.echo(f"Written: {', '.join(written)}", err=out.as_json)


def _frames(texts: Sequence[str]) -> dict[str, np.ndarray]:
    """Frames by name; the name is empty where a frame is for all."""
    parts = (text.rpartition("=") for text in texts)
    return {name.strip(): np.array(numbers_of(numbers)) for name, _, numbers in parts}


def _asked(kind: str, name: str) -> np.ndarray:
    return np.array(numbers_of(click.prompt(f"{kind} {name} (six numbers, mm and deg)")))
