"""The solvers on problems whose answer is known in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from kinacc.calibration import map_estimate, solve, truncated_svd
from kinacc.errors import FitError


@dataclass
class Linear:
    """Residual A x - b handed out in blocks of rows."""

    a: np.ndarray
    b: np.ndarray
    rows: int = 7

    @property
    def count(self):
        return len(self.b)

    @property
    def size(self):
        return self.a.shape[1]

    def cost(self, x):
        return float(np.sum((self.a @ x - self.b) ** 2))

    def blocks(self, x):
        for begin in range(0, len(self.b), self.rows):
            part = slice(begin, begin + self.rows)
            yield self.a[part] @ x - self.b[part], self.a[part]


@dataclass
class Curve:
    """Residual exp(x t) - y: one parameter, curved."""

    t: np.ndarray
    y: np.ndarray
    size: int = 1

    @property
    def count(self):
        return len(self.y)

    def cost(self, x):
        return float(np.sum((np.exp(x[0] * self.t) - self.y) ** 2))

    def blocks(self, x):
        model = np.exp(x[0] * self.t)
        yield model - self.y, (self.t * model)[:, None]


def deficient(rng, rows=40, columns=6, rank=4):
    return rng.normal(size=(rows, rank)) @ rng.normal(size=(rank, columns))


def truncated(system, nominal, **given):
    values = {"scale": np.ones(system.size), "threshold": 1e-6} | given
    return truncated_svd.minimise_truncated(system, nominal.copy(), nominal, **values)


def test_truncated_solution_is_the_pseudoinverse_about_nominal():
    rng = np.random.default_rng(0)
    system = Linear(deficient(rng), rng.normal(size=40))
    nominal = rng.normal(size=6)
    found = truncated(system, nominal)
    wanted = nominal + np.linalg.pinv(system.a) @ (system.b - system.a @ nominal)
    np.testing.assert_allclose(found.x, wanted, atol=1e-10)
    assert found.spectrum.rank == 4
    assert found.spectrum.gap > 1e9
    assert found.degrees_of_freedom == 36
    assert found.variance == pytest.approx(found.cost / 36)
    assert np.isnan(found.std).all()  # every parameter has a part nobody sees


def test_smallest_displacement_is_measured_in_the_given_units():
    # Only x0 + x1 is seen: the displacement goes where a unit is worth more.
    system = Linear(np.ones((5, 2)), np.full(5, 10.0))
    found = truncated(system, np.zeros(2), scale=np.array([1.0, 3.0]))
    np.testing.assert_allclose(found.x, [1.0, 9.0], atol=1e-10)


def test_undetermined_parameters_have_no_deviation_and_others_the_textbook_one():
    rng = np.random.default_rng(1)
    a = rng.normal(size=(30, 5))
    a[:, 4] = a[:, 3]
    system = Linear(a, rng.normal(size=30))
    found = truncated(system, np.zeros(5))
    assert np.isnan(found.std[3:]).all()
    reduced = a[:, :4]
    covariance = found.cost / 26 * np.linalg.inv(reduced.T @ reduced)
    np.testing.assert_allclose(found.std[:3], np.sqrt(np.diag(covariance))[:3], rtol=1e-9)
    np.testing.assert_allclose(found.covariance[:3, :3], covariance[:3, :3], rtol=1e-8, atol=1e-12)
    # Along the direction nobody sees (the last two against each other) nothing is known.
    unseen = np.array([0.0, 0.0, 0.0, 1.0, -1.0]) / np.sqrt(2.0)
    np.testing.assert_allclose(found.covariance @ unseen, 0.0, atol=1e-12)
    assert len(found.undetermined) == 1
    assert abs(found.undetermined[0] @ unseen) == pytest.approx(1.0, abs=1e-10)


def test_frames_take_what_they_can_before_anything_is_truncated():
    rng = np.random.default_rng(2)
    frames, others = rng.normal(size=(30, 2)), rng.normal(size=(30, 3))
    # The last parameter does exactly what a frame coordinate does: it stays nominal.
    a = np.hstack([frames, others, frames[:, :1]])
    system = Linear(a, rng.normal(size=30))
    nominal = np.array([0.0, 0.0, 1.0, 2.0, 3.0, 4.0])
    found = truncated(system, nominal, frames=2)
    assert found.x[5] == pytest.approx(4.0, abs=1e-12)
    assert np.isnan(found.std[5])
    assert np.isfinite(found.std[:5]).all()
    held = a[:, :5]
    wanted = np.linalg.lstsq(held, system.b - 4.0 * a[:, 5], rcond=None)[0]
    np.testing.assert_allclose(found.x[:5], wanted, atol=1e-10)
    covariance = found.variance * np.linalg.inv(held.T @ held)
    np.testing.assert_allclose(found.std[:5], np.sqrt(np.diag(covariance)), rtol=1e-9)


def test_singular_values_keep_their_digits_below_the_root_of_rounding():
    """Through J'J the smallest would drown at 1e-8 of the largest."""
    rng = np.random.default_rng(3)
    left, _ = np.linalg.qr(rng.normal(size=(50, 4)))
    right, _ = np.linalg.qr(rng.normal(size=(4, 4)))
    values = np.array([1.0, 1e-3, 1e-7, 1e-11])
    system = Linear(left * values @ right.T, rng.normal(size=50), rows=3)
    found = solve.spectrum(system, np.zeros(4), np.ones(4), 0, 1e-9)
    np.testing.assert_allclose(found.values[:3], values[:3], rtol=1e-6)
    assert found.values[3] == pytest.approx(1e-11, rel=1e-3)
    assert found.rank == 3


