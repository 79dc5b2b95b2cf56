"""Several sessions of one arm: a base each, one robot and one tool."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import simulated

from kinacc.calibration import fitting
from kinacc.calibration.constraints import free_parameters
from kinacc.kinematics import robot

ARM = robot.load("ur10")
FREE = free_parameters(6, (2, 3))


def observed(kind, sessions, count=120, seed=0, noise_mm=0.02):
    rng = np.random.default_rng(seed)
    true = simulated.disturbed(ARM.dh, FREE, rng)
    q = simulated.joints(ARM, count, rng)
    return simulated.measure(true, q, kind, rng, noise_mm, sessions)


def fit(seen):
    return fitting.fit(seen, ARM.dh, free=FREE, rotation_weight_mm_per_rad=500.0, threshold=1e-3)


@pytest.mark.parametrize("kind", [simulated.POINT, simulated.THREE, simulated.POSE])
def test_sessions_share_the_arm_and_not_the_base(kind):
    seen = observed(kind, 4)
    found = fit(seen)
    noise = np.sqrt(found.solution.variance)
    assert noise == pytest.approx(0.02 if kind != simulated.POSE else 0.037, rel=0.15)
    assert found.frames.sessions == 4
    # All sessions tell of one arm: together they know it better than the first alone.
    first = seen.select(seen.session == 0)
    alone = fit(replace(first, session_names=(None,)))
    assert np.nanmedian(found.std / alone.std) == pytest.approx(0.5, abs=0.2)


def test_a_session_of_three_poses_is_placed():
    seen = observed(simulated.POINT, 2, 80)
    few = (seen.session == 0) | (np.cumsum(seen.session == 1) <= 3)
    found = fit(seen.select(few))
    assert np.sqrt(found.solution.variance) < 0.03
