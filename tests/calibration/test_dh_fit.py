"""DH fits: a known arm found again from far off, with base and tool known or not."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration import fitting, frames
from kinacc.calibration.constraints import free_parameters
from kinacc.calibration.observations import full_poses
from kinacc.geometry import IDENTITY, Pose, compose, exp_so3, log_so3
from kinacc.kinematics import dh, robot

WEIGHT = 500.0
FIVE_DEG = np.deg2rad(5.0)
NOISE_MM, NOISE_RAD = 0.05, 1e-4


def disturbed(arm, free, rng):
    """Up to 5 degrees and 20 mm off; axes meant to be parallel (Hayati) within a degree."""
    shift = rng.uniform(-1, 1, (6, 5)) * [FIVE_DEG, 20.0, 20.0, FIVE_DEG, FIVE_DEG] * free
    shift[free[:, 4], 3:] *= 0.2
    return arm.dh.with_parameters(arm.dh.start + shift.ravel())


def measured(true, base, tool, rng, count=90):
    arm_range = np.pi * np.array([0.9, 0.4, 0.5, 0.9, 0.7, 0.9])
    q = rng.uniform(-arm_range, arm_range, (count, 6))
    seen = compose(base, compose(dh.forward(true, q), tool))
    turn = exp_so3(NOISE_RAD * rng.normal(size=(count, 3)))
    return q, Pose(turn @ seen.rotation, seen.position_mm + NOISE_MM * rng.normal(size=(count, 3)))


def anywhere(rng, distance_mm):
    return Pose(exp_so3(rng.normal(size=3) * 1.5), distance_mm * rng.normal(size=3))


@pytest.mark.parametrize("name", ["mh180", "ur10"])
@pytest.mark.parametrize("mode", ["known", "unknown", "points"])
def test_poses_are_found_again_from_five_degrees_and_twenty_mm(name, mode):
    arm = robot.load(name)
    hayati = (2, 3) if name == "ur10" else ()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        free = free_parameters(6, hayati)
        true = disturbed(arm, free, rng)
        base, tool = anywhere(rng, 2000.0), anywhere(rng, 100.0)
        if mode == "known":
            base = tool = IDENTITY
        q, seen = measured(true, base, tool, rng)
        if mode == "points":
            seen = Pose(np.full_like(seen.rotation, np.nan), seen.position_mm)
        found = fitting.fit(
            full_poses(q, seen),
            arm.dh,
            free=free,
            rotation_weight_mm_per_rad=WEIGHT,
            threshold=1e-3,
            frames=frames.known() if mode == "known" else None,
        )
        assert np.sqrt(found.solution.variance) < 1.1 * NOISE_MM
        # Poses it has not seen, where the true arm goes.
        new = rng.uniform(-1.0, 1.0, (50, 6))
        wanted = compose(base, compose(dh.forward(true, new), tool))
        got = compose(found.frames.base, compose(dh.forward(found.model, new), found.frames.tool))
        assert np.linalg.norm(got.position_mm - wanted.position_mm, axis=1).max() < 0.3
        if mode != "points":
            turn = log_so3(got.rotation @ np.swapaxes(wanted.rotation, 1, 2))
            assert np.linalg.norm(turn, axis=1).max() < 1e-3


def test_antiparallel_lengths_move_as_little_as_their_difference_asks():
    arm = robot.load("mh180")
    rng = np.random.default_rng(3)
    vector = arm.dh.start.reshape(6, 5).copy()
    vector[1, 1], vector[2, 1] = 300.0, 301.0  # d2, d3: only d2 - d3 = -1 shows
    q, seen = measured(arm.dh.with_parameters(vector.ravel()), IDENTITY, IDENTITY, rng)
    found = fitting.fit(
        full_poses(q, seen),
        arm.dh,
        free=free_parameters(6),
        rotation_weight_mm_per_rad=WEIGHT,
        threshold=1e-3,
        frames=frames.known(),
    )
    d = found.model.d_mm
    assert d[1] - d[2] == pytest.approx(-1.0, abs=0.05)
    assert abs(d[1] + d[2]) < 0.1
    assert np.isnan(found.std[[1, 2], 1]).all()
    others = np.ones((6, 4), dtype=bool)
    others[[1, 2], 1] = False
    assert np.isfinite(found.std[:, :4][others]).all()
    assert np.isnan(found.std[:, 4]).all()  # no Hayati term was asked for
    assert found.solution.spectrum.rank == 23
