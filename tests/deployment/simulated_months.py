"""A UR10 measured month after month, simulated one 4x4 matrix at a time, apart from kinacc's arm.

Errors of its table, gears that err once and twice a turn, an arm that lengthens as it warms up
(each for another time), joints that come back by so much, a laser tracker that stands elsewhere
where asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from oracles.controllers.arms import ARMS
from oracles.kinematics import dh_forward, rot_x, rot_y, rot_z, trans
from pose_checks import of_matrices
from scipy.spatial.transform import Rotation
from small_arms import WEIGHT, results_of

from kinacc.calibration.observations import Observations, full_poses
from kinacc.deployment.folder import calibration
from kinacc.deployment.history import Session
from kinacc.tables.allowed import SAME

POSES = 50
GROWTH_PER_K, WARMS_BY_K = 1.2e-5, 4.0  # aluminium
GEARS_RAD, BACK_RAD, NOISE_MM = 1e-4, 1e-5, 0.03


def month(
    number: int,
    knock_rad: Sequence[float] | float = 0.0,
    other_poses: bool = False,
    moved: bool = False,
) -> Observations:
    """The readings of one month; ``knock_rad`` (6,) is added to the joints' zeros."""
    arm, chance = np.random.default_rng([0, 0]), np.random.default_rng([0, 1, number])
    table = ARMS["ur"].table + arm.normal(0.0, [1e-3, 0.2, 0.2, 5e-4, 0.0], (6, 5))
    phase = arm.uniform(0.0, 2.0 * np.pi, (2, 6))
    plan = np.random.default_rng([0, 2, number if other_poses else 0])
    q_rad = plan.uniform(-1.6, 1.6, (POSES, 6))
    base = trans(2500.0, -700.0, 300.0) @ rot_z(2.0) @ rot_x(0.02)
    if moved:
        base = trans(*chance.normal(0.0, 400.0, 3)) @ base @ rot_z(chance.uniform(-1, 1))
    tool = trans(15.0, -30.0, 120.0) @ rot_y(0.4)
    warm_k = WARMS_BY_K * (1.0 - np.exp(-np.linspace(0.0, chance.uniform(0.5, 3.0), POSES)))
    poses = []
    for q, above_k in zip(q_rad, warm_k, strict=True):
        gears = GEARS_RAD * (np.sin(q + phase[0]) + np.sin(2 * q + phase[1]))
        turned = q + gears + knock_rad + chance.normal(0.0, BACK_RAD, 6)
        grown = 1.0 + GROWTH_PER_K * above_k
        at = base @ dh_forward(table * [1.0, grown, grown, 1.0, 1.0], turned) @ tool
        turn = Rotation.from_rotvec(chance.normal(0.0, NOISE_MM / WEIGHT, 3))
        at[:3, :3] = turn.as_matrix() @ at[:3, :3]
        at[:3, 3] += chance.normal(0.0, NOISE_MM, 3)
        poses.append(at)
    return full_poses(q_rad, of_matrices(poses))


def session(seen: Observations, number: int, base: str = SAME) -> Session:
    """A line of the series with a DH calibration of its own."""
    arm = calibration(results_of("ur10", seen), "dh", str(number))
    at = arm.pose(seen.at, "instrument")
    sizes = np.linalg.norm(seen.position_mm - at.position_mm, axis=1)
    date = f"2026-{number:02}-01"
    return Session(f"ur-{date}", date, base, SAME, arm, arm.model.dh, seen, sizes)
