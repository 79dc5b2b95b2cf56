"""The noise of a reading, of arms that are off their robot file, against the noise they have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulated import POINT, POSE, THREE, disturbed, joints, measure

from kinacc.calibration.constraints import free_parameters
from kinacc.calibration.noise import of_readings
from kinacc.kinematics import robot

NOISE_MM = 0.02


def read_again(kind, apart_deg, sessions=2, seed=1):
    """60 configurations gone to three times by an arm 4 mrad and 2 mm off its robot file."""
    rng, arm = np.random.default_rng(seed), robot.load("irb120")
    true = disturbed(arm.dh, free_parameters(6), rng, 4e-3, 2.0)
    q = np.repeat(joints(arm, 60, rng), 3, axis=0)[rng.permutation(180)]
    q = q + np.deg2rad(apart_deg) * rng.uniform(-0.5, 0.5, q.shape)
    return measure(true, q, kind, rng, NOISE_MM, sessions), arm.dh


@pytest.mark.parametrize("kind", [POINT, THREE, POSE])
@pytest.mark.parametrize("apart_deg", [0.0, 0.02, 0.08])
def test_joints_that_differ_by_up_to_a_tenth_of_a_degree_add_nothing_to_the_noise(kind, apart_deg):
    found = of_readings(*read_again(kind, apart_deg))
    assert found.freedom > 50
    spread = 1.0 / np.sqrt(2.0 * 3.0 * found.freedom)
    assert found.per_axis_mm == pytest.approx(NOISE_MM, rel=0.02 + 3.0 * spread)


def test_readings_of_two_set_ups_of_the_instrument_are_not_compared():
    observations, nominal = read_again(POINT, 0.02, sessions=1)
    assert of_readings(observations, nominal).freedom == 120
    alone = replace(
        observations,
        session=np.arange(180) % 180,
        session_names=tuple(map(str, range(180))),
    )
    assert of_readings(alone, nominal).freedom == 0


def test_a_reading_that_went_wrong_is_no_noise():
    observations, nominal = read_again(POINT, 0.02, sessions=1)
    before = of_readings(observations, nominal)
    wrong = observations.position_mm.copy()
    wrong[17] += [0.0, 5.0, -3.0]
    after = of_readings(replace(observations, position_mm=wrong), nominal)
    assert after.freedom < before.freedom
    assert after.std_mm == pytest.approx(before.std_mm, rel=0.03)
