"""Variances of position and of rotation residuals apart, and the covariance that follows."""

from __future__ import annotations

import numpy as np

from kinacc.calibration.solve import System

WORST_CONDITION = 1e6  # of the equations for both variances: beyond it they cannot be told apart


def along_root(
    system: System,
    x: np.ndarray,
    is_rotation: np.ndarray,
    fitted: np.ndarray,
    told: np.ndarray,
    pooled: float,
) -> np.ndarray:
    """Covariance (r, r) of coordinates along the root ``told``: ``told C told'`` is that of x.

    The sandwich of a least-squares estimator between residuals of two variances; were they equal
    it would be ``pooled`` times the identity. A root (P, r) times its transpose inverts J'J and the
    prior's rows; ``fitted`` is that of the fit, ``told`` of the directions spoken of.
    ``is_rotation`` (m,) of the residuals; ``pooled`` is the variance of the prior's rows too.
    """
    costs, counts, parts = _shares(system, x, is_rotation, fitted)
    apart = of_kinds(costs, counts, parts, pooled)
    parts = _shares(system, x, is_rotation, told)[2]
    own = np.einsum("i,iab->ab", apart - pooled, parts)
    return pooled * np.eye(told.shape[1]) + own


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


def _shares(
    system: System, x: np.ndarray, is_rotation: np.ndarray, root: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums of squares (2,), counts (2,) and shares (2, r, r) of position and rotation rows."""
    costs, counts = np.zeros(2), np.zeros(2)
    parts, begin = np.zeros((2, root.shape[1], root.shape[1])), 0
    for residual, jacobian in system.blocks(x):
        seen = jacobian @ root
        turned = is_rotation[begin : begin + len(residual)]
        begin += len(residual)
        for kind, rows in enumerate((~turned, turned)):
            costs[kind] += np.sum(residual[rows] ** 2)
            counts[kind] += np.count_nonzero(rows)
            parts[kind] += seen[rows].T @ seen[rows]
    return costs, counts, parts
