"""Repeated readings are held to the noise stated: true noise passes, understated noise is told."""

from __future__ import annotations

import numpy as np
import pytest
from campaign_on_disk import entry_of, make_plan, readings_of

from kinacc.campaign.state import Reading, restore, scatter, size_scatter


def campaign(plan, errors_mm, spread_mm, seed=0):
    """A campaign whose points with these errors were read three times, with this noise."""
    rng, name = np.random.default_rng(seed), plan.instruments[0].name
    points = [*dict.fromkeys([*plan.route.tolist(), *plan.order.tolist()])][: len(errors_mm)]
    readings = [
        Reading(
            point, plan.points.modelled_mm[point] + error + spread_mm * rng.normal(size=3), name
        )
        for point, error in zip(points, errors_mm, strict=True)
        for _ in range(3)
    ]
    return restore(plan, [entry_of(readings)])


@pytest.mark.parametrize("factor", [0.4, 1.0, 2.0])
def test_repeated_readings_scatter_by_their_noise_over_the_noise_stated(factor):
    plan = make_plan(texts=("camera=0.05,0.05,0.15",), points=8, budget=160)
    rng, noise_mm = np.random.default_rng(2), factor * np.array([0.05, 0.05, 0.15])
    readings = readings_of(plan, lambda row, _: 0.3 + noise_mm * rng.normal(size=3))
    found = scatter(restore(plan, [entry_of(readings)]))
    assert found.ratio == pytest.approx(factor, rel=0.1)
    assert found.too_small == (factor < 1.0)
    assert scatter(restore(plan, [])) is None


@pytest.mark.parametrize(
    ("assessor", "short"), [("search_and_confirm", False), ("single_shot", True)]
)
def test_noise_stated_far_above_noise_and_errors_is_told_for_bounds_may_fall_short(assessor, short):
    plan, errors = make_plan(assessor), np.random.default_rng(1).normal(0.0, 0.006, (40, 3))
    state, largest_mm = campaign(plan, errors, 0.005), np.linalg.norm(errors, axis=1).max()
    # 0.05 mm is stated
    assert all((said.upper_mm < largest_mm) == short for said in state.statements())
    assert size_scatter(state).too_small


def test_readings_of_a_perfect_arm_with_the_noise_stated_are_not_called_too_near():
    plan, none = make_plan(), np.zeros((40, 3))
    seeds = range(60)
    assert not any(size_scatter(campaign(plan, none, 0.05, seed=each)).too_small for each in seeds)
    assert size_scatter(restore(plan, [])) is None
