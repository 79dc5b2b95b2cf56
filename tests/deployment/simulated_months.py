"""A UR10 measured month after month, simulated one 4x4 matrix at a time, apart from kinacc's arm.

Errors of its table, gears that err once and twice a turn, an arm that lengthens as it warms up
(each for another time), joints that come back by so much, a laser tracker that stands elsewhere
where asked for.
"""

from __future__ import annotations

import numpy as np
from oracles.kinematics import UR10, dh_link, rot_x, rot_y, rot_z, trans

from kinacc.calibration import fitting
from kinacc.calibration.dh_estimator import free_parameters, parallel_joints
from kinacc.calibration.frames import frame_terms, known
from kinacc.calibration.observations import Observations, full_poses
from kinacc.deployment.history import Session, history
from kinacc.deployment.record import Calibration
from kinacc.geometry import Pose, compose
from kinacc.kinematics import robot as robots
from kinacc.tables.allowed import MOVED, SAME
from kinacc.tables.columns import Columns

WEIGHT_MM_PER_RAD = 500.0
POSES = 50
GROWTH_PER_K, WARMS_BY_K = 1.2e-5, 4.0  # aluminium
GEARS_RAD, BACK_RAD, NOISE_MM = 1e-4, 1e-5, 0.03


def month(
    year: int, number: int, other_poses: bool, moved: bool, knock_rad: np.ndarray
) -> Observations:
    """The readings of one month; ``knock_rad`` (6,) is added to the joints' zeros."""
    arm, chance = np.random.default_rng([year, 0]), np.random.default_rng([year, 1, number])
    table = [np.array(row) for row in UR10]
    for row in table:
        row += arm.normal(0.0, [1e-3, 0.2, 0.2, 5e-4, 0.0])
    phase = arm.uniform(0.0, 2.0 * np.pi, (2, 6))
    plan = np.random.default_rng([year, 2, number if other_poses else 0])
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
        at = base
        for row, angle in zip(table, turned, strict=True):
            theta, d, a, alpha, beta = row
            grown = 1.0 + GROWTH_PER_K * above_k
            at = at @ dh_link((theta, d * grown, a * grown, alpha, beta), angle)
        at = at @ tool
        x, y, z = chance.normal(0.0, NOISE_MM / WEIGHT_MM_PER_RAD, 3)
        at[:3, :3] = rot_x(x)[:3, :3] @ rot_y(y)[:3, :3] @ rot_z(z)[:3, :3] @ at[:3, :3]
        at[:3, 3] += chance.normal(0.0, NOISE_MM, 3)
        poses.append(at)
    seen = np.array(poses)
    return full_poses(q_rad, Pose(seen[:, :3, :3], seen[:, :3, 3]))


def session(seen: Observations, number: int, moved: bool) -> Session:
    """A line of the series with a DH calibration of its own."""
    arm = robots.load("ur10")
    fit = fitting.fit(
        seen,
        arm.dh,
        free=free_parameters(arm.dh.joints, parallel_joints(arm.dh)),
        rotation_weight_mm_per_rad=WEIGHT_MM_PER_RAD,
        threshold=1e-4,
        frames=frame_terms(seen, known(arm.base, robots.carried(arm))),
    )
    model, frames = fit.model, fit.frames
    calibration = Calibration(str(number), arm, "dh", model, frames.base, {"tool": frames.tool})
    at = compose(frames.base, compose(model.pose(seen.at), frames.tool))
    sizes = np.linalg.norm(seen.position_mm - at.position_mm, axis=1)
    base = MOVED if moved else SAME
    date = f"2026-{number:02}-01"
    return Session(f"ur-{date}", date, "", base, SAME, calibration, seen, sizes)


def year_of(
    year: int,
    months: int = 12,
    other_poses: bool = False,
    moved: bool = False,
    knock_rad: np.ndarray | float = 0.0,
) -> Columns:
    """The history of a year; what ``knock_rad`` is happened before its last month."""
    lines = []
    for number in range(1, months + 1):
        knocked = np.broadcast_to(knock_rad if number == months else 0.0, 6)
        lines.append(session(month(year, number, other_poses, moved, knocked), number, moved))
    return history(lines, WEIGHT_MM_PER_RAD)
