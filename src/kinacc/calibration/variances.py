"""Variances of position and rotation residuals, and of what readings of a configuration share."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import TYPE_CHECKING

import numpy as np
import scipy

from kinacc.calibration.observations import Observations
from kinacc.measurements.folds import configurations

if TYPE_CHECKING:
    from kinacc.calibration.system import PoseSystem

WORST_CONDITION = 1e6  # of the equations for variances: beyond it they cannot be told apart
LEAST_FREEDOM = 1e-12  # in residuals


def of_kinds(costs: np.ndarray, counts: np.ndarray, parts: np.ndarray, pooled: float) -> np.ndarray:
    """Variances (2,) of position and rotation residuals from their sums of squares (2,).

    ``counts`` (2,) of residuals, ``parts`` (2, r, r) of both kinds of rows in root' J'J root.
    A fit mixes both kinds of error into both kinds of residual: of independent errors the expected
    sums of squares are linear in both variances, coupled by the traces of products of ``parts``.
    Solved, that is unbiased under any weight of rotations. Where a variance would not be positive,
    each is its own sum over its count less its share of the parameters (Foerstner's estimate), or
    ``pooled`` where nothing is left of the count.
    """
    prior = np.eye(parts.shape[1]) - parts.sum(axis=0)
    used = np.trace(parts, axis1=1, axis2=2)
    expected = np.diag(counts - 2.0 * used) + np.einsum("iab,jba->ij", parts, parts)
    if np.linalg.cond(expected) < WORST_CONDITION:
        of_prior = pooled * np.einsum("iab,ba->i", parts, prior)
        found = np.linalg.solve(expected, costs - of_prior)
        if np.all(found > 0.0):
            return found
    freedom = counts - used
    left = freedom > 0.5  # less than one residual in two tells nothing
    return np.where(left, costs / np.where(left, freedom, 1.0), pooled)


def shared_errors(observations: Observations) -> tuple[np.ndarray, ...]:
    """Which residuals share an error, where a target is read again in a configuration; else ().

    What a model cannot explain is common to all readings of a configuration, and some of it to
    those of one target. So each reading has an error of its own, one of its configuration and
    target, and one of its configuration; of positions and of rotations apart. For each of these
    labels (components,): residuals of one label share one error, -1 have none of this kind.
    """
    configuration = configurations(observations.pose, observations.q_rad)
    both = np.stack([configuration, observations.target], axis=1)
    of_target = np.unique(both, axis=0, return_inverse=True)[1].ravel()
    levels = [np.arange(len(observations)), of_target]
    if of_target.max() + 1 == len(observations):
        return ()
    if configuration.max() < of_target.max():
        levels.append(configuration)
    turned = observations.is_rotation
    measured = np.stack([np.ones(len(observations), bool), observations.has_rotation], axis=1)
    row, axis = np.nonzero(np.repeat(measured, 3, axis=1))
    kinds = [each for each in (~turned, turned) if each.any()]
    return tuple(np.where(kind, 6 * each[row] + axis, -1) for each in levels for kind in kinds)


def along_root(
    system: PoseSystem,
    x: np.ndarray,
    errors: tuple[np.ndarray, ...],
    fitted: np.ndarray,
    told: np.ndarray,
    pooled: float,
) -> np.ndarray:
    """Covariance (r, r) of coordinates along ``told`` (P, r): told C told' is the parameters'.

    The sandwich of a least-squares estimator whose residuals are sums of ``errors`` (see
    ``shared_errors``). The variance of each kind of error follows from the sums of squares of
    residuals added up by label, whose expectations are linear in all variances; none is negative. A
    kind that the residuals cannot tell from those before it is left out, the last ones first.
    ``fitted`` (P, q): the root of the fit; ``pooled`` is the variance of a prior's rows.
    """
    if not pooled > 0.0:
        return pooled * np.eye(told.shape[1])
    residual, jacobian = (np.concatenate(part) for part in zip(*system.blocks(x), strict=True))
    found = _of_shared(residual, jacobian @ fitted, errors, pooled)
    seen = jacobian @ told
    along = pooled * (np.eye(told.shape[1]) - seen.T @ seen)
    for variance, label in zip(found, errors, strict=False):
        added = _added(seen, label)
        along += variance * (added.T @ added)
    return along


def _of_shared(
    residual: np.ndarray, seen: np.ndarray, errors: tuple[np.ndarray, ...], pooled: float
) -> np.ndarray:
    """Variances of the first of ``errors``, as many as can be told apart.

    ``seen`` (m, r): the Jacobian along a root. With H = seen seen' the expected square sum of
    (I - H) e added up by label a is the sum over kinds b of variance_b |Za' (I - H) Zb|^2.
    """
    added = [_added(seen, label) for label in errors]
    grams = [each.T @ each for each in added]
    expected = np.zeros((len(errors), len(errors)))
    for a, b in combinations_with_replacement(range(len(errors)), 2):
        number, one, other = _cells(errors[a], errors[b])
        crossed = number @ np.sum(added[a][one] * added[b][other], axis=1)
        common = float(number @ number) - 2.0 * crossed + np.sum(grams[a] * grams[b])
        expected[a, b] = expected[b, a] = common
    prior = np.eye(seen.shape[1]) - seen.T @ seen
    squares = np.array([np.sum(_added(residual[:, None], label) ** 2) for label in errors])
    squares -= pooled * np.array([np.sum(gram * prior) for gram in grams])
    unit = np.sqrt(np.maximum(np.diag(expected), LEAST_FREEDOM))
    scaled, wanted = expected / np.outer(unit, unit), squares / (pooled * unit)
    count = len(errors)
    while count > 1 and np.linalg.cond(scaled[:count, :count]) > WORST_CONDITION:
        count -= 1
    return pooled * scipy.optimize.nnls(scaled[:count, :count], wanted[:count])[0] / unit[:count]


def _added(values: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Rows of ``values`` (m, r) added up by label."""
    there = label >= 0
    total = np.zeros((label.max() + 1, values.shape[1]))
    np.add.at(total, label[there], values[there])
    return total


def _cells(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many residuals each pair of labels has, and the pairs."""
    there = (one >= 0) & (other >= 0)
    pairs = np.stack([one[there], other[there]], axis=1)
    cells, number = np.unique(pairs, axis=0, return_counts=True)
    return number, cells[:, 0], cells[:, 1]
