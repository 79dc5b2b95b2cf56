"""DH fits: a known arm found again from far off, with base and tool known or not."""

from __future__ import annotations

import numpy as np
import pytest
from pose_checks import movement
from simulated import POINT, POSE, anywhere, far_off, fit, frames_of, measure, predicted

from kinacc.calibration import frames
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.errors import InputError
from kinacc.geometry import compose
from kinacc.kinematics import dh, robot

REACH = np.pi * np.array([0.9, 0.4, 0.5, 0.9, 0.7, 0.9])


@pytest.mark.parametrize(("name", "hayati"), [("mh180", ()), ("ur10", (2, 3))])
@pytest.mark.parametrize("mode", ["known", POSE, POINT])
def test_poses_are_found_again_from_five_degrees_and_twenty_mm(name, hayati, mode):
    arm, free = robot.load(name), free_parameters(6, hayati)
    for seed in range(4):
        rng = np.random.default_rng(seed)
        true, known = far_off(arm.dh, free, rng), frames.known()
        if mode != "known":
            known = frames_of(anywhere(rng, 2000.0, 1), anywhere(rng, 100.0, 1))
        q = rng.uniform(-REACH, REACH, (90, 6))
        kind = POINT if mode == POINT else POSE
        seen = measure(true, q, kind, rng, frames=(known.bases, known.targets))
        held = frames.FrameParameters.none(known) if mode == "known" else None
        found = fit(seen, arm.dh, free, frames=held)
        assert np.sqrt(found.solution.variance) < 1.1 * 0.05
        new = rng.uniform(-1.0, 1.0, (50, 6))
        wanted = compose(known.base, compose(dh.forward(true, new), known.tool))
        got = predicted(found, new)
        shift, turn = np.linalg.norm(movement(wanted, got).reshape(-1, 2, 3), axis=2).T
        assert shift.max() < 0.3
        assert mode == POINT or turn.max() < 1e-3


def test_fewer_numbers_than_parameters_are_refused():
    arm, rng = robot.load("mh180"), np.random.default_rng(0)
    free = free_parameters(6)
    seen = measure(arm.dh, rng.uniform(-REACH, REACH, (4, 6)), POINT, rng)
    with pytest.raises(InputError, match="12 residual components of 4 training rows for the 33"):
        fit(seen, arm.dh, free)
