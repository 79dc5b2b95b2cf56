"""The model-invalidation oracle itself: properties the paper states, checked another way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import assessors as oracle
from scipy import integrate, optimize


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_candidate_is_the_nearest_point_of_the_ball(seed):
    rng = np.random.default_rng(seed)
    mean, variances, eta = rng.normal(size=3), rng.uniform(0.05, 2, 3) ** 2, rng.uniform(0.05, 1)
    found = oracle.nearest_in_ball(mean.tolist(), variances.tolist(), eta)
    assert oracle.norm(found) <= eta * (1 + 1e-9)
    best = optimize.minimize(
        lambda x: ((x - mean) ** 2 / variances).sum(),
        np.zeros(3),
        constraints={"type": "ineq", "fun": lambda x: eta**2 - x @ x},
        options={"ftol": 1e-14, "maxiter": 500},
        method="SLSQP",
    )
    assert oracle.distance_outside(mean, variances, eta) ** 2 == pytest.approx(
        best.fun, rel=1e-5, abs=1e-9
    )


@given(
    size=st.floats(0.1, 5),
    eta=st.floats(0, 6),
    sigma=st.floats(0.01, 2),
    seed=st.integers(0, 2**32 - 1),
)
def test_isotropic_distance_is_linear_in_the_bound(size, eta, sigma, seed):
    direction = np.random.default_rng(seed).normal(size=3)
    mean = direction / np.linalg.norm(direction) * size
    expected = max(0.0, (np.linalg.norm(mean) - eta) / sigma)
    found = oracle.distance_outside(mean.tolist(), [sigma**2] * 3, eta)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("distance", [0.2, 1.0, 2.7])
def test_point_probability_is_the_integral_of_eq_18(distance):
    n = 3

    def density(x):
        return x ** (n / 2 - 1) * math.exp(-x / 2) / (2 ** (n / 2) * math.gamma(n / 2))

    for kind, top in (("squared", distance**2), ("as_printed", distance)):
        expected, _ = integrate.quad(density, 0, top)
        assert oracle.point_probability(distance, n, kind) == pytest.approx(expected, rel=1e-7)


def test_run_on_a_world_small_enough_to_follow_by_hand():
    # One axis matters; sigma 1. Bound 0: first reading 1.0 -> R = 1, P* = F(1) = 0.1987 <= 0.6;
    # second point 3.0 -> F(9) = 0.9707, P* = 1 - 0.8013 * 0.0293 = 0.9765 > 0.6: the worst point
    # is read again: -1.0 -> mean 1.0, r = 2, R = sqrt 2, F(2) = 0.4276, P* = 0.5414: new point.
    values = {(0, 1): 1.0, (1, 1): 3.0, (1, 2): -1.0, (2, 1): 0.0}
    run = oracle.invalidation_run(
        lambda j, v: [values[j, v], 0.0, 0.0], [0, 1, 2], [1.0] * 3, 0.0, 10
    )
    assert [(s.point, s.repeat) for s in run.steps] == [(0, 1), (1, 1), (1, 2), (2, 1)]
    assert [round(s.probability, 4) for s in run.steps] == [0.1987, 0.9765, 0.5414, 0.5414]
    assert (run.rejected, run.measurements, run.points_visited) == (False, 4, 3)