def test_fewer_rows_than_parameters_still_has_a_spectrum():
    rng = np.random.default_rng(4)
    found = solve.spectrum(
        Linear(rng.normal(size=(3, 5)), np.zeros(3)), np.zeros(5), np.ones(5), 0, 1e-9
    )
    assert found.rank == 3
    assert found.values.size == 5


def test_prior_solution_is_ridge_with_the_variance_its_residuals_leave():
    rng = np.random.default_rng(5)
    a, truth = rng.normal(size=(200, 8)), rng.normal(size=8)
    system = Linear(a, a @ truth + 0.3 * rng.normal(size=200))
    prior_std = np.array([0.5] * 7 + [np.inf])
    mean = rng.normal(size=8)
    found = map_estimate.minimise_with_prior(system, np.zeros(8), mean, prior_std, np.full(8, 2.0))
    precision = np.diag(np.where(np.isinf(prior_std), 0.0, prior_std**-2))
    covariance = np.linalg.inv(a.T @ a / found.variance + precision)
    wanted = covariance @ (a.T @ system.b / found.variance + precision @ mean)
    np.testing.assert_allclose(found.x, wanted, atol=1e-9)
    np.testing.assert_allclose(found.std, np.sqrt(np.diag(covariance)), rtol=1e-9)
    spent = np.trace(covariance @ a.T @ a / found.variance)
    assert found.variance == pytest.approx(found.cost / (200 - spent), rel=1e-4)
    assert found.degrees_of_freedom == pytest.approx(200 - spent, rel=1e-6)
    assert np.sqrt(found.variance) == pytest.approx(0.3, rel=0.1)


def test_what_a_prior_decides_is_not_counted_as_fitted_to_the_data():
    """Ridge by hand: the data spend the trace of the hat matrix, the prior the rest."""
    rng = np.random.default_rng(15)
    a, truth = rng.normal(size=(60, 5)), rng.normal(size=5)
    system = Linear(a, a @ truth + 0.2 * rng.normal(size=60))
    nominal, weight = truth + 0.5 * rng.normal(size=5), np.array([0.0, 3.0, 8.0, 0.0, 20.0])
    found = truncated(system, nominal, prior=weight)
    inverse = np.linalg.inv(a.T @ a + np.diag(weight**2))
    x = inverse @ (a.T @ system.b + weight**2 * nominal)
    np.testing.assert_allclose(found.x, x, atol=1e-9)
    freedom = 60 - np.trace(a @ inverse @ a.T)
    assert 55.1 < freedom < 59.0
    assert found.degrees_of_freedom == pytest.approx(freedom, rel=1e-9)
    assert found.variance == pytest.approx(np.sum((a @ x - system.b) ** 2) / freedom, rel=1e-9)
    plain = truncated(system, nominal)
    assert plain.degrees_of_freedom == 55


def test_directions_nobody_sees_stay_at_the_prior_mean():
    rng = np.random.default_rng(6)
    a = rng.normal(size=(60, 4))
    a[:, 3] = 0.0
    mean = np.array([0.0, 0.0, 0.0, 5.0])
    system = Linear(a, rng.normal(size=60))
    found = map_estimate.minimise_with_prior(system, np.zeros(4), mean, np.full(4, 0.7), np.ones(4))
    assert found.x[3] == pytest.approx(5.0)
    assert found.std[3] == pytest.approx(0.7)


def test_noise_free_data_is_met_exactly_despite_the_prior():
    rng = np.random.default_rng(7)
    a, truth = rng.normal(size=(50, 5)), rng.normal(size=5)
    found = map_estimate.minimise_with_prior(
        Linear(a, a @ truth), np.zeros(5), np.zeros(5), np.full(5, 0.1), np.ones(5)
    )
    np.testing.assert_allclose(found.x, truth, atol=1e-6)


def test_undetermined_direction_without_prior_is_refused():
    a = np.ones((10, 2))
    with pytest.raises(FitError, match="not positive definite"):
        map_estimate.minimise_with_prior(
            Linear(a, np.zeros(10)), np.ones(2), np.zeros(2), np.full(2, np.inf), np.ones(2)
        )


def test_curved_problem_converges_from_far_by_shorter_steps():
    t = np.linspace(0.0, 1.0, 20)
    found = truncated(Curve(t, np.exp(2.0 * t)), np.array([-12.0]))
    assert found.x[0] == pytest.approx(2.0, abs=1e-9)
    assert found.converged
    assert found.last_step <= solve.STEP_TOLERANCE


def test_no_convergence_is_an_error_with_the_numbers(monkeypatch):
    monkeypatch.setattr(solve, "MAX_ITERATIONS", 2)
    t = np.linspace(0.0, 1.0, 20)
    with pytest.raises(FitError, match=r"not converged after 2 iterations; last step .* cost"):
        truncated(Curve(t, np.exp(2.0 * t)), np.array([-12.0]))


def test_a_step_that_is_not_finite_is_an_error():
    system = Linear(np.full((4, 2), np.nan), np.zeros(4))
    with pytest.raises((FitError, np.linalg.LinAlgError)):
        truncated(system, np.zeros(2))
