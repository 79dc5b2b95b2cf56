"""The DH and VEC fits against plain least squares with numerical Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import fits
from oracles import kinematics as oracle

from kinacc import geometry
from kinacc.calibration import fitting, frames, vec_fit
from kinacc.calibration.constraints import free_parameters
from kinacc.calibration.observations import full_poses
from kinacc.kinematics import dh, vec

WEIGHT = 500.0
LOW, HIGH = np.radians([(-12, 72), (-30, 54), (-74, 18), (-180, 180), (-122, 122), (-180, 180)]).T
DH_UNIT = np.tile([1e-3, 1.0, 1.0, 1e-3, 1e-3], 6)


def joints(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (count, 6))


def stack(matrices) -> geometry.Pose:
    matrices = np.array(matrices)
    return geometry.Pose(matrices[:, :3, :3], matrices[:, :3, 3])


def noisy_poses(table, q, seed):
    """Poses of a DH arm with 0.05 mm and 0.1 mrad of noise."""
    rng = np.random.default_rng(seed)
    result = []
    for row in q:
        frame = oracle.dh_forward(table, row)
        spin = geometry.exp_so3(rng.normal(size=3) * 1e-4)
        frame[:3, :3] = spin @ frame[:3, :3]
        frame[:3, 3] += rng.normal(size=3) * 0.05
        result.append(frame)
    return result


@pytest.mark.parametrize(
    ("hayati", "threshold"),
    [((), 1e-4), ((2,), 1e-4), ((), 0.15)],
    ids=["plain", "hayati", "coarse"],
)
def test_dh_fit_is_the_smallest_displacement_that_minimises_the_residual(hayati, threshold):
    nominal = np.array(oracle.MH180)
    truth = nominal + np.random.default_rng(1).normal(size=(6, 5)) * [1e-3, 0.8, 0.8, 1e-3, 0]
    q = joints(22, 2)
    measured = noisy_poses(truth, q, 3)
    free = free_parameters(6, hayati)
    assert free[:, :4].all()
    assert [i + 1 for i in range(6) if free[i, 4]] == list(hayati)
    mask = free.ravel()

    def function(x):
        table = nominal.ravel().copy()
        table[mask] = x
        table = table.reshape(6, 5)
        return fits.residual(lambda i: oracle.dh_forward(table, q[i]), measured, WEIGHT)

    expected = fits.truncated_fit(function, nominal.ravel()[mask], DH_UNIT[mask], threshold)
    fit = fitting.fit(
        full_poses(q, stack(measured)),
        dh.DHModel(*nominal.T),
        free=free,
        rotation_weight_mm_per_rad=WEIGHT,
        threshold=threshold,
        frames=frames.known(),
    )
    assert fit.solution.spectrum.rank == expected["rank"]
    assert fit.solution.cost == pytest.approx(expected["cost"], rel=1e-7)
    found = fit.model.start
    np.testing.assert_allclose(found[~mask], nominal.ravel()[~mask], rtol=0, atol=0)
    off = (found[mask] - expected["x"]) / DH_UNIT[mask]
    assert np.abs(off).max() < 1e-5
    std, lost = fit.std.ravel()[mask], expected["lost"]
    assert np.isnan(std[lost > 1e-2]).all()
    known = lost < 1e-6
    np.testing.assert_allclose(std[known], expected["std"][known], rtol=1e-4)
    if threshold > 1e-3:
        assert expected["rank"] < mask.sum() - 1  # more is left out than what nobody can see
        return
    assert known.sum() >= 20
    # The direction nobody can see is d2 and d3 together; what is seen is d2 - d3.
    if not hayati:
        assert expected["rank"] == mask.sum() - 1
        table = fit.model
        assert table.d_mm[1] - table.d_mm[2] == pytest.approx((truth[1, 1] - truth[2, 1]), abs=0.2)
        assert np.isnan(fit.std[[1, 2], 1]).all()


def test_vec_fit_is_where_the_gradient_with_its_prior_vanishes():
    rng = np.random.default_rng(5)
    arm, low, high, order, count = np.array(oracle.MH180)[:4], LOW[:4], HIGH[:4], 2, 16
    shape = (4, 6, order + 1)
    unit = np.broadcast_to(np.array([[1.0]] * 3 + [[1e-3]] * 3), shape)
    series = rng.normal(size=shape) * unit * 0.4
    offsets = rng.normal(size=(4, 2)) * 2e-4
    # Some at rest: where every pose travels, a constant shared with eps_z is moved after the fit.
    q, s = joints(count, 6)[:, :4], rng.choice([-1, 0, 1], (count, 4))
    measured = []
    for row, way in zip(q, s, strict=True):
        frame = oracle.projected(oracle.vec_forward(arm, series, low, high, offsets, row, way))
        frame[:3, :3] = geometry.exp_so3(rng.normal(size=3) * 5e-5) @ frame[:3, :3]
        frame[:3, 3] += rng.normal(size=3) * 0.03
        measured.append(frame)
    prior = vec_fit.Prior(delta_mm=0.7, eps_rad=0.9e-3, decay=0.6, offset_rad=3e-4)
    empty = vec.without_errors(dh.DHModel(*arm.T), low, high, order)
    fit = vec_fit.fit(
        full_poses(q, stack(measured), s),
        empty,
        prior=prior,
        rotation_weight_mm_per_rad=WEIGHT,
        frames=frames.known(),
        frames_free=False,
    )
    x = fit.model.start
    size = series.size
    sigma = np.sqrt(fit.solution.variance)

    def function(x):
        new, away = x[:size].reshape(shape), x[size:].reshape(4, 2)

        def forward(i):
            return oracle.projected(oracle.vec_forward(arm, new, low, high, away, q[i], s[i]))

        return fits.residual(forward, measured, WEIGHT) / sigma

    spread = np.array([0.7] * 3 + [0.9e-3] * 3)[:, None] * np.array([1.0, 1.0, 0.6])
    prior_std = np.concatenate([np.broadcast_to(spread, shape).ravel(), np.full(8, 3e-4)])
    np.testing.assert_allclose(fit.prior_std, prior_std, rtol=1e-12)
    jacobian = fits.slopes(function, x, prior_std * 0.05)
    information = jacobian.T @ jacobian + np.diag(prior_std**-2)
    gradient = jacobian.T @ function(x) + x / prior_std**2
    # The Newton step left to the minimum, in standard deviations of each coefficient.
    covariance = np.linalg.inv(information)
    step = -covariance @ gradient
    assert np.abs(step / np.sqrt(np.diag(covariance))).max() < 1e-3
    np.testing.assert_allclose(fit.std, np.sqrt(np.diag(covariance)), rtol=1e-4)
    misfit = function(x) @ function(x)
    assert fit.solution.cost / sigma**2 == pytest.approx(misfit, rel=1e-9)
    # The balance is the data's own: what is left over, per residual not spent on coefficients.
    spent = x.size - np.trace(covariance @ np.diag(prior_std**-2))
    assert misfit == pytest.approx(6 * count - spent, rel=1e-4)
