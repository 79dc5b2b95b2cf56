"""Errors of poses as what smooth errors of single joints do at the tool, plus what is local.

e(q) = sum over joints and causes of J_c(q) f_c(q_j) + d(q). J_c is what one unit of cause c does at
the tool (:mod:`research.error_effects`), f_c a smooth function of the joint's own angle: a
Gaussian process in Chebyshev polynomials, variance a_g^2 b_o^2 of the coefficient of order o, g the
joint and the kind of cause. d is local to the pose: each component normal with a standard deviation
drawn from a mixture of scales, so that most poses may be smooth and few far off. All scales are
fitted to the readings by maximum marginal likelihood (EM).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from research.error_effects import CAUSES_PER_JOINT

ORDER = 6
_ROUNDS = 40
_FLOOR = 1e-8  # of the mean square reading: least variance of a scale
_PSEUDO = 4.0  # points' worth of belief that local errors are of the bulk
_SCALES = 6  # of local errors, each twice the one before


def points_needed(joints: int) -> int:
    """Points with as many components of readings as there are coefficients for so many joints."""
    return math.ceil(CAUSES_PER_JOINT * joints * (ORDER + 1) / 3)


@dataclass(frozen=True)
class Basis:
    """Columns of the smooth part: ``columns`` (m, 3, F), with group and order of each."""

    columns: np.ndarray
    group: np.ndarray
    order: np.ndarray

    @classmethod
    def of(cls, q_rad: np.ndarray, effects: np.ndarray) -> Basis:
        """q_rad (m, k); effects (m, 3, 6 k). Joints are scaled to the range they have here."""
        joints = q_rad.shape[1]
        middle = 0.5 * (q_rad.max(axis=0) + q_rad.min(axis=0))
        half = np.maximum(0.5 * np.ptp(q_rad, axis=0), 1e-9)
        angle = np.arccos(np.clip((q_rad - middle) / half, -1.0, 1.0))
        waves = np.cos(angle[:, :, None] * np.arange(ORDER + 1))  # (m, k, orders)
        cause = np.arange(CAUSES_PER_JOINT * joints)
        joint = cause // CAUSES_PER_JOINT
        columns = effects[:, :, :, None] * waves[:, None, joint, :]
        kind = (cause % CAUSES_PER_JOINT) // 3
        group = np.repeat(2 * joint + kind, ORDER + 1)
        order = np.tile(np.arange(ORDER + 1), cause.size)
        return cls(columns.reshape(len(q_rad), 3, -1), group, order)


@dataclass(frozen=True)
class Scales:
    """Fitted variances: of the coefficients (F,), and of the bulk of the local errors (mm^2)."""

    coefficient: np.ndarray
    local_mm2: float


def fitted_scales(basis: Basis, rows, means_mm: np.ndarray, noise_mm: np.ndarray) -> Scales:
    """Maximum marginal likelihood of the scales by EM.

    rows: measured points; means_mm (n, 3) their mean readings; noise_mm (n,) standard deviations,
    of which the root mean square is used: meant for points read equally often.
    """
    matrix = basis.columns[rows].reshape(3 * len(rows), -1)
    y = means_mm.ravel()
    gram, against, power = matrix.T @ matrix, matrix.T @ y, float(y @ y) / y.size
    noise = float(np.mean(noise_mm**2))
    floor = _FLOOR * power
    groups, orders = int(basis.group.max()) + 1, ORDER + 1
    spread = float(np.trace(gram)) / y.size
    by_group, by_order = np.full(groups, 0.5 * power / spread), 0.5 ** np.arange(orders)
    local = 0.25 * power
    in_group = np.bincount(basis.group, minlength=groups)
    in_order = np.bincount(basis.order, minlength=orders)
    for _ in range(_ROUNDS):
        variance = by_group[basis.group] * by_order[basis.order]
        mean, cover = _solved(gram, against, 1.0 / (noise + local), variance)
        square = mean**2 + np.diag(cover)
        own = np.bincount(basis.group, square / by_order[basis.order], groups) / in_group
        by_group = np.maximum(own, floor / spread)
        own = np.bincount(basis.order, square / by_group[basis.group], orders) / in_order
        by_order = np.maximum(own, 1e-6)
        # The variance of what is left is noise and local errors together.
        left = power * y.size - 2.0 * float(mean @ against) + float(mean @ gram @ mean)
        left += float(np.sum(cover * gram))
        local = max(left / y.size - noise, floor)
    return Scales(by_group[basis.group] * by_order[basis.order], local)


@dataclass(frozen=True)
class Posterior:
    """What is known of all m points after readings at ``rows``.

    mean, cover: of the coefficients; local_mm (n, 3) and local_mm2 (n,) the local part of measured
    points given the coefficients' mean; ``shares`` (K,) and ``scales_mm2`` (K,) the mixture the
    local errors follow; ``odd`` (n,): squared distance of a reading from what all others predict,
    chi-square distributed with three degrees of freedom if the bulk's scale were all there is.
    """

    mean: np.ndarray
    cover: np.ndarray
    shares: np.ndarray
    scales_mm2: np.ndarray
    belongs: np.ndarray
    odd: np.ndarray


def posterior(
    basis: Basis, scales: Scales, rows, means_mm: np.ndarray, noise_mm: np.ndarray
) -> Posterior:
    """Coefficients and mixture of local errors given all readings, outliers weighed down."""
    count = len(rows)
    matrix = basis.columns[rows].reshape(3 * count, -1)
    y = means_mm.ravel()
    local = max(scales.local_mm2, 0.01 * float(np.median(noise_mm)) ** 2)
    steps = local * 4.0 ** np.arange(_SCALES)
    prior = _PSEUDO * 0.25 ** np.arange(_SCALES)  # the bulk unless readings say otherwise
    shares = prior / prior.sum()
    per_point = np.full(count, local)
    for _ in range(3):
        weight = np.repeat(1.0 / (noise_mm**2 + per_point), 3)
        weighted = matrix * weight[:, None]
        mean, cover = _solved(matrix.T @ weighted, weighted.T @ y, 1.0, scales.coefficient)
        left, still = _left_out(matrix, y, mean, cover, weight, count)
        variance = still[:, None] + noise_mm[:, None] ** 2 + steps
        log = -1.5 * np.log(variance) - 0.5 * np.sum(left**2, axis=1)[:, None] / variance
        density = np.exp(log - log.max(axis=1, keepdims=True))
        for _ in range(20):
            belongs = density * shares
            belongs /= belongs.sum(axis=1, keepdims=True)
            shares = belongs.sum(axis=0) + prior
            shares /= shares.sum()
        inverse = np.sum(belongs / (noise_mm[:, None] ** 2 + steps), axis=1)
        per_point = np.maximum(1.0 / inverse - noise_mm**2, local)
    odd = np.sum(left**2, axis=1) / (still + noise_mm**2 + local)
    return Posterior(mean, cover, shares, steps, belongs, odd)


def largest_draws(
    basis: Basis,
    known: Posterior,
    rows,
    means_mm: np.ndarray,
    noise_mm: np.ndarray,
    count: int,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draws (count,) of the largest error of the measured and of all points, and who it was.

    The third is how often each of all m points was the largest of all, (m,).
    """
    points, features = len(basis.columns), known.mean.size
    root = np.linalg.cholesky(
        known.cover + 1e-12 * np.trace(known.cover) / features * np.eye(features)
    )
    coefficients = known.mean[:, None] + root @ rng.normal(size=(features, count))
    smooth = (basis.columns.reshape(3 * points, -1) @ coefficients).reshape(points, 3, count)
    rows = np.asarray(rows)
    total = smooth
    which = _chosen(known.belongs, rng.random((len(rows), count)))
    local = known.scales_mm2[which]
    keep = local / (local + noise_mm[:, None] ** 2)
    left = means_mm[:, :, None] - smooth[rows]
    spread = np.sqrt(keep) * noise_mm[:, None]
    jitter = rng.normal(size=left.shape)
    measured = smooth[rows] + keep[:, None] * left + spread[:, None] * jitter
    free = np.setdiff1d(np.arange(points), rows)
    if free.size:
        which = _chosen(
            np.broadcast_to(known.shares, (free.size, known.shares.size)),
            rng.random((free.size, count)),
        )
        own = np.sqrt(known.scales_mm2[which])
        total[free] += own[:, None] * rng.normal(size=(free.size, 3, count))
    total[rows] = measured
    size = np.sqrt(np.sum(total**2, axis=1))
    winners = np.bincount(np.argmax(size, axis=0), minlength=points) / count
    return size[rows].max(axis=0), size.max(axis=0), winners


