"""Order and prior of the VEC model: what a refit would find, blind to what is held out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kinacc.calibration import frames, held, selection, vec_fit
from kinacc.calibration.observations import full_poses
from kinacc.calibration.selection import Grid
from kinacc.calibration.vec_fit import Prior
from kinacc.geometry import Pose, exp_so3
from kinacc.kinematics import robot, vec

ARM = robot.load("mh180")
LOW, HIGH = np.deg2rad([(-10, 70), (-30, 54), (-74, 18), (-170, 170), (-120, 120), (-170, 170)]).T
WEIGHT, POSES = 500.0, 200
PRIORS = selection.chosen_priors(1e-3)


def observed(order, seed=0, noise_mm=0.03, size=0.3):
    """Poses of an arm whose joint errors are polynomials of ``order``."""
    rng = np.random.default_rng(seed)
    empty = vec.without_errors(ARM.dh, LOW, HIGH, order)
    spread = Prior(size, 1e-3 * size, 1.0, 1e-4).std(empty)
    true = vec.with_vector(empty, spread * rng.normal(size=spread.size))
    q = rng.uniform(LOW, HIGH, (POSES, 6))
    seen = vec.pose(true, q)
    turn = exp_so3(noise_mm / WEIGHT * rng.normal(size=(POSES, 3)))
    moved = seen.position_mm + noise_mm * rng.normal(size=(POSES, 3))
    return full_poses(q, Pose(turn @ seen.rotation, moved), fold=np.arange(POSES) % 5)


def empty_model(order):
    return vec.without_errors(ARM.dh, LOW, HIGH, order)


def choose(seen, orders=(1, 2, 3, 4, 6), priors=PRIORS):
    grid = Grid(orders, priors)
    at = held.known_frames(seen, frames.known())
    return selection.choices(seen, empty_model(max(orders)), at, WEIGHT, grid)


@pytest.mark.parametrize("order", [1, 3])
def test_held_out_errors_are_those_of_a_refit(order):
    seen = observed(3)
    prior = Prior(0.3, 0.3e-3, 0.85, 1e-3, 10.0, 1e-2)
    last = choose(seen, (order,), (prior,))[-1]
    for block in range(5):
        out = seen.fold == block
        found = vec_fit.fit(
            seen.select(~out),
            empty_model(order),
            prior=prior,
            rotation_weight_mm_per_rad=WEIGHT,
            frames=frames.known(),
            frames_free=False,
        )
        error = vec.pose(found.model, seen.q_rad[out]).position_mm - seen.position_mm[out]
        wanted = np.mean(np.sum(error**2, axis=1))
        assert last.trials[0].squared_mm2[out].mean() == pytest.approx(wanted, rel=0.04)


def test_the_order_of_the_errors_is_found_and_not_exceeded():
    for order in (2, 4):
        for choice in choose(observed(order)):
            assert choice.chosen.order == order


def test_a_choice_has_seen_nothing_of_what_is_held_out():
    seen = observed(3)
    spoilt = seen.position_mm.copy()
    spoilt[seen.fold == 2] += np.random.default_rng(1).normal(size=(POSES // 5, 3)) * 5.0
    before, after = choose(seen), choose(replace(seen, position_mm=spoilt))
    assert [choice.held_out for choice in before] == [(0,), (1,), (2,), (3,), (4,), ()]
    for one, other in zip(before[2].trials, after[2].trials, strict=True):
        np.testing.assert_allclose(one.squared_mm2, other.squared_mm2, rtol=1e-6)
    assert before[1].chosen.rms_mm < 0.1 * after[1].chosen.rms_mm


def test_many_folds_are_held_out_a_block_at_a_time():
    fold = np.array([0, 0, 3, 7, 8, 9, 11, 12, -1])
    np.testing.assert_array_equal(selection.blocks(fold), [0, 0, 1, 2, 3, 4, 0, 1, -1])


def test_orders_with_more_parameters_than_residuals_are_not_tried():
    grid = Grid((1, 2, 4, 8), PRIORS)
    assert grid.within(200, 6, 12).orders == (1, 2, 4)
    assert grid.within(10, 6, 12).orders == (1,)
