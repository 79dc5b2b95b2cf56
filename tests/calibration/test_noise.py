"""The noise of a reading, of arms that are off their robot file, against the noise they have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from simulated import POINT, THREE, disturbed, joints, measure

from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.misfit import misfit
from kinacc.calibration.noise import of_readings
from kinacc.kinematics import robot

NOISE_MM = 0.02


def read_again(apart_deg=0.0, kind=POINT):
    """Positions at 60 configurations, gone to three times by an arm 4 mrad and 2 mm off."""
    rng, arm = np.random.default_rng(1), robot.load("irb120")
    true = disturbed(arm.dh, free_parameters(6), rng, 4e-3, 2.0)
    q = np.repeat(joints(arm, 60, rng), 3, axis=0)[rng.permutation(180)]
    q = q + np.deg2rad(apart_deg) * rng.uniform(-0.5, 0.5, q.shape)
    return measure(true, q, kind, rng, NOISE_MM), arm.dh


def test_a_reading_that_went_wrong_is_no_noise():
    observations, nominal = read_again()
    before = of_readings(observations, nominal)
    assert (before.freedom, before.readings, before.configurations) == (120, 180, 60)
    # Exactly the same joints, whatever the model: what pooled readings differ.
    place = pd.DataFrame(observations.position_mm)
    variance = place.groupby([*observations.q_rad.T]).var().mean()
    assert before.std_mm == pytest.approx(np.sqrt(variance), rel=1e-6)
    assert before.per_axis_mm == pytest.approx(np.sqrt(variance.mean()), rel=1e-6)
    observations, nominal = read_again(0.02)
    wrong = observations.position_mm.copy()
    wrong[17] += [0.0, 5.0, -3.0]
    after = of_readings(replace(observations, position_mm=wrong), nominal)
    assert (after.freedom, after.readings, after.configurations) == (119, 179, 60)
    few = np.argsort(observations.q_rad[:, 0])[:5]  # three and two, of which one is wrong
    place = observations.position_mm[few] + np.eye(5)[0][:, None] * 5.0
    found = of_readings(replace(observations.select(few), position_mm=place), nominal)
    assert found.readings == 4
    tables = {"model_selection": {"model": ["dh"], "held_out_rms_mm": [0.3]}}
    assert misfit(tables, robot.load("irb120"), "dh").held_out_mm == pytest.approx(0.3 / 3**0.5)
    assert after.per_axis_mm == pytest.approx(NOISE_MM, rel=0.1)


def test_readings_of_other_targets_are_not_compared():
    found = of_readings(*read_again(0.0, THREE))
    assert found.freedom == 3 * 120
    assert found.per_axis_mm == pytest.approx(NOISE_MM, rel=0.1)
