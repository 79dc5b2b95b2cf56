"""A synthetic physical arm in place of the paper's, for which there is no public data."""

from __future__ import annotations

import numpy as np

from kinacc.config.records import Settings
from kinacc.errors import input_error
from kinacc.geometry import quaternion_from_rotation
from kinacc.kinematics.region import Attitude
from kinacc.kinematics.robot import Robot
from kinacc.synthetic.accepted import AcceptedDraw, accepted_draw
from kinacc.synthetic.draw import AS_TUNED, Roughness, physical_robot
from kinacc.synthetic.plan import DOWN, Run, calibration_run, measured

ARM = "mh180"  # whose draws there are


def measure(robot: Robot, settings: Settings, attitude: Attitude = DOWN) -> dict[str, np.ndarray]:
    """Simulated measurements of an accepted draw of the arm. All chance belongs to the draw.

    Parameters
    ----------
    robot : Robot
        The nominal arm; only the one named ``ARM`` can be measured.
    settings : mapping
        Those of ``measurements.synthetic``; another roughness than the one a draw was accepted
        with makes another arm of it.
    attitude : Attitude
        Orientation of the flange about which the poses are planned.

    Returns
    -------
    dict of str to numpy.ndarray
        Columns (n,) of the table ``measurements``, but for fold and subset: joints in rad,
        positions in mm in the robot base.

    Raises
    ------
    InputError
        For an unknown draw and for another arm.
    """
    if robot.name != ARM:
        what = f"is synthetic, but robot {robot.name} is not the arm that was synthesised"
        fix = "give the measurements of this robot in a file (measurements.source: file)"
        raise input_error("measurements.source", what, f"robot: {ARM}", fix)
    draw = accepted_draw(int(settings["draw"]))
    run = calibration_run(robot, int(settings["poses"]), draw.seed, attitude)
    roughness = Roughness(settings["wave_decay"], settings["ripple"])
    return columns(draw, run, float(settings["tracker_noise_mm"]), roughness)


def columns(
    draw: AcceptedDraw, run: Run, tracker_noise_mm: float, roughness: Roughness = AS_TUNED
) -> dict[str, np.ndarray]:
    """Columns of a calibration run on the arm of ``draw``, as ``measure`` returns them."""
    arm = physical_robot(draw.seed, draw.scales, draw.geometry, roughness)
    poses = measured(arm, run, tracker_noise_mm)
    quaternion, count = quaternion_from_rotation(poses.rotation), len(poses.position_mm)
    return {
        "pose": np.arange(count),
        **{f"q{j + 1}": joint for j, joint in enumerate(run.visits.q_rad.T)},
        **{f"s{j + 1}": joint for j, joint in enumerate(run.visits.s.T)},
        "target": np.full(count, "tool", dtype=object),
        **dict(zip(("x_mm", "y_mm", "z_mm"), poses.position_mm.T, strict=True)),
        **dict(zip(("qw", "qx", "qy", "qz"), quaternion.T, strict=True)),
        "repeat": np.zeros(count, dtype=int),
    }
