"""The DH and VEC fits against plain linear algebra with derivatives by complex steps."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import fits
from oracles import kinematics as oracle
from pose_checks import of_matrices
from scipy.spatial.transform import Rotation
from simulated import anywhere

from kinacc import geometry
from kinacc.calibration import fitting, frames, uncertainty, vec_fit
from kinacc.calibration.dh_estimator import free_parameters
from kinacc.calibration.observations import full_poses
from kinacc.kinematics import dh, vec

WEIGHT = 500.0
LOW, HIGH = oracle.MEASURED_RAD
DH_UNIT = np.tile([1e-3, 1.0, 1.0, 1e-3, 1e-3], 6)
KNOWN = frames.FrameParameters.none(frames.known())


def joints(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(LOW, HIGH, (count, 6))


def measured(matrices, rng, noise_mm, noise_rad):
    """Poses (n, 4, 4) with noise, and the same as kinacc has them."""
    seen, count = matrices.real.copy(), len(matrices)
    seen[:, :3, :3] = geometry.exp_so3(noise_rad * rng.normal(size=(count, 3))) @ seen[:, :3, :3]
    seen[:, :3, 3] += noise_mm * rng.normal(size=(count, 3))
    return seen, of_matrices(seen)


def matrix(pose):
    return oracle.frame(*pose.position_mm, Rotation.from_matrix(pose.rotation))


@pytest.mark.parametrize(
    ("hayati", "threshold", "placed"),
    [((), 1e-4, True), ((2,), 1e-4, True), ((), 0.15, True), ((), 0.01, False)],
    ids=["plain", "hayati", "coarse", "base and tool estimated"],
)
def test_dh_fit_is_the_smallest_displacement_that_minimises_the_residual(hayati, threshold, placed):
    nominal, rng = np.array(oracle.MH180), np.random.default_rng(1)
    truth = nominal + rng.normal(size=(6, 5)) * [1e-3, 0.8, 0.8, 1e-3, 0]
    q, free = joints(22, 2), free_parameters(6, hayati)
    mask, poses = free.ravel(), oracle.dh_forward(truth, q)
    if not placed:
        poses = matrix(anywhere(rng, 900.0)) @ poses @ matrix(anywhere(rng, 90.0))
    seen, poses = measured(poses, rng, 0.05, 1e-4)
    fit = fitting.fit(
        full_poses(q, poses),
        dh.DHModel(*nominal.T),
        free=free,
        rotation_weight_mm_per_rad=WEIGHT,
        threshold=threshold,
        frames=KNOWN if placed else None,
    )
    found, unit = fit.model.start, DH_UNIT[mask]
    count, base, tool = int(mask.sum()), *map(matrix, (fit.frames.base, fit.frames.tool))

    def function(x):
        """Residual at free parameters, and small motions of base and tool, in mm and mrad."""
        table = found + 0j
        table[mask] = x[:count] * unit
        at = oracle.dh_forward(table.reshape(6, 5), q)
        if placed:
            return fits.residual(at, seen, WEIGHT)
        moved = x[count:].reshape(2, 6) * np.repeat([1.0, 1e-3], 3)
        own_base, own_tool = base @ oracle.motion(moved[0]), tool @ oracle.motion(moved[1])
        return fits.residual(at @ own_tool, np.linalg.inv(own_base) @ seen, WEIGHT)

    x = np.append(found[mask] / unit, np.zeros(0 if placed else 12))
    away = x[:count] - nominal.ravel()[mask] / unit
    expected = fits.truncated(*fits.linearised(function, x), away, threshold)
    np.testing.assert_allclose(expected.step, 0.0, atol=3e-9)  # mm and mrad
    np.testing.assert_array_equal(found[~mask], nominal.ravel()[~mask])
    spectrum = fit.solution.spectrum
    assert spectrum.rank == expected.rank
    np.testing.assert_allclose(
        spectrum.values / expected.values[0], expected.values / expected.values[0], atol=1e-11
    )
    assert fit.solution.cost == pytest.approx(expected.cost, rel=1e-11)
    std, known = fit.std.ravel()[mask] / unit, expected.lost < 1e-6
    assert np.isnan(std[expected.lost > 1e-2]).all()
    np.testing.assert_allclose(std[known], expected.std[known], rtol=1e-9)
    if threshold > 1e-3:
        assert expected.rank < count - 1  # more is left out than what nobody can see
        return
    assert known.sum() >= 20
    if not hayati:  # nobody can see d2 and d3 together; what is seen is d2 - d3
        assert expected.rank == count - 1
        assert np.diff(fit.model.d_mm[1:3]) == pytest.approx(np.diff(truth[1:3, 1]), abs=0.2)
        assert np.isnan(fit.std[[1, 2], 1]).all()


def test_vec_fit_is_where_the_gradient_with_its_prior_vanishes():
    rng = np.random.default_rng(5)
    arm, low, high, order, count = np.array(oracle.MH180)[:4], LOW[:4], HIGH[:4], 2, 16
    shape = (4, 6, order + 1)
    unit = np.append(np.broadcast_to([[1.0]] * 3 + [[1e-3]] * 3, shape), np.full(8, 1e-3))
    true = 0.4 * rng.normal(size=unit.size)
    # Some at rest: where every pose travels, a constant shared with eps_z is moved after the fit.
    q, s = joints(count, 6)[:, :4], rng.choice([-1, 0, 1], (count, 4))

    def poses_at(x):
        """Poses at coefficients and offsets in mm and mrad."""
        series, offsets = (x * unit)[:-8].reshape(shape), (x * unit)[-8:].reshape(4, 2)
        return oracle.projected(oracle.vec_forward(arm, series, low, high, offsets, q, s))

    seen, poses = measured(poses_at(true), rng, 0.03, 5e-5)
    fit = vec_fit.fit(
        full_poses(q, poses, s),
        vec.without_errors(dh.DHModel(*arm.T), low, high, order),
        prior=vec_fit.Prior(delta_mm=0.7, eps_rad=0.9e-3, decay=0.6, offset_rad=3e-4),
        rotation_weight_mm_per_rad=WEIGHT,
        frames=KNOWN,
    )
    x, sigma = fit.model.start / unit, np.sqrt(fit.solution.variance)
    spread = np.array([[0.7]] * 3 + [[0.9]] * 3) * [1.0, 1.0, 0.6]
    prior_std = np.append(np.broadcast_to(spread, shape), np.full(8, 0.3))
    np.testing.assert_allclose(fit.prior_std, prior_std * unit, rtol=1e-12)
    r, jacobian = fits.linearised(lambda x: fits.residual(poses_at(x), seen, WEIGHT), x)
    left, values, right = np.linalg.svd(
        np.vstack([jacobian / sigma, np.diag(1.0 / prior_std)]), full_matrices=False
    )
    step = -right.T @ (left.T @ np.append(r / sigma, x / prior_std) / values)
    assert np.abs(step).max() < 3e-9  # mm and mrad
    covariance = (right.T / values**2) @ right
    np.testing.assert_allclose(fit.std / unit, np.sqrt(np.diag(covariance)), rtol=1e-9)
    stated = uncertainty.of_fit(fit).covariance / np.outer(unit, unit)
    np.testing.assert_allclose(stated, covariance, atol=1e-9 * covariance.max())
    assert fit.solution.cost == pytest.approx(r @ r, rel=1e-11)
    # The balance is the data's own: what is left over, per residual not spent on coefficients.
    spent = x.size - np.sum(np.diag(covariance) / prior_std**2)
    assert r @ r / sigma**2 == pytest.approx(6 * count - spent, rel=1e-6)
