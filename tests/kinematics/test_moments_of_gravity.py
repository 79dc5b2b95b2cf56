"""Moments that bend joints, held to the work of gravity by central differences."""

import numpy as np

from kinacc.kinematics import dh, robot
from kinacc.kinematics.compliance import STANDARD_GRAVITY, ComplianceModel
from kinacc.kinematics.model import JointState

STEP_RAD = 1e-5


def work_nm(model, q_rad):
    """Work of gravity (n,) on links and payload from the base, N m."""
    total = np.zeros(len(q_rad))
    masses = [*model.links, model.payload]
    for joint, (mass, *centre) in zip([*range(1, 7), 6], masses, strict=True):
        part = dh.DHModel(
            *(getattr(model.dh, name)[:joint] for name in dh.PARAMETERS),
            model.dh.prismatic[:joint],
        )
        frame = dh.forward(part, q_rad[:, :joint])
        place_mm = frame.position_mm + frame.rotation @ np.array(centre)
        total += STANDARD_GRAVITY * 1e-3 * mass * (place_mm @ model.gravity)
    return total


def test_the_moment_of_every_joint_is_the_slope_of_the_work():
    """An arm on a wall: gravity has a moment about the first joint too."""
    rng = np.random.default_rng(3)
    gravity = rng.normal(size=3)
    model = ComplianceModel(
        robot.load("ur10").dh,
        np.zeros((6, 2)),
        gravity / np.linalg.norm(gravity),
        np.column_stack([rng.uniform(1, 9, 6), rng.normal(0, 90, (6, 3))]),
        np.array([4.0, 20.0, -30.0, 80.0]),
    )
    q_rad = rng.uniform(-3, 3, (20, 6))
    moments = model.moments(JointState(q_rad))[..., 0]
    for joint in range(6):
        step = STEP_RAD * np.eye(6)[joint]
        slope = (work_nm(model, q_rad + step) - work_nm(model, q_rad - step)) / (2 * STEP_RAD)
        np.testing.assert_allclose(moments[:, joint], slope, atol=1e-6)
