"""The gamma fit against scipy's maximum likelihood."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.assessors import gamma_fit
from scipy import stats

from kinacc import distributions


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(3, 600),
    shape=st.floats(0.3, 40),
    scale=st.sampled_from([1e-3, 0.1, 1.0, 50.0]),
)
def test_gamma_fit_and_quantile_equal_scipy(seed, n, shape, scale):
    sample = np.random.default_rng(seed).gamma(shape, scale, n)
    expected_shape, _, expected_scale = gamma_fit(sample)
    fitted = distributions.fit(sample)
    assert fitted.shape == pytest.approx(expected_shape, rel=1e-8)
    assert fitted.scale == pytest.approx(expected_scale, rel=1e-8)
    expected = stats.gamma.ppf(0.99, expected_shape, scale=expected_scale)
    assert distributions.gamma99(sample) == pytest.approx(expected, rel=1e-9)
    assert distributions.quantile(fitted, 0.5) == pytest.approx(
        stats.gamma.median(expected_shape, scale=expected_scale), rel=1e-8
    )


@given(seed=st.integers(0, 2**32 - 1))
def test_gamma_fit_is_a_stationary_point_of_the_likelihood(seed):
    rng = np.random.default_rng(seed)
    sample = rng.gamma(rng.uniform(1, 8), rng.uniform(0.05, 2), 200)
    fitted = distributions.fit(sample)

    def log_likelihood(shape, scale):
        return stats.gamma.logpdf(sample, shape, scale=scale).sum()

    best = log_likelihood(fitted.shape, fitted.scale)
    for factor in (0.99, 1.01):
        assert log_likelihood(fitted.shape * factor, fitted.scale) < best
        assert log_likelihood(fitted.shape, fitted.scale * factor) < best
