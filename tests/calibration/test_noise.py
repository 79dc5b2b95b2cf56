"""The noise of a reading, of arms that are off their robot file, against the noise they have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulated import POINT, disturbed, joints, measure

from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.noise import of_readings
from kinacc.kinematics import robot

NOISE_MM = 0.02


def read_again():
    """Positions at 60 configurations, gone to three times by an arm 4 mrad and 2 mm off."""
    rng, arm = np.random.default_rng(1), robot.load("irb120")
    true = disturbed(arm.dh, free_parameters(6), rng, 4e-3, 2.0)
    q = np.repeat(joints(arm, 60, rng), 3, axis=0)[rng.permutation(180)]
    q = q + np.deg2rad(0.02) * rng.uniform(-0.5, 0.5, q.shape)
    return measure(true, q, POINT, rng, NOISE_MM), arm.dh


def test_a_reading_that_went_wrong_is_no_noise():
    observations, nominal = read_again()
    before = of_readings(observations, nominal)
    assert before.freedom == pytest.approx(120, abs=4)
    assert before.per_axis_mm == pytest.approx(NOISE_MM, rel=0.1)
    wrong = observations.position_mm.copy()
    wrong[17] += [0.0, 5.0, -3.0]
    after = of_readings(replace(observations, position_mm=wrong), nominal)
    assert after.freedom < before.freedom
    assert after.std_mm == pytest.approx(before.std_mm, rel=0.03)
