"""Moments that bend joints, held to the derivative of the potential energy."""

import numpy as np
from oracles import compliant_arm as oracle

from kinacc.kinematics import robot
from kinacc.kinematics.compliance import ComplianceModel
from kinacc.kinematics.model import JointState


def test_the_moment_of_every_joint_is_the_slope_of_the_energy():
    """An arm on a wall: gravity has a moment about the first joint too."""
    rng, arm = np.random.default_rng(3), robot.load("ur10").dh
    gravity, payload = rng.normal(size=3), np.array([4.0, 20.0, -30.0, 80.0])
    links = np.column_stack([rng.uniform(1, 9, 6), rng.normal(0, 90, (6, 3))])
    model = ComplianceModel(
        arm, np.zeros((6, 2)), gravity / np.linalg.norm(gravity), links, payload
    )
    bodies = [oracle.Body(mass, tuple(centre)) for mass, *centre in (*links, payload)]
    of_energy = oracle.Arm(arm.start.reshape(6, 5), bodies[:6], gravity=gravity)
    q_rad, joints = rng.uniform(-3, 3, (20, 6)), range(1, 7)
    moments, levers = np.moveaxis(model.moments(JointState(q_rad)), 2, 0)
    wanted = [[oracle.moment_nm(of_energy, q, j, bodies[6]) for j in joints] for q in q_rad]
    np.testing.assert_allclose(moments, wanted, atol=1e-9)
    wanted = [[oracle.lever_mm(of_energy, q, j) for j in joints] for q in q_rad]
    np.testing.assert_allclose(levers, wanted, atol=1e-9)
