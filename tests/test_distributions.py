"""The gamma fit: the likelihood is at its maximum, units do not matter, bad samples are refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.assessors import gamma_fit
from scipy import stats
from scipy.special import digamma

from kinacc.distributions import fit, gamma99, quantile
from kinacc.errors import InputError


@pytest.mark.parametrize("shape", [0.05, 0.5, 1.0, 5.36, 60.0, 1e4])
def test_likelihood_equations_hold(shape):
    x = np.random.default_rng(1).gamma(shape, 2.0, 300) + 1e-200
    fitted = fit(x)
    assert fitted.shape * fitted.scale == pytest.approx(x.mean(), rel=1e-12)
    gap = np.log(x.mean()) - np.log(x).mean()
    assert np.log(fitted.shape) - digamma(fitted.shape) == pytest.approx(gap, rel=1e-9)


def test_one_value_repeated_is_its_own_quantile():
    assert gamma99([0.3]) == 0.3
    assert gamma99([0.1] * 7) == pytest.approx(0.1, rel=1e-15)
    # The limit is approached without a jump.
    assert gamma99([0.1, 0.1 + 1e-9]) == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize("sample", [[], [1.0, 0.0], [1.0, -1.0], [1.0, np.nan], [np.inf]])
def test_samples_without_a_maximum_are_refused(sample):
    with pytest.raises(InputError, match="likelihood has no maximum"):
        fit(sample)


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
    fitted = fit(sample)
    assert fitted.shape == pytest.approx(expected_shape, rel=1e-8)
    assert fitted.scale == pytest.approx(expected_scale, rel=1e-8)
    expected = stats.gamma.ppf(0.99, expected_shape, scale=expected_scale)
    assert gamma99(sample) == pytest.approx(expected, rel=1e-9)
    assert quantile(fitted, 0.5) == pytest.approx(
        stats.gamma.median(expected_shape, scale=expected_scale), rel=1e-8
    )
