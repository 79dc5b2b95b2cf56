"""The calibration run on a synthetic arm, as a laser tracker with a probe on the flange sees it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics.region import Attitude
from kinacc.kinematics.robot import Robot
from kinacc.synthetic import plan
from kinacc.synthetic.draw import noise_generator
from kinacc.synthetic.physical import PhysicalRobot, Visits, pose

PROBE_MM = 200.0  # distance over which the probe's orientation is measured


@dataclass(frozen=True)
class Run:
    """What was done and how well it is seen, in units of chance: one standard normal each.

    ``visits`` as the arm makes them; ``position`` and ``rotation`` (n, 3) of the tracker.
    """

    visits: Visits
    position: np.ndarray
    rotation: np.ndarray


def calibration_run(robot: Robot, poses: int, seed: int, attitude: Attitude = plan.DOWN) -> Run:
    """The plan's ``poses`` visited in order, with the chance of draw ``seed``."""
    q_rad = plan.configurations(robot, poses, attitude)
    rng = noise_generator(seed)
    visits = Visits(
        q_rad, plan.directions(q_rad), plan.time_h(poses), rng.standard_normal((poses, 6))
    )
    return Run(visits, rng.standard_normal((poses, 3)), rng.standard_normal((poses, 3)))


def measured(arm: PhysicalRobot, run: Run, tracker_noise_mm: float) -> Pose:
    """Measured flange poses (n, ...), tracker frame = robot base."""
    true = pose(arm, run.visits)
    turn = exp_so3(tracker_noise_mm / PROBE_MM * run.rotation)
    return Pose(turn @ true.rotation, true.position_mm + tracker_noise_mm * run.position)
