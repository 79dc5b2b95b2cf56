"""Several sessions of one arm: a base each, one robot and one tool."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulated import POINT, POSE, THREE, disturbed, fit, joints, measure

from kinacc.calibration.dh_estimator import free_parameters
from kinacc.kinematics import robot

ARM = robot.load("ur10")
FREE = free_parameters(6, (2, 3))


def observed(kind, sessions, count=120):
    rng = np.random.default_rng(0)
    return measure(disturbed(ARM.dh, FREE, rng), joints(ARM, count, rng), kind, rng, 0.02, sessions)


@pytest.mark.parametrize(("kind", "noise_mm"), [(POINT, 0.02), (THREE, 0.02), (POSE, 0.037)])
def test_sessions_share_the_arm_and_not_the_base(kind, noise_mm):
    seen = observed(kind, 4)
    found = fit(seen, ARM.dh, FREE)
    assert np.sqrt(found.solution.variance) == pytest.approx(noise_mm, rel=0.15)
    assert found.frames.sessions == 4
    # All sessions tell of one arm: together they know it better than the first alone.
    first = replace(seen.select(seen.session == 0), session_names=(None,))
    alone = fit(first, ARM.dh, FREE)
    assert np.nanmedian(found.std / alone.std) == pytest.approx(0.5, abs=0.2)


def test_a_session_of_three_poses_is_placed():
    seen = observed(POINT, 2, 80)
    few = (seen.session == 0) | (np.cumsum(seen.session == 1) <= 3)
    assert np.sqrt(fit(seen.select(few), ARM.dh, FREE).solution.variance) < 0.03
