"""The gamma fit: the likelihood is at its maximum, units do not matter, bad samples are refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import assessors as oracle
from scipy import stats
from scipy.optimize import brentq
from scipy.special import digamma

from kinacc.distributions import gamma99
from kinacc.errors import InputError


@pytest.mark.parametrize("shape", [0.05, 0.5, 1.0, 5.36, 60.0, 1e4])
def test_the_likelihood_equation_holds(shape):
    x = np.random.default_rng(1).gamma(shape, 2.0, 300) + 1e-200
    gap = np.log(x.mean()) - np.log(x).mean()
    fitted = brentq(lambda k: np.log(k) - digamma(k) - gap, 1e-3, 1e6, xtol=1e-14)
    expected = stats.gamma.ppf(0.99, fitted, scale=x.mean() / fitted)
    assert gamma99(x) == pytest.approx(expected, rel=1e-9)


def test_one_value_repeated_is_its_own_quantile():
    assert gamma99([0.3]) == 0.3
    assert gamma99([0.1] * 7) == pytest.approx(0.1, rel=1e-15)
    # The limit is approached without a jump.
    assert gamma99([0.1, 0.1 + 1e-9]) == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize("sample", [[], [1.0, 0.0], [1.0, -1.0], [1.0, np.nan], [np.inf]])
def test_samples_without_a_maximum_are_refused(sample):
    with pytest.raises(InputError, match="likelihood has no maximum"):
        gamma99(sample)


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(3, 600),
    shape=st.floats(0.3, 40),
    scale=st.sampled_from([1e-3, 0.1, 1.0, 50.0]),
)
def test_gamma_fit_and_quantile_equal_scipy(seed, n, shape, scale):
    sample = np.random.default_rng(seed).gamma(shape, scale, n)
    assert gamma99(sample) == pytest.approx(oracle.gamma99(sample), rel=1e-9)
