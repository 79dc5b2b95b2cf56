"""Several sessions of one arm: a base each, one robot and one tool."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulated import POINT, POSE, THREE, anywhere, disturbed, fit, joints, measure
from test_few_poses import settings

from kinacc.calibration import tables
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.models import estimators
from kinacc.geometry import Pose
from kinacc.kinematics import robot

ARM = robot.load("ur10")
FREE = free_parameters(6, (2, 3))


@pytest.mark.parametrize(("kind", "noise_mm"), [(POINT, 0.02), (THREE, 0.02), (POSE, 0.037)])
def test_sessions_share_the_arm_and_not_the_base(kind, noise_mm):
    rng = np.random.default_rng(0)
    seen = measure(disturbed(ARM.dh, FREE, rng), joints(ARM, 120, rng), kind, rng, 0.02, 4)
    found = fit(seen, ARM.dh, FREE)
    assert np.sqrt(found.solution.variance) == pytest.approx(noise_mm, rel=0.15)
    assert found.frames.sessions == 4
    # All sessions tell of one arm: together they know it better than the first alone.
    first = replace(seen.select(seen.session == 0), session_names=(None,))
    alone = fit(first, ARM.dh, FREE)
    assert np.nanmedian(found.std / alone.std) == pytest.approx(0.5, abs=0.2)


def test_a_dh_model_that_follows_the_vec_model_is_of_all_sessions():
    """Of both fits the frames are those of a table, as stages hand them on."""
    rng, shift = np.random.default_rng(2), [900.0, -400.0, 50.0]
    first, tools = anywhere(rng, 900.0), anywhere(rng, 90.0, 1)
    bases = Pose(np.stack(2 * [first.rotation]), first.position_mm + np.outer([0.0, 1.0], shift))
    true = disturbed(ARM.dh, np.ones((6, 5), dtype=bool), rng)
    seen = measure(true, joints(ARM, 60, rng), POSE, rng, 0.02, 2, (bases, tools))
    calibration, found = settings(), {}
    calibration["vec"] |= {"order": 0, "prior": "stated"}
    calibration["dh"]["fit_to"] = "vec"
    for kind, estimator in estimators(calibration, ARM, seen).items():
        fitted, names = estimator.fit(seen, found), (seen.target_names, seen.session_names)
        table = tables.frames_columns({kind: fitted.frames}, *names)
        found[kind] = replace(fitted, frames=tables.frames_of(table, kind, *names))
    place = found["dh"].frames.bases.position_mm
    np.testing.assert_allclose(place[1] - place[0], shift, atol=0.5)
