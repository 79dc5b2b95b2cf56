"""Normal equations from motions and functions: equal to those of the Jacobian written out."""

from __future__ import annotations

import numpy as np
import pytest
from test_system import Frames, coordinates, flange_models, observations, random_pose

from kinacc.calibration import solve
from kinacc.calibration.basis_expansion import Group, gram, spread
from kinacc.calibration.system import PoseSystem
from kinacc.kinematics import robot


def test_every_parameter_is_a_motion_times_a_function():
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(4, 6, 5))
    basis, other = rng.normal(size=(4, 3)), rng.normal(size=(4, 1))
    groups = [Group(slice(0, 2), None), Group(slice(2, 4), basis), Group(slice(1, 2), other)]
    full = spread(columns, groups)
    assert full.shape == (4, 6, 2 + 6 + 1)
    np.testing.assert_array_equal(full[:, :, :2], columns[:, :, :2])
    for motion in range(2):
        for function in range(3):
            wanted = columns[:, :, 2 + motion] * basis[:, None, function]
            np.testing.assert_array_equal(full[:, :, 2 + 3 * motion + function], wanted)
    np.testing.assert_array_equal(full[:, :, 8], columns[:, :, 1] * other)
    rows = full.reshape(-1, 9)
    np.testing.assert_allclose(gram(columns, groups), rows.T @ rows, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["dh", "vec"])
@pytest.mark.parametrize("free", [True, False])
def test_gram_is_that_of_the_written_out_jacobian(name, free):
    rng = np.random.default_rng(5)
    seen = observations(rng, robot.load("mh180"), count=30)
    model, at = flange_models()[name]
    anchor = Frames(random_pose(rng), random_pose(rng, 2, 1.0, 100.0))
    system = PoseSystem(seen, model, coordinates(seen, anchor, free, free), 350.0)
    x = np.concatenate([0.1 * rng.normal(size=system.coordinates.size), at])
    (residual, jacobian), *_ = system.blocks(x)
    both = np.concatenate([jacobian, residual[:, None]], axis=1)
    found = solve.gram(system, x)
    assert system.count == residual.size
    scale = np.sqrt(np.diag(both.T @ both))
    error = (found - both.T @ both) / np.outer(scale, scale)
    assert np.abs(error[np.isfinite(error)]).max() < 1e-12


@pytest.mark.parametrize("name", ["dh", "vec"])
@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("weighted", [True, False])
def test_gradient_is_the_last_row_of_the_gram_matrix(name, free, weighted):
    rng = np.random.default_rng(6)
    seen = observations(rng, robot.load("mh180"), count=30)
    model, at = flange_models()[name]
    anchor = Frames(random_pose(rng), random_pose(rng, 2, 1.0, 100.0))
    system = PoseSystem(seen, model, coordinates(seen, anchor, free, free), 350.0)
    if weighted:
        system = system.weighted(rng.uniform(0.0, 1.0, len(seen)))
    x = np.concatenate([0.1 * rng.normal(size=system.coordinates.size), at])
    full = solve.gram(system, x)
    scale = np.sqrt(np.diag(full) * full[-1, -1]) + 1e-9
    np.testing.assert_allclose(solve.gradient(system, x) / scale, full[-1] / scale, atol=1e-12)
    assert solve.gradient(system, x)[-1] == pytest.approx(system.cost(x), rel=1e-12)
