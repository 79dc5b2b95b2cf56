"""The DH and VEC fits against plain least squares with numerical Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import fits
from oracles import kinematics as oracle

from kinacc import geometry
from kinacc.calibration import fitting, frames, vec_fit
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.observations import full_poses
from kinacc.kinematics import dh, vec

WEIGHT = 500.0
LOW, HIGH = np.radians([(-12, 72), (-30, 54), (-74, 18), (-180, 180), (-122, 122), (-180, 180)]).T
DH_UNIT = np.tile([1e-3, 1.0, 1.0, 1e-3, 1e-3], 6)


def joints(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (count, 6))


def measured(forward, count, rng, noise_mm, noise_rad):
    """Matrices of what ``forward`` has for each number, with noise, and the same as poses."""
    matrices = np.array([forward(i) for i in range(count)])
    matrices[:, :3, :3] = (
        geometry.exp_so3(noise_rad * rng.normal(size=(count, 3))) @ matrices[:, :3, :3]
    )
    matrices[:, :3, 3] += noise_mm * rng.normal(size=(count, 3))
    return matrices, geometry.Pose(matrices[:, :3, :3], matrices[:, :3, 3])


@pytest.mark.parametrize(
    ("hayati", "threshold"),
    [((), 1e-4), ((2,), 1e-4), ((), 0.15)],
    ids=["plain", "hayati", "coarse"],
)
def test_dh_fit_is_the_smallest_displacement_that_minimises_the_residual(hayati, threshold):
    nominal, rng = np.array(oracle.MH180), np.random.default_rng(1)
    truth = nominal + rng.normal(size=(6, 5)) * [1e-3, 0.8, 0.8, 1e-3, 0]
    q, free = joints(22, 2), free_parameters(6, hayati)
    mask = free.ravel()
    seen, poses = measured(lambda i: oracle.dh_forward(truth, q[i]), 22, rng, 0.05, 1e-4)

    def function(x):
        table = nominal.ravel().copy()
        table[mask] = x
        table = table.reshape(6, 5)
        return fits.residual(lambda i: oracle.dh_forward(table, q[i]), seen, WEIGHT)

    expected = fits.truncated_fit(function, nominal.ravel()[mask], DH_UNIT[mask], threshold)
    fit = fitting.fit(
        full_poses(q, poses),
        dh.DHModel(*nominal.T),
        free=free,
        rotation_weight_mm_per_rad=WEIGHT,
        threshold=threshold,
        frames=frames.known(),
    )
    assert fit.solution.spectrum.rank == expected["rank"]
    assert fit.solution.cost == pytest.approx(expected["cost"], rel=1e-7)
    found = fit.model.start
    np.testing.assert_array_equal(found[~mask], nominal.ravel()[~mask])
    np.testing.assert_allclose(
        found[mask] / DH_UNIT[mask], expected["x"] / DH_UNIT[mask], rtol=0, atol=1e-5
    )
    std, lost = fit.std.ravel()[mask], expected["lost"]
    assert np.isnan(std[lost > 1e-2]).all()
    known = lost < 1e-6
    np.testing.assert_allclose(std[known], expected["std"][known], rtol=1e-4)
    if threshold > 1e-3:
        assert expected["rank"] < mask.sum() - 1  # more is left out than what nobody can see
        return
    assert known.sum() >= 20
    if not hayati:  # nobody can see d2 and d3 together; what is seen is d2 - d3
        assert expected["rank"] == mask.sum() - 1
        assert np.diff(fit.model.d_mm[1:3]) == pytest.approx(np.diff(truth[1:3, 1]), abs=0.2)
        assert np.isnan(fit.std[[1, 2], 1]).all()


def test_vec_fit_is_where_the_gradient_with_its_prior_vanishes():
    rng = np.random.default_rng(5)
    arm, low, high, order, count = np.array(oracle.MH180)[:4], LOW[:4], HIGH[:4], 2, 16
    shape = (4, 6, order + 1)
    unit = np.broadcast_to(np.array([[1.0]] * 3 + [[1e-3]] * 3), shape)
    true = np.concatenate(
        [(0.4 * unit * rng.normal(size=shape)).ravel(), 2e-4 * rng.normal(size=8)]
    )
    # Some at rest: where every pose travels, a constant shared with eps_z is moved after the fit.
    q, s = joints(count, 6)[:, :4], rng.choice([-1, 0, 1], (count, 4))

    def forward(x, i):
        series, offsets = x[:-8].reshape(shape), x[-8:].reshape(4, 2)
        return oracle.projected(oracle.vec_forward(arm, series, low, high, offsets, q[i], s[i]))

    seen, poses = measured(lambda i: forward(true, i), count, rng, 0.03, 5e-5)
    fit = vec_fit.fit(
        full_poses(q, poses, s),
        vec.without_errors(dh.DHModel(*arm.T), low, high, order),
        prior=vec_fit.Prior(delta_mm=0.7, eps_rad=0.9e-3, decay=0.6, offset_rad=3e-4),
        rotation_weight_mm_per_rad=WEIGHT,
        frames=frames.known(),
        frames_free=False,
    )
    x, sigma = fit.model.start, np.sqrt(fit.solution.variance)

    def function(x):
        return fits.residual(lambda i: forward(x, i), seen, WEIGHT) / sigma

    spread = np.array([0.7] * 3 + [0.9e-3] * 3)[:, None] * np.array([1.0, 1.0, 0.6])
    prior_std = np.concatenate([np.broadcast_to(spread, shape).ravel(), np.full(8, 3e-4)])
    np.testing.assert_allclose(fit.prior_std, prior_std, rtol=1e-12)
    jacobian = fits.slopes(function, x, prior_std * 0.05)
    covariance = np.linalg.inv(jacobian.T @ jacobian + np.diag(prior_std**-2))
    # The Newton step left to the minimum, in standard deviations of each coefficient.
    step = -covariance @ (jacobian.T @ function(x) + x / prior_std**2)
    assert np.abs(step / np.sqrt(np.diag(covariance))).max() < 1e-3
    np.testing.assert_allclose(fit.std, np.sqrt(np.diag(covariance)), rtol=1e-4)
    misfit = function(x) @ function(x)
    assert fit.solution.cost / sigma**2 == pytest.approx(misfit, rel=1e-9)
    # The balance is the data's own: what is left over, per residual not spent on coefficients.
    spent = x.size - np.trace(covariance @ np.diag(prior_std**-2))
    assert misfit == pytest.approx(6 * count - spent, rel=1e-4)
