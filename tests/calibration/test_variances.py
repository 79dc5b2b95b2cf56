"""Position and rotation residuals have variances of their own, and so has what follows."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from kinacc.calibration import variances


def test_variances_are_unbiased_where_one_kind_of_error_is_far_larger():
    rng = np.random.default_rng(0)
    columns = np.linalg.qr(rng.normal(size=(40, 12)))[0]
    turned = np.arange(40) % 2 == 1
    std, rest = np.where(turned, 1.0, 0.05), np.eye(40) - columns @ columns.T
    kinds = [csr_array(np.eye(40)[kind]) for kind in (~turned, turned)]
    expected = [
        [np.sum(rest[np.ix_(a, b)] ** 2) for b in (~turned, turned)] for a in (~turned, turned)
    ]
    solutions = []
    for _ in range(400):
        residual = rest @ (std * rng.normal(size=40))
        costs = [np.sum(residual[kind] ** 2) for kind in (~turned, turned)]
        solutions.append(np.linalg.solve(expected, costs))
        found = variances._variances(residual, columns, kinds, 1.0)
        if np.all(solutions[-1] > 0.0):
            np.testing.assert_allclose(found, solutions[-1])
        assert np.all(found >= 0.0)
    mean, error = np.mean(solutions, axis=0), np.std(solutions, axis=0) / np.sqrt(400)
    assert np.all(np.abs(mean - [0.0025, 1.0]) < 4 * error)
