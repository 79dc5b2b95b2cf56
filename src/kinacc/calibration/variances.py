"""Covariance of a least-squares fit whose residuals share errors: kinds and repeated readings.

Positions and rotations have a variance of their own. What a model cannot explain is common to all
readings of a configuration, and some of it to those of one target: each reading has an error of its
own, one of its configuration and target, and one of its configuration.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
import scipy
from scipy.sparse import csr_array

from kinacc.calibration.observations import Observations
from kinacc.measurements.folds import configurations

WORST_CONDITION = 1e6  # of the equations for variances: beyond it they cannot be told apart
LEAST_FREEDOM = 1e-12  # in residuals


def shared_errors(observations: Observations) -> list[csr_array]:
    """Sums (labels, components) over the residuals that share one error, for each kind of error.

    Kinds of one reading come first; those of configurations are there where any is read again.
    """
    configuration = configurations(observations.pose, observations.q_rad)
    both = np.stack([configuration, observations.target])
    of_target = np.unique(both, axis=1, return_inverse=True)[1].ravel()
    levels = [np.arange(len(observations))]
    if of_target.max() + 1 < len(observations):
        levels.append(of_target)
        if configuration.max() < of_target.max():
            levels.append(configuration)
    measured = np.stack([np.ones(len(observations), bool), observations.has_rotation], axis=1)
    row, axis = np.nonzero(np.repeat(measured, 3, axis=1))
    return [
        csr_array((np.ones(len(part)), (6 * level[row[part]] + axis[part], part)),
                  (6 * (level.max() + 1), len(row)))
        for level in levels
        for part in (np.flatnonzero(axis < 3), np.flatnonzero(axis >= 3))
        if part.size
    ]  # fmt: skip


def covariance_along(
    residual: np.ndarray,
    jacobian: np.ndarray,
    errors: list[csr_array],
    fitted: np.ndarray,
    reported: np.ndarray,
    pooled: float,
) -> np.ndarray:
    """Covariance (r, r) of coordinates along directions: a sandwich of the variances of all errors.

    Parameters
    ----------
    residual, jacobian : numpy.ndarray
        Of the fit, shapes (m,) and (m, P).
    errors : list of scipy.sparse.csr_array
        See ``shared_errors``.
    fitted, reported : numpy.ndarray
        Roots (P, q) and (P, r) of ``Split`` by which the parameters were fitted, and along which
        the covariance is wanted.
    pooled : float
        Variance of the rows of priors.
    """
    if not pooled > 0.0:
        return pooled * np.eye(reported.shape[1])
    variances = _variances(residual, jacobian @ fitted, errors, pooled)
    along = jacobian @ reported
    total = pooled * (np.eye(along.shape[1]) - along.T @ along)
    for variance, sums in zip(variances, errors, strict=False):
        added = sums @ along
        total += variance * (added.T @ added)
    return total


def _variances(
    residual: np.ndarray, along: np.ndarray, errors: list[csr_array], pooled: float
) -> np.ndarray:
    """Variances of the first of ``errors``, as many as can be told apart; none is negative.

    ``along`` (m, r): the Jacobian along a root. With H = along along' the expected square sum of
    (I - H) e added up by Za is the sum over kinds b of variance_b |Za (I - H) Zb'|^2.
    """
    count = len(errors)
    added, expected = [sums @ along for sums in errors], np.zeros((count, count))
    grams = [part.T @ part for part in added]
    for a, b in combinations_with_replacement(range(count), 2):
        common = (errors[a] @ errors[b].T).tocoo()
        crossed = np.sum(added[a][common.row] * added[b][common.col], axis=1)
        both = common.data @ (common.data - 2.0 * crossed) + np.sum(grams[a] * grams[b])
        expected[a, b] = expected[b, a] = both
    prior = np.eye(along.shape[1]) - along.T @ along
    squares = np.array([np.sum((sums @ residual) ** 2) for sums in errors])
    squares -= pooled * np.array([np.sum(gram * prior) for gram in grams])
    unit = np.sqrt(np.maximum(np.diag(expected), LEAST_FREEDOM))
    scaled, wanted = expected / np.outer(unit, unit), squares / (pooled * unit)
    while count > 1 and np.linalg.cond(scaled[:count, :count]) > WORST_CONDITION:
        count -= 1
    return pooled * scipy.optimize.nnls(scaled[:count, :count], wanted[:count])[0] / unit[:count]
