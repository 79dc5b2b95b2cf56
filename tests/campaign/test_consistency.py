"""Repeated readings are held to the noise stated: true noise passes, understated noise is told."""

from __future__ import annotations

import numpy as np
import pytest
from campaign_on_disk import entry_of

from kinacc.campaign.state import Reading, restore, scatter, size_scatter

SPREAD = np.diag([0.05, 0.05, 0.15])


def read(plan, factor, repeats=6, points=4, seed=0):
    """A campaign whose first points were read often, with noise ``factor`` times the stated one."""
    rng = np.random.default_rng(seed)
    readings = [
        Reading(point, plan.points.modelled_mm[point] + 0.3 + factor * SPREAD @ rng.normal(size=3),
                "camera")
        for point in map(int, plan.route[:points]) for _ in range(repeats)
    ]  # fmt: skip
    return restore(plan, [entry_of(readings)])


@pytest.fixture
def plan(make_plan):
    return make_plan(texts=("camera=0.05,0.05,0.15",))


def test_noise_stated_too_small_or_too_large_is_told(plan):
    assert scatter(read(plan, 2.0)).too_large
    assert scatter(read(plan, 0.4)).too_small


def test_a_point_read_twice_says_nothing_for_the_first_reading_chose_it(plan):
    assert scatter(read(plan, 1.0, repeats=2)) is None
    assert scatter(restore(plan, [])) is None


def near(plan, error_mm, noise_mm, seed=0):
    """A campaign of an arm with errors and noise of these standard deviations per axis, and the
    largest of the errors."""
    rng = np.random.default_rng(seed)
    errors = rng.normal(0.0, error_mm, plan.points.modelled_mm.shape)
    readings = [
        Reading(point, at + rng.normal(0.0, noise_mm, 3), "tracker")
        for _ in range(3)
        for point, at in enumerate(plan.points.modelled_mm + errors)
    ]
    largest_mm = np.linalg.norm(errors, axis=1).max()
    return restore(plan, [entry_of(readings)]), largest_mm


@pytest.mark.parametrize(
    ("assessor", "short"), [("search_and_confirm", False), ("single_shot", True)]
)
def test_noise_stated_far_above_noise_and_errors_is_told_for_bounds_may_fall_short(
    make_plan, assessor, short
):
    plan = make_plan(assessor)
    state, largest_mm = near(plan, 0.006, 0.005)  # 0.05 mm is stated
    assert all((said.upper_mm < largest_mm) == short for said in state.statements())
    assert size_scatter(state).too_small


def test_readings_of_a_perfect_arm_with_the_noise_stated_are_not_called_too_near(make_plan):
    plan = make_plan()
    assert not any(size_scatter(near(plan, 0.0, 0.05, seed)[0]).too_small for seed in range(60))
    assert size_scatter(restore(plan, [])) is None
