"""``kinacc compensate``: wanted poses to the joints that reach them."""

from __future__ import annotations

import click

from kinacc.cli import choice
from kinacc.cli.output import answers


@click.command("compensate")
@choice.calibration_options
@click.argument("poses", type=click.Path(), required=False)
@click.option("--pose", multiple=True, help='A pose in mm: "x,y,z,qw,qx,qy,qz".')
@click.option("--near-deg", help="Joints the posture should be near to, for rows without joints.")
@click.option(
    "--program",
    type=click.Path(),
    help="Instead of poses: joints written for the nominal arm, to be corrected.",
)
@choice.point_options
@answers(table=True)
def compensate(
    folder, model, config, robot, poses, pose, near_deg, program, frame, point, session, out
) -> None:
    """Find the joints at which the calibrated arm puts its tool where it is wanted.

    FOLDER is the results folder of a data set. POSES is a file with x_mm, y_mm,
    z_mm and qw, qx, qy, qz (or rvx_deg .. a rotation vector, or rx_deg .. intrinsic XYZ angles),
    or in any form that kinacc init reads: X, Y, Z, A, B, C of KUKA, W, P, R of FANUC. Columns
    q1_deg and so on, where the file has them, say near which joints the posture is wanted; without
    them the posture nearest to zero is taken.

    Joints are given only where the forward model was seen to come back to the pose within 1e-6 mm;
    every other row says in words why it has none. Exit code 1 if a row has none. An arm of four or
    five axes comes back to the position, and is turned as near as it can be.

    \b
    Example:
      kinacc compensate results/mh180 --pose "1500,200,900,0,1,0,0"
      kinacc compensate results/ur10_b target_poses.csv -o joints.csv
      kinacc compensate results/mh180 --program program.csv -o corrected.csv
    """
    from kinacc.cli import rows, target_poses
    from kinacc.deployment.compensate import compensate as joints_for
    from kinacc.deployment.sensitivity import deviations
    from kinacc.progress import reporting

    calibration = choice.calibration_of(folder, model, robot, config, session)
    given = target_poses.poses(calibration, poses, pose, near_deg, program, frame, point)
    with reporting("compensate", bar=True):
        found = joints_for(
            calibration, given.pose, given.joints, given.directions, frame, point, given.payload
        )
        unlike = target_poses.unlike_measured(calibration, found, point)
    answer = target_poses.compensated(
        calibration, given, found, frame, point, unlike, program is not None
    )
    out.deliver(answer)
    rows.say_unused(given, calibration)
    rows.warn_unlike(unlike)
    at = target_poses.reached(calibration, found)
    rows.warn_undetermined(deviations(calibration, at, frame, point)[1][:, 0], frame)
    rows.end_where_missing(found.q_rad, "joints")
