"""``kinacc compensate``: a robot program corrected, or joints that reach wanted poses."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.cli.output import TABLES, Output, require_writable


@click.command("compensate")
@choice.calibration_options
@click.argument("poses", type=click.Path(), required=False)
@click.option("--pose", multiple=True, help='A pose in mm: "x,y,z,qw,qx,qy,qz".')
@click.option("--near-deg", help="Joints that the posture is near to, where none is stated.")
@click.option(
    "--program",
    type=click.Path(),
    help="Robot program: .src, .mod, .prg, .ls, .script, .jbi or .csv.",
)
@click.option("--tool", "tools", multiple=True, help="Tool of a program: [NUMBER=]x,y,z,a,b,c.")
@click.option("--base", "bases", multiple=True, help="Base of a program: [NUMBER=]x,y,z,a,b,c.")
@click.option("--frames", multiple=True, type=click.Path(), help="File with tools and bases.")
@click.option("--pulses-per-degree", help="Of a Yaskawa job: one number an axis.")
@click.option("--base-is-fixed", is_flag=True, help="No external axis moves the robot's base.")
@choice.option("--at-most-mm", type=float, default=20.0, help="Largest change of a position.")
@click.option("--dry-run", is_flag=True, help="Write no program, print the corrections.")
@click.option("--table", type=click.Path(), help="Corrections of a program, as a table.")
@click.option("--picture", type=click.Path(), help="Corrections of a program, as a picture.")
@choice.point_options
@click.option("--out", "-o", type=click.Path(), help="Program or table to write.")
@click.option("--json", "as_json", is_flag=True, help="Print the answer as JSON.")
@click.option("--force", is_flag=True, help="Replace files that are there.")
def compensate(folder, model, config, robot, poses, pose, near_deg, program, **options) -> None:
    """Correct a robot program, or find joints that reach poses.

    FOLDER is the results folder of a data set. A program keeps its text; only coordinates change
    (docs/robot-programs.md). POSES is a file with x_mm, y_mm, z_mm and qw, qx, qy, qz (or
    rvx_deg .. a rotation vector, or rx_deg .. intrinsic XYZ angles). Columns q1_deg .. are the
    joints that the posture is near to. Exit code 1 if a position or a row has no joints.

    \b
    Example:
      kinacc compensate results/kr6 --program weld.src -o weld_cal.src
      kinacc compensate results/mh180 --pose "1500,200,900,0,1,0,0"
      kinacc compensate results/ur10_b target_poses.csv -o joints.csv
    """
    session = options.pop("session")
    if program is not None:
        from kinacc.cli import program as programs

        if poses is not None or pose:
            raise click.UsageError("--program stands alone: give no poses beside it")
        calibration = choice.calibration_of(folder, model, robot, config, session)
        programs.correct(calibration, program, near_deg, options)
        return
    _find_joints(folder, model, config, robot, poses, pose, near_deg, session, options)


def _find_joints(folder, model, config, robot, poses, pose, near_deg, session, options) -> None:
    import numpy as np

    from kinacc.cli import rows, target_poses
    from kinacc.deployment.applicability import is_measured_there
    from kinacc.deployment.compensate import compensate as joints_for
    from kinacc.deployment.predict import pose_columns
    from kinacc.deployment.sensitivity import deviations
    from kinacc.kinematics.model import JointState
    from kinacc.progress import reporting

    frame, point, out = options["frame"], options["point"], options["out"]
    answer = Output(as_json=options["as_json"], table=out)
    require_writable([out], options["force"], TABLES)
    calibration = choice.calibration_of(folder, model, robot, config, session)
    inputs = target_poses.poses(calibration, poses, pose, near_deg)
    with reporting("compensate", bar=True):
        result = joints_for(
            calibration, inputs.pose, inputs.joints, inputs.directions, frame, point, inputs.payload
        )
        q_dh = calibration.robot.dh_joints(result.q_rad)
        there = np.isfinite(q_dh).all(axis=1)
        state = JointState(q_dh[there])
        unlike = ~calibration.outside_range(q_dh).any(axis=1) & there
        unlike[there] &= ~is_measured_there(calibration, state, point)
    table = target_poses.answer_table(calibration, inputs, result, unlike)
    facts = calibration.facts(frame, point)
    title = "{calibration}: joints for {point} ({orientation} orientation), {frame} frame, {model}"
    shown = table.drop(columns=[*pose_columns(inputs.pose)])
    answer.show(facts | {"rows": table}, table, [title.format(**facts)], shown)
    rows.say_unused(inputs, calibration)
    rows.warn_unlike(unlike)
    rows.warn_undetermined(deviations(calibration, state, frame, point)[1][:, 0], frame)
    rows.end_where_missing(result.q_rad, "joints")
