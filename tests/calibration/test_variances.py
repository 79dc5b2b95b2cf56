"""Position and rotation residuals have variances of their own, and so has what follows."""

from __future__ import annotations

import numpy as np

from kinacc.calibration import variances


def test_variances_are_unbiased_where_one_kind_of_error_is_far_larger():
    rng = np.random.default_rng(0)
    columns = np.linalg.qr(rng.normal(size=(40, 12)))[0]
    turned = np.arange(40) % 2 == 1
    std = np.where(turned, 1.0, 0.05)
    parts = np.stack([columns[kind].T @ columns[kind] for kind in (~turned, turned)])
    rest, kinds = np.eye(40) - columns @ columns.T, (~turned, turned)
    expected = [[np.sum(rest[np.ix_(one, other)] ** 2) for other in kinds] for one in kinds]
    found = []
    for _ in range(400):
        error = std * rng.normal(size=40)
        left = rest @ error
        costs = np.array([np.sum(left[kind] ** 2) for kind in kinds])
        solved = np.linalg.solve(expected, costs)
        here = variances.of_kinds(costs, np.array([20.0, 20.0]), parts, 1.0)
        if np.all(solved > 0.0):
            np.testing.assert_allclose(here, solved)
        assert np.all(here > 0.0)
        found.append(solved)
    mean, error = np.mean(found, axis=0), np.std(found, axis=0) / np.sqrt(400)
    assert np.all(np.abs(mean - [0.0025, 1.0]) < 4 * error)
