"""A synthetic physical arm in place of the paper's, for which there is no public data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.geometry import quaternion_from_rotation
from kinacc.kinematics import dh
from kinacc.kinematics.region import Attitude
from kinacc.kinematics.robot import Robot
from kinacc.synthetic.accepted import AcceptedDraw, accepted_draw
from kinacc.synthetic.draw import AS_TUNED, TABLE_II, physical_robot
from kinacc.synthetic.plan import DOWN
from kinacc.synthetic.tracker import Run, calibration_run, measured

# How far poses of a nominal arm may be from those of Table II: the arm the draws were made for.
_SAME_ARM_MM = 25.0


def measure(robot: Robot, settings: Mapping, attitude: Attitude = DOWN) -> dict[str, np.ndarray]:
    """Columns of ``measurements``, but for fold and subset, of an accepted draw of the arm.

    ``settings``: those of ``measurements.synthetic``; without a roughness the draw has the one it
    was accepted with. ``attitude``: that of the flange about which the poses are planned. All
    chance belongs to the draw. Raises InputError for an unknown draw and for another arm.
    """
    _require_the_arm(robot)
    stated = {name: settings[name] for name in AS_TUNED._fields if name in settings}
    draw = replace(accepted_draw(int(settings["draw"])), roughness=AS_TUNED._replace(**stated))
    run = calibration_run(robot, int(settings["poses"]), draw.seed, attitude)
    return columns(draw, run, float(settings["tracker_noise_mm"]))


def columns(draw: AcceptedDraw, run: Run, tracker_noise_mm: float) -> dict[str, np.ndarray]:
    """Columns of a calibration run on the arm of ``draw``."""
    arm = physical_robot(draw.seed, draw.scales, draw.geometry, draw.roughness)
    seen = measured(arm, run, tracker_noise_mm)
    quaternion = quaternion_from_rotation(seen.rotation)
    poses, joints = len(seen.position_mm), range(arm.dh.joints)
    return {
        "pose": np.arange(poses),
        **{f"q{j + 1}": run.visits.q_rad[:, j] for j in joints},
        **{f"s{j + 1}": run.visits.s[:, j] for j in joints},
        "target": np.full(poses, "tool", dtype=object),
        **{f"{axis}_mm": seen.position_mm[:, i] for i, axis in enumerate("xyz")},
        **{f"q{part}": quaternion[:, i] for i, part in enumerate("wxyz")},
        "repeat": np.zeros(poses, dtype=int),
    }


def _require_the_arm(robot: Robot) -> None:
    same = robot.dh.joints == TABLE_II.joints and np.array_equal(robot.joint_map, np.eye(6))
    if same:
        q_rad = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 6))
        own, drawn = (dh.forward(each, q_rad).position_mm for each in (robot.dh, TABLE_II))
        same = bool(np.linalg.norm(own - drawn, axis=1).max() < _SAME_ARM_MM)
    if not same:
        raise InputError(
            Problem(
                "measurements.source",
                f"is synthetic, but robot {robot.name} is not the arm that was synthesised",
                "robot: mh180",
                "give the measurements of this robot in a file (measurements.source: file)",
            )
        )
