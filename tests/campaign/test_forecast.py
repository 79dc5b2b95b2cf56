"""Forecasts: the fitted population is the one readings came from, ends are simulated from it."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from kinacc.assess.counts import binomial_interval
from kinacc.assess.simulate import carry_on, conduct, noisy
from kinacc.assess.statement import CANDIDATES
from kinacc.campaign import folder
from kinacc.campaign.forecast import draw_errors, forecast, population, why_none
from kinacc.campaign.reading import Reading
from kinacc.campaign.simulate import quantiles
from kinacc.campaign.state import restore
from kinacc.campaign.words import reason


@pytest.mark.parametrize("noise_mm", [0.05, 0.2])
def test_the_population_is_that_of_the_readings_without_their_noise(noise_mm):
    rng = np.random.default_rng(0)
    wide = rng.random(4000) < 0.1
    true = rng.normal(size=(4000, 3)) * np.where(wide, 1.0, 0.2)[:, None]
    read = true + rng.normal(size=true.shape) * noise_mm
    known = population(read, np.full(4000, noise_mm))
    second = float(known.share @ known.scale_mm**2)
    assert second == pytest.approx(np.mean(true**2), rel=0.1)
    assert known.share[known.scale_mm > 0.6].sum() == pytest.approx(0.1, abs=0.03)


def test_drawn_errors_follow_readings_where_there_are_any():
    rng = np.random.default_rng(1)
    true = rng.normal(size=(300, 3)) * 0.3
    noise = np.full(300, 0.05)
    noise[250:] = np.inf
    mean = np.where(np.isfinite(noise)[:, None], true + rng.normal(size=true.shape) * 0.05, 0.0)
    known = population(mean[:250], noise[:250])
    draws = np.array([draw_errors(known, mean, noise, rng) for _ in range(200)])
    off = draws[:, :250].mean(axis=0) - true[:250]
    assert np.sqrt(np.mean(off**2)) < 0.055
    assert draws[:, :250].std(axis=0).mean() == pytest.approx(0.05, rel=0.1)
    assert np.sqrt(np.mean(draws[:, 250:] ** 2)) == pytest.approx(0.3, rel=0.1)


def test_a_forecast_contains_what_then_happens(make_plan, make_world):
    plan = make_plan(points=60, budget=60)
    world = make_world(plan)
    entries = []
    while len(entries) < 45:
        state = restore(plan, entries)
        row = int(np.flatnonzero(state.rows == state.asked)[0])
        visit = sum(each.reading.point == state.asked for each in state.told)
        where = plan.points.modelled_mm[state.asked] + world.reading_mm(row, visit)
        entries.append(folder.readings_entry([Reading(state.asked, where, "tracker")]))
    ahead = forecast(restore(plan, entries), 20, wanted_mm=5.0, tolerance_mm=10.0)
    said = conduct(plan.assessor, world).statements()[1]
    assert said.target == ahead.target == CANDIDATES
    low, _, high = ahead.width_mm
    assert 0.8 * low <= said.upper_mm - said.lower_mm <= 1.25 * high
    assert ahead.more == 59 - 45  # nothing is said of all before the visit is complete
    assert ahead.decisions["accept"] == 1.0


def test_there_is_no_forecast_from_nearly_nothing(make_plan):
    state = restore(make_plan(), [])
    assert forecast(state, 5) is None
    assert reason(why_none(state)) == "0 points were read, 8 are needed"


def test_simulated_readings_do_not_depend_on_what_else_is_read(make_plan):
    plan = make_plan("single_shot")
    rows = plan.visiting(frozenset())
    errors = np.zeros((len(rows), 3))
    whole = plan.assessor.begin(plan.candidates(rows))
    carry_on(whole, noisy(errors, 0.05 * np.eye(3), 10, 7))
    half = copy.deepcopy(plan.assessor.begin(plan.candidates(rows)))
    carry_on(half, noisy(errors, 0.05 * np.eye(3), 10, 7), limit=20)
    np.testing.assert_array_equal(half.ledger.mean_mm[:20], whole.ledger.mean_mm[:20])
    assert half.ledger.taken == 20


def test_binomial_limits_are_those_of_clopper_and_pearson():
    from scipy.stats import binomtest

    for hits, trials in ((0, 20), (3, 20), (20, 20), (57, 100)):
        wanted = binomtest(hits, trials).proportion_ci(0.95, "exact")
        assert binomial_interval(hits, trials) == pytest.approx((wanted.low, wanted.high))


def test_quantiles_of_order_stand_infinite_values():
    assert quantiles([3.0, np.inf, 1.0, 2.0], (0.05, 0.5, 0.95)) == [1.0, 2.0, np.inf]
