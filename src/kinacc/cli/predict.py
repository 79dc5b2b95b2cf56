"""``kinacc predict``: joints to calibrated poses with standard deviations."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.cli.file_options import joint_file_options
from kinacc.cli.output import answers


@click.command("predict")
@choice.calibration_options
@click.argument("joints", type=click.Path(), required=False)
@click.option("--joints-deg", multiple=True, help='One configuration, e.g. "0,-20,30,0,45,0".')
@click.option("--joints-rad", multiple=True, help="The same in radians.")
@joint_file_options
@choice.point_options
@answers(table=True)
def predict(
    folder, model, config, robot, joints, joints_deg, joints_rad, frame, point, session, out, **file
) -> None:
    """Predict the pose of the tool at given joints, with how sure that is.

    FOLDER is the results folder of a data set, JOINTS a CSV, Parquet or JSON file with columns
    q1_deg or q1_rad and so on (q1_mm where a joint slides), or any file that `kinacc init` reads.

    \b
    std_*           standard deviation by the covariance of the fitted parameters, valid given the
                    model
    unexplained_*   rms of what the model left of held-out measurements: add it in mind
    undetermined_*  movement per mm or mrad along what the calibration could not see, the same by
                    every model
    status          whether the calibration was measured at such joints

    Where the base was estimated with the arm, the base frame is that of the DH model, for a VEC
    model as well. Where joints can take its place, it is a convention (undetermined_*):
    --frame instrument leaves that out. Exit code 1 if a row has no pose.

    \b
    Example:
      kinacc predict results/mh180 --joints-deg "10,-20,30,0,45,0"
      kinacc predict results/ur10_b plan.csv --frame instrument -o predicted.csv
    """
    import numpy as np

    from kinacc.cli import rows, tables
    from kinacc.cli.file_options import joint_answers
    from kinacc.deployment.applicability import is_measured_there
    from kinacc.deployment.predict import predict as poses_at
    from kinacc.kinematics.model import JointState
    from kinacc.progress import reporting

    calibration = choice.calibration_of(folder, model, robot, config, session)
    answered = joint_answers(file)
    given = tables.given_joints(calibration.robot, joints, joints_deg, joints_rad, answered)
    with reporting("predict", bar=True) as progress:
        found = poses_at(
            calibration, given.joints, given.directions, frame, point, progress, given.payload
        )
        at = JointState(calibration.robot.dh_joints(given.joints), given.directions, given.payload)
        measured = is_measured_there(calibration, at, point)
    out.deliver(tables.predicted(calibration, given, found, measured, frame, point))
    rows.say_unused(given, calibration)
    tables.say_unlike(~measured, calibration)
    tables.say_convention(calibration, at.select(np.isfinite(found.blind_mm)), frame, point)
    rows.end_where_missing(found.pose.position_mm, "a pose")
