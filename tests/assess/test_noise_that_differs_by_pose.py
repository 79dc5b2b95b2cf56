"""Bounds where every candidate has a noise of its own, larger across a beam than along it."""

from __future__ import annotations

import numpy as np

from kinacc.assess.adaptive import Candidates
from kinacc.assess.registry import ADAPTIVE, RECOMMENDED
from kinacc.assess.simulate import carry_on, noisy

POINTS, BUDGET, CAMPAIGNS = 12, 20, 40


def of_a_tracker():
    """Covariances (m, 3, 3) that are up to ten times as large across the beam as along it, and
    errors (m, 3) of which the largest lies across, where the noise is largest."""
    rng = np.random.default_rng(3)
    beam = rng.normal(size=(POINTS, 3))
    beam /= np.linalg.norm(beam, axis=1)[:, None]
    along, across = 0.03, np.linspace(0.05, 0.3, POINTS)
    own = beam[:, :, None] * beam[:, None, :]
    covariance = (across**2)[:, None, None] * (np.eye(3) - own) + along**2 * own
    errors = 0.02 * rng.normal(size=(POINTS, 3))
    side = np.cross(beam[-1], (1.0, 0.0, 0.0))
    errors[-1] = 1.5 * side / np.linalg.norm(side)
    return covariance, errors


def held(told):
    """How many upper and lower bounds hold of campaigns that are told these covariances."""
    covariance, errors = of_a_tracker()
    root, upper, lower = np.linalg.cholesky(covariance), 0, 0
    for number in range(CAMPAIGNS):
        order = np.random.default_rng(number).permutation(POINTS)
        campaign = ADAPTIVE[RECOMMENDED](measurements=BUDGET, noise_margin=1.0).begin(
            Candidates(told[order])
        )
        carry_on(campaign, noisy(errors[order], root[order], BUDGET, 8, number))
        said = next(each for each in campaign.statements() if each.target == "candidates")
        upper += said.upper_mm >= 1.5
        lower += said.lower_mm <= 1.5
    return upper, lower


def test_bounds_hold_at_the_pose_and_in_the_direction_the_instrument_sees_worst():
    upper, lower = held(of_a_tracker()[0])
    assert upper >= 36
    assert lower >= 36


def test_bounds_do_not_hold_there_where_all_poses_are_told_the_same_noise():
    covariance, _ = of_a_tracker()
    same = np.eye(3) * np.trace(covariance.mean(axis=0)) / 3.0
    assert min(held(np.tile(same, (POINTS, 1, 1)))) < 32
