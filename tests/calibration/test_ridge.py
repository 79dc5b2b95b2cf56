"""Priors of many widths at once: what each would find alone, by an eigendecomposition."""

from __future__ import annotations

import numpy as np
import pytest

from kinacc.calibration import ridge

STD = np.array([0.01, 0.1, 1.0])


def alone(jacobian, residual, std):
    """The step under one prior at the variance it leaves, in eigendirections."""
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    cost, freedom = residual @ residual, len(residual)
    turned, variance = vectors.T @ (jacobian.T @ residual), 1e-6 * cost / freedom
    while True:
        held = variance / std**2
        step = -turned / (values + held)
        left = cost + step @ (2.0 * turned + values * step)
        found = left / (freedom - np.sum(values / (values + held)))
        if abs(found - variance) <= 1e-4 * variance:
            return vectors @ step
        variance = found


@pytest.mark.parametrize("size", [2, 7, 80])
def test_every_width_of_a_prior_is_fitted_as_if_alone(size):
    rng = np.random.default_rng(size)
    jacobian = rng.normal(size=(3 * size, size)) * np.logspace(0, -3, size)
    residual = jacobian @ rng.normal(size=size) + 0.1 * rng.normal(size=3 * size)
    both = np.column_stack([residual, jacobian])
    found = ridge.steps(both.T @ both, 3 * size, STD)
    wanted = np.stack([alone(jacobian, residual, std) for std in STD], axis=1)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9 * np.abs(wanted).max())


def test_a_matrix_that_rounding_left_with_negative_directions_has_steps():
    """As few readings of an arm leave it, whose own numbers were eliminated before."""
    rng = np.random.default_rng(1)
    jacobian = rng.normal(size=(60, 4)) @ rng.normal(size=(4, 20))
    both = np.column_stack([jacobian @ rng.normal(size=20), jacobian])
    normal = both.T @ both
    noise = rng.normal(size=(20, 20))
    normal[1:, 1:] += 1e-11 * np.trace(normal) * (noise + noise.T)
    assert np.linalg.eigvalsh(normal)[0] < 0.0
    found = ridge.steps(normal, 60, 1e3 * STD)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(jacobian @ found, -both[:, :1].repeat(3, 1), atol=1e-4)


def test_directions_that_no_reading_shows_stay_where_they_are():
    rng = np.random.default_rng(0)
    jacobian = rng.normal(size=(60, 4)) @ rng.normal(size=(4, 20))
    residual = jacobian @ rng.normal(size=20)  # free of noise: the variance falls to nothing
    both = np.column_stack([residual, jacobian])
    found = ridge.steps(both.T @ both, 60, STD)
    assert np.isfinite(found).all()
    unseen = np.linalg.svd(jacobian)[2][4:]
    assert np.abs(unseen @ found).max() < 0.05
    np.testing.assert_allclose(jacobian @ found, -residual[:, None].repeat(3, 1), atol=1e-4)
