"""The calibration run: poses in order, how the arm arrives, and what a laser tracker reads.

One plan for every synthetic arm, as a cell has one measuring programme. The poses enclose the
evaluation space: a sector of a cylinder larger than the space on every side, the flange in its
reference orientation and turned about its own axes beyond +-45 degrees, both wrist configurations.
The tracker sees a probe on the flange.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.geometry import Pose, exp_so3, rotation_x
from kinacc.kinematics.inverse import closed_form
from kinacc.kinematics.region import Attitude, Cylinder, fill, reference_rotation, tool_poses
from kinacc.kinematics.robot import Robot
from kinacc.synthetic.physical import PhysicalRobot, Visits, pose

SPACE = Cylinder(1150.0, 1000.0, -50.0, 600.0, np.deg2rad(-5.0), np.deg2rad(65.0))
TURN_DEG = 50.0
# Half of the poses stand at the corners of the turns, where the evaluation space has its poses.
CORNER_SHARE = 0.5
CORNER_DEG = (43.0, TURN_DEG)
DOWN = Attitude(rotation_x(np.pi))
BRANCHES = 2  # the first: facing the space, elbow up, either wrist
RUN_H = 6.0
PROBE_MM = 200.0  # distance over which the probe's orientation is measured
_PLAN_SEED = 180
_BLOCK = 256


def configurations(robot: Robot, poses: int, attitude: Attitude = DOWN) -> np.ndarray:
    """Joints (poses, 6) in measuring order, rad, inside the limits of ``robot``.

    ``attitude`` is that of the flange before its turns. A longer plan begins with the shorter one.
    """
    rng = np.random.default_rng(_PLAN_SEED)
    form = closed_form.SixAxes(robot.dh, parallel=False)
    chosen_rad = np.empty((0, 6))
    while len(chosen_rad) < poses:
        q_rad, reached = form.solve(_poses(rng, attitude))
        rows, branch = np.arange(_BLOCK), rng.integers(0, BRANCHES, _BLOCK)
        chosen, good = q_rad[rows, branch], reached[rows, branch]
        good &= np.all((chosen >= robot.q_min_rad) & (chosen <= robot.q_max_rad), axis=1)
        chosen_rad = np.vstack([chosen_rad, chosen[good]])
    return chosen_rad[:poses]


def directions(q_rad: np.ndarray) -> np.ndarray:
    """Travel directions (n, 6), -1 or +1, of visiting joints (n, 6) in order from the zero pose."""
    before = np.vstack([np.zeros(q_rad.shape[1]), q_rad[:-1]])
    return np.where(q_rad < before, -1, 1).astype(np.int8)


def time_h(poses: int) -> np.ndarray:
    """Time (n,) of each visit since the cold start."""
    return RUN_H * (np.arange(poses) + 0.5) / poses


@dataclass(frozen=True)
class Run:
    """What was done and how well it is seen, in units of chance: one standard normal each.

    ``visits`` as the arm makes them; ``position`` and ``rotation`` (n, 3) of the tracker.
    """

    visits: Visits
    position: np.ndarray
    rotation: np.ndarray


def calibration_run(robot: Robot, poses: int, seed: int, attitude: Attitude = DOWN) -> Run:
    """The plan's ``poses`` visited in order, with the chance of draw ``seed``."""
    q_rad = configurations(robot, poses, attitude)
    rng = np.random.default_rng([seed, 2])  # [seed, 1] draws the arm
    visits = Visits(q_rad, directions(q_rad), time_h(poses), rng.standard_normal((poses, 6)))
    return Run(visits, rng.standard_normal((poses, 3)), rng.standard_normal((poses, 3)))


def measured(arm: PhysicalRobot, run: Run, tracker_noise_mm: float) -> Pose:
    """Measured flange poses (n, ...), tracker frame = robot base."""
    true = pose(arm, run.visits)
    turn = exp_so3(tracker_noise_mm / PROBE_MM * run.rotation)
    return Pose(turn @ true.rotation, true.position_mm + tracker_noise_mm * run.position)


def _poses(rng: np.random.Generator, attitude: Attitude) -> Pose:
    cells = fill(SPACE, rng.random((_BLOCK, 3)))
    inside = rng.uniform(-TURN_DEG, TURN_DEG, (_BLOCK, 3))
    corner = rng.uniform(*CORNER_DEG, (_BLOCK, 3)) * rng.choice([-1.0, 1.0], (_BLOCK, 3))
    at_corner = rng.random(_BLOCK) < CORNER_SHARE
    turned = reference_rotation(np.deg2rad(np.where(at_corner[:, None], corner, inside)))
    return tool_poses(cells, attitude.reference, turned, attitude.frame)
