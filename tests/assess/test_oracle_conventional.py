"""Maximum measurement and outlier rejection against the plain oracle on random worlds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import assessors as oracle

from kinacc.assess.maximum import Maximum
from kinacc.assess.outlier_rejection import LIMITS, OutlierRejection
from kinacc.assess.world import measured_world


@st.composite
def readings(draw):
    """First readings (m, 3): smooth, heavy-tailed, or tied, one point included."""
    seed, m = draw(st.integers(0, 2**32 - 1)), draw(st.sampled_from([1, 2, 3, 10, 60, 250]))
    kind = draw(st.sampled_from(["normal", "heavy", "tied"]))
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(m, 3)) * draw(st.sampled_from([0.05, 0.4, 2.0]))
    if kind == "heavy":
        values *= rng.pareto(2, size=(m, 1)) + 0.1
    if kind == "tied":
        values = values[rng.integers(0, m, m)]
    return values


def world(first):
    return measured_world(first, np.zeros((len(first), 0, 3)), 0.1)


def expected_magnitudes(first, budget):
    return [oracle.norm(row) for row in first.tolist()[:budget]]


@given(first=readings(), budget=st.sampled_from([1, 5, 200]))
def test_maximum_equals_the_largest_first_reading(first, budget):
    result = Maximum(measurements=budget).assess(world(first))
    assert result.assessed_mm == pytest.approx(
        oracle.maximum(expected_magnitudes(first, budget)), rel=1e-15
    )
    assert result.measurements == result.points_visited == min(budget, len(first))


def test_the_three_rules_are_the_ones_the_reading_names():
    assert set(LIMITS) == {"normal", "gamma", "iqr"}


@pytest.mark.parametrize("rule", ["normal", "gamma", "iqr"])
@settings(max_examples=80)
@given(first=readings(), budget=st.sampled_from([1, 5, 200]))
def test_outlier_rejection_equals_the_oracle(rule, first, budget):
    magnitudes = expected_magnitudes(first, budget)
    result = OutlierRejection(measurements=budget, outlier_rule=rule).assess(world(first))
    if len(set(magnitudes)) == 1:
        # No spread: the limit equals the readings up to round-off and nothing is an outlier.
        assert result.assessed_mm == pytest.approx(magnitudes[0], rel=1e-12)
        return
    limit = oracle.outlier_limit(magnitudes, rule)
    assert LIMITS[rule](np.array(magnitudes)) == pytest.approx(limit, rel=1e-8)
    if any(abs(value - limit) < 1e-9 * limit for value in magnitudes):
        return  # a reading on the limit to the last digit may fall on either side
    assert result.assessed_mm == pytest.approx(
        oracle.outlier_rejection(magnitudes, rule), rel=1e-15
    )
    assert result.measurements == result.points_visited == min(budget, len(first))