def _chosen(shares: np.ndarray, uniform: np.ndarray) -> np.ndarray:
    """Component (n, count) drawn for every row with its shares (n, K)."""
    edges = np.cumsum(shares, axis=1)[:, :-1]
    return np.sum(uniform[:, None, :] > edges[:, :, None], axis=1)


def _solved(gram, against, weight: float, variance) -> tuple[np.ndarray, np.ndarray]:
    """Posterior mean (F,) and covariance (F, F) of coefficients with prior ``variance`` (F,).

    gram (F, F) and against (F,): normal equations, to be multiplied by ``weight``.
    """
    from scipy.linalg import cho_factor, cho_solve

    scale = np.sqrt(variance)
    normal = gram * (weight * scale * scale[:, None])
    normal[np.diag_indices_from(normal)] += 1.0
    factor = cho_factor(normal, lower=True, check_finite=False)
    cover = cho_solve(factor, np.eye(len(scale)), check_finite=False) * scale * scale[:, None]
    return cover @ (weight * against), cover


def _left_out(matrix, y, mean, cover, weight, count) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, 3) of every point against a fit without it, and the fit's variance (n,)."""
    blocks = matrix.reshape(count, 3, -1)
    inside = np.einsum("nif,njf->nij", blocks @ cover, blocks)
    own = 1.0 / weight.reshape(count, 3)[:, 0]
    left = (y - matrix @ mean).reshape(count, 3)
    # Taking a point out: residual (I - H)^-1 r with leverage H = inside / own variance.
    gap = np.eye(3) - inside / own[:, None, None]
    gap += 1e-9 * np.eye(3)
    without = np.linalg.solve(gap, left[:, :, None])[:, :, 0]
    still = np.trace(np.linalg.solve(gap, inside), axis1=1, axis2=2) / 3.0
    return without, np.maximum(still, 0.0)
