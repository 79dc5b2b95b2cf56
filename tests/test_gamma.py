"""The gamma fit: the likelihood is at its maximum, units do not matter, bad samples are refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import digamma
from scipy.stats import gamma as reference

from kinacc.distributions import fit, gamma99, quantile
from kinacc.errors import InputError


@pytest.mark.parametrize("shape", [0.05, 0.5, 1.0, 5.36, 60.0, 1e4])
def test_likelihood_equations_hold(shape):
    x = np.random.default_rng(1).gamma(shape, 2.0, 300) + 1e-200
    fitted = fit(x)
    assert fitted.shape * fitted.scale == pytest.approx(x.mean(), rel=1e-12)
    gap = np.log(x.mean()) - np.log(x).mean()
    assert np.log(fitted.shape) - digamma(fitted.shape) == pytest.approx(gap, rel=1e-9)
    expected = reference.ppf(0.99, fitted.shape, scale=fitted.scale)
    assert quantile(fitted, 0.99) == pytest.approx(expected, rel=1e-12)


def test_the_unit_of_the_sample_does_not_matter():
    x = np.random.default_rng(2).gamma(5.36, 0.08, 200)
    assert gamma99(1e9 * x) == pytest.approx(1e9 * gamma99(x), rel=1e-12)


def test_tables_of_the_paper_have_quantiles_of_a_gamma_of_their_mean():
    # Table III, position: mean 0.405 mm and 99 % gamma 0.918 mm imply a shape near 5.36.
    assert quantile(fit_like(5.36, 0.405), 0.99) == pytest.approx(0.918, abs=0.002)


def fit_like(shape, mean):
    return fit(np.array([1.0]))._replace(shape=shape, scale=mean / shape, mean=mean)


def test_one_value_repeated_is_its_own_quantile():
    assert gamma99([0.3]) == 0.3
    assert gamma99([0.1] * 7) == pytest.approx(0.1, rel=1e-15)
    # The limit is approached without a jump.
    assert gamma99([0.1, 0.1 + 1e-9]) == pytest.approx(0.1, rel=1e-6)


@pytest.mark.parametrize("sample", [[], [1.0, 0.0], [1.0, -1.0], [1.0, np.nan], [np.inf]])
def test_samples_without_a_maximum_are_refused(sample):
    with pytest.raises(InputError, match="likelihood has no maximum"):
        fit(sample)
