"""Repeated readings are held to the noise stated: true noise passes, understated noise is told."""

from __future__ import annotations

import numpy as np
import pytest
from campaign_on_disk import entry_of

from kinacc.campaign.state import Reading, restore, scatter, size_scatter


def campaign(plan, errors_mm, spread_mm, repeats=3, seed=0):
    """A campaign whose points with these errors were read so often, with this noise."""
    rng, name = np.random.default_rng(seed), plan.instruments[0].name
    points = [*dict.fromkeys([*plan.route.tolist(), *plan.order.tolist()])][: len(errors_mm)]
    readings = [
        Reading(
            point, plan.points.modelled_mm[point] + error + spread_mm * rng.normal(size=3), name
        )
        for point, error in zip(points, errors_mm, strict=True)
        for _ in range(repeats)
    ]
    return restore(plan, [entry_of(readings)])


def test_noise_stated_too_small_or_too_large_is_told_and_no_noise_by_points_read_twice(make_plan):
    """The first reading of a point chose it to be read again."""
    plan = make_plan(texts=("camera=0.05,0.05,0.15",))
    errors, stated = np.full((4, 3), 0.3), np.array([0.05, 0.05, 0.15])
    assert scatter(campaign(plan, errors, 2.0 * stated, repeats=6)).too_large
    assert scatter(campaign(plan, errors, 0.4 * stated, repeats=6)).too_small
    assert scatter(campaign(plan, errors, stated, repeats=2)) is None
    assert scatter(restore(plan, [])) is None


@pytest.mark.parametrize(
    ("assessor", "short"), [("search_and_confirm", False), ("single_shot", True)]
)
def test_noise_stated_far_above_noise_and_errors_is_told_for_bounds_may_fall_short(
    make_plan, assessor, short
):
    plan, errors = make_plan(assessor), np.random.default_rng(1).normal(0.0, 0.006, (40, 3))
    state, largest_mm = campaign(plan, errors, 0.005), np.linalg.norm(errors, axis=1).max()
    # 0.05 mm is stated
    assert all((said.upper_mm < largest_mm) == short for said in state.statements())
    assert size_scatter(state).too_small


def test_readings_of_a_perfect_arm_with_the_noise_stated_are_not_called_too_near(make_plan):
    plan, none = make_plan(), np.zeros((40, 3))
    seeds = range(60)
    assert not any(size_scatter(campaign(plan, none, 0.05, seed=each)).too_small for each in seeds)
    assert size_scatter(restore(plan, [])) is None
