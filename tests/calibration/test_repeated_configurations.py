"""Configurations read again and again tell no more of the arm than the poses they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulated import POSE, THREE, anywhere, fit, measure

from kinacc.calibration.dh_estimator import free_parameters
from kinacc.geometry import exp_so3
from kinacc.kinematics import robot

ARM = robot.load("mh180")
POSES, REPEATS, DRAWS = 24, 5, 40
OF_POSE_MM, OF_TARGET_MM, READING_MM = 0.2, 0.1, 0.03


def read(seed, kind):
    """Every target at every pose five times; what no model explains is the same in all five."""
    rng, frames = np.random.default_rng(seed), np.random.default_rng(3)
    share = frames.uniform(0.2, 0.8, (POSES, 6))
    q = ARM.q_min_rad + share * (ARM.q_max_rad - ARM.q_min_rad)
    placed = anywhere(frames, 900.0, 1), anywhere(frames, 90.0, 3 if kind == THREE else 1)
    seen = measure(ARM.dh, q, kind, rng, OF_TARGET_MM, 1, placed, noise_rad=3e-4)
    shift = OF_POSE_MM * rng.normal(size=(POSES, 3))[seen.pose]
    seen = replace(seen, position_mm=seen.position_mm + shift)
    again = seen.select(np.repeat(np.arange(len(seen)), REPEATS))
    noise = rng.normal(size=(2, len(again), 3))
    return replace(
        again,
        repeat=np.arange(len(again)) % REPEATS,
        position_mm=again.position_mm + READING_MM * noise[0],
        rotation=exp_so3(3e-5 * noise[1]) @ again.rotation,
    )


@pytest.mark.parametrize("kind", [THREE, POSE])
def test_parameters_are_off_by_as_much_as_is_said_where_poses_are_read_five_times(kind):
    """Two standard deviations hold the true parameter in 95 of 100 draws, within 4."""
    inside = []
    for seed in range(DRAWS):
        found = fit(read(seed, kind), ARM.dh, free_parameters(6))
        off, std = found.model.start - ARM.dh.start, found.std.ravel()
        known = np.isfinite(std)
        inside.append(np.abs(off[known]) <= 2.0 * std[known])
    assert np.mean(inside) == pytest.approx(0.954, abs=0.04)
