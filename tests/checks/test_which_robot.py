"""Every shipped arm, measured with errors of its own, is the one that fits best."""

import numpy as np
import pytest

from kinacc.calibration.observations import Observations
from kinacc.checks.which_robot import linear_misfit
from kinacc.geometry import Pose, compose, exp_so3
from kinacc.kinematics import dh, robot

ARMS = {name: robot.load(name) for name in robot.shipped()}
# Equal but for limits, or for the length of the flange, which the target takes up.
ALIKE = [{"kr120_r2700_2", "kr210_r2700_2"}, {"gp225", "mh180"}]
BASE = Pose(exp_so3(np.array([0.2, 0.3, 1.0])), np.array([900.0, -400.0, 200.0]))
TOOL = Pose(np.eye(3), np.array([30.0, -20.0, 120.0]))


@pytest.mark.parametrize("name", ARMS)
def test_the_arm_that_was_measured_fits_best(name):
    arm, rng = ARMS[name], np.random.default_rng(0)
    low, high = np.clip(arm.q_min_rad, -np.pi, None), np.clip(arm.q_max_rad, None, np.pi)
    shown = low + (high - low) * rng.uniform(0.2, 0.8, (40, arm.dh.joints))
    size = np.tile([5e-4, 0.5, 0.5, 5e-4, 0.0], arm.dh.joints)
    true = arm.dh.with_parameters(arm.dh.start + size * rng.normal(size=size.size))
    point = compose(compose(BASE, dh.forward(true, arm.dh_joints(shown))), TOOL).position_mm
    none, spread = np.zeros(40, dtype=int), np.median(np.linalg.norm(point - point.mean(0), axis=1))
    misfits = {
        other: linear_misfit(
            each.dh,
            Observations(
                each.dh_joints(shown), 0.0 * shown, point, np.full((40, 3, 3), np.nan),
                np.arange(40), none, none, none,
            ),
            spread,
        )
        for other, each in ARMS.items()
        if each.dh.joints == arm.dh.joints
    }  # fmt: skip
    best = min(misfits, key=misfits.get)
    assert best == name or {best, name} in ALIKE
