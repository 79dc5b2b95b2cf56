"""``kinacc predict``: joints to calibrated poses with standard deviations."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.cli.file_options import joint_file_options
from kinacc.cli.output import answers

_SHOWN = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "std_position_mm",
          "std_orientation_mrad", "unexplained_mm", "undetermined_mm", "status")  # fmt: skip


@click.command("predict")
@choice.calibration_options
@click.argument("joints", type=click.Path(), required=False)
@click.option("--joints-deg", multiple=True, help='One configuration, e.g. "0,-20,30,0,45,0".')
@click.option("--joints-rad", multiple=True, help="The same in radians.")
@joint_file_options
@choice.point_options
@answers(table=True, verbose=True)
def predict(
    folder, model, config, robot, joints, joints_deg, joints_rad, frame, point, session, out, **file
) -> None:
    """Predict the pose of the tool at given joints, with standard deviations.

    FOLDER is a results folder. JOINTS is a file with q1_deg or q1_rad and so on (q1_mm where a
    joint slides), or any file that `kinacc init` reads. The exit code is 1 if a row has no pose.

    \b
    std_*           standard deviation by the covariance of the fit, valid given the model
    unexplained_*   rms error of the model at held-out poses, not part of std
    undetermined_*  movement per mm or mrad of what the calibration did not determine

    \b
    Example:
      kinacc predict results/mh180 --joints-deg "10,-20,30,0,45,0"
      kinacc predict results/ur10_b plan.csv --frame instrument -o predicted.csv
    """
    import pandas as pd

    from kinacc.cli import rows
    from kinacc.cli.file_options import joint_answers
    from kinacc.deployment.predict import predict as poses_at
    from kinacc.progress import reporting

    calibration = choice.calibration_of(folder, model, robot, config, session)
    arm = calibration.robot
    inputs = rows.given_joints(arm, joints, joints_deg, joints_rad, joint_answers(file))
    with reporting("predict", bar=True):
        result = poses_at(
            calibration, inputs.joints, inputs.directions, frame, point, inputs.payload
        )
    named = pd.DataFrame(
        {"row": inputs.label, **rows.joint_columns(arm.dh.prismatic, inputs.joints)}
    )
    table = named.join(result.table())
    facts = calibration.facts(frame, point)
    shown = table if out.verbose else table[["row", *_SHOWN]]
    title = "{calibration}: {point} ({orientation} orientation), {frame} frame, {model} model"
    out.show(facts | {"rows": table}, table, [title.format(**facts)], shown)
    rows.say_unused(inputs, calibration)
    rows.warn_unlike(table["status"] != "ok")
    rows.warn_undetermined(table["undetermined_mm"], frame)
    rows.end_where_missing(result.pose.position_mm, "a pose")
