"""What moved between two series of one arm, and how much of that chance alone shows.

The null hypothesis: between two series nothing happened at the arm. That does not make them alike.

1. A model is wrong in ways that depend on the pose, the same ways in both series. Two series at the
   same configurations share that misfit, and it cancels; two pose sets do not, and fits to them
   differ however small the noise is. Misfit is taken as errors in front of every joint that change
   smoothly with that joint, of a size that both series show, joint by joint (variance components by
   the evidence), and beside these whatever differs from configuration to configuration. Misfit may
   go further from one part of the joints to another than that: how much, halves of one series say,
   between which nothing happened either (``understated``).
2. The arm warms up, each time differently. What changes with the order of measuring inside the
   series is a state of the arm in which a series may be as a whole.
3. At another temperature all lengths of the arm have grown alike. That is no change of the arm: it
   is left out as base and tool are where these were set up anew, whatever it is.
4. Visits repeat within limits, and the instrument has noise.

The change is estimated together with all of these, by least squares under their variances. Smooth
misfit and states are drawn from their variances. All else is drawn by resampling configurations
(wild bootstrap: the share of every configuration in the change, from residuals of a fit without it,
times a random factor), whatever it is made of; readings of one configuration go together, in both
series.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from kinacc.deployment.drift_pairs import Pair

DRAWS = 4000
GROWTH = 0.12  # standard deviation, in 1e-3 of lengths: metal by 10 K
UNITS = (1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3)  # of joint errors: what counts as much as one mm
_SEEN = 1e-3  # of the best seen movement; what moves less is no direction of the arm
_ROUNDS, _SETTLED = 15, 0.1  # of the variances; relative change
_FIRM = 1e-9  # of the largest diagonal: what base, tool and joints share stays where it is
_LEAST_MM = 1e-4  # standard deviation of misfit: less is none
_START_MM = 0.1


class Moved(NamedTuple):
    """Movement of the arm between two series, over the poses of the second.

    ``directions`` (d, 6k): joint errors (mm and rad) that move these by 1 mm rms each, after the
    best growth of all lengths, and base and tool where these were set up anew; ``change`` (d,) in
    mm along them; ``chance`` (DRAWS, d): changes that an arm shows that did not change.
    """

    directions: np.ndarray
    change: np.ndarray
    chance: np.ndarray

    def along(self, constant: np.ndarray) -> np.ndarray:
        """What joint errors (6k, n) in mm and rad are in mm along the directions, (d, n)."""
        units = np.tile(UNITS, constant.shape[0] // 6)[:, None]
        return np.linalg.pinv(self.directions.T / units) @ (constant / units)

    @property
    def moved_mm(self) -> float:
        """Rms movement."""
        return float(np.linalg.norm(self.change))

    @property
    def probability(self) -> float:
        """Of at least that movement where nothing changed."""
        more = np.sum(self._by_chance_mm >= self.moved_mm)
        return float((1 + more) / (1 + len(self.chance)))

    def chance_mm(self, level: float) -> float:
        """The movement that an arm that did not change exceeds in a share ``level`` of cases."""
        return float(np.quantile(self._by_chance_mm, 1.0 - level))

    @property
    def _by_chance_mm(self) -> np.ndarray:
        return np.linalg.norm(self.chance, axis=1)


def understated(cuts: Sequence[Pair], rng: np.random.Generator) -> float:
    """Mean square movement between halves of one series, over that by chance: 1 if that is right.

    Nothing happens to an arm between halves of a series, but they lie apart in the joints: what
    they show beyond chance is misfit that poses of one part do not foretell of another.
    """
    ratios = []
    for each in cuts:
        found = moved(each, 1.0, rng)
        ratios.append(found.moved_mm**2 / np.mean(np.sum(found.chance**2, axis=1)))
    return float(np.mean(ratios))


def moved(pair: Pair, misfit: float, rng: np.random.Generator, with_growth: bool = False) -> Moved:
    """The movement between two series and what chance shows; all chance is of ``rng``.

    ``misfit``: factor on the deviations of the misfit that the series do not share, 1 or more.
    ``with_growth``: growth of all lengths is part of the movement, and of chance as by ``GROWTH``.
    """
    directions = seen_directions(pair, with_growth)
    count = len(directions)
    change = pair.constant @ directions.T
    drift = change * pair.late[:, None]
    inside = [drift * (pair.second == each)[:, None] for each in (False, True)]
    firm = np.concatenate([pair.frames, pair.constant], axis=1)
    if not with_growth:
        firm = np.column_stack([firm, pair.constant @ pair.longer * pair.second])
    size = np.linalg.norm(firm, axis=0)
    firm = firm / np.where(size > 0.0, size, 1.0)
    free = np.concatenate([firm, change * pair.second[:, None]], axis=1)
    random = np.concatenate([pair.misfit, *inside], axis=1)
    warming = int(pair.joint.max(initial=-1)) + 1
    group = np.concatenate([pair.joint, np.full(2 * count, warming)])
    columns = np.concatenate([free, random], axis=1)
    gram, seen = columns.T @ columns, columns.T @ pair.residual
    split = free.shape[1]
    gram[np.diag_indices(split)] += _FIRM * gram[:split, :split].diagonal().max()
    noise, prior = _variances(gram, seen, pair, split, group)
    held = np.concatenate([np.zeros(split), noise / prior[group]])
    inverse = _inverse(gram + np.diag(held))
    found = inverse @ seen
    changes = slice(split - count, split)
    scores = _shares(pair, columns, found, inverse, changes)
    blurred = (inverse[changes] @ gram[:, split:]) * np.sqrt(prior[group])
    both = np.intersect1d(pair.cluster[pair.second], pair.cluster[~pair.second])
    alone = ~np.isin(np.unique(pair.cluster), both)
    scores[alone] *= misfit
    # Between two series a state may differ by both their states.
    smooth = misfit**2 * blurred @ blurred.T + 2.0 * prior[warming] * np.eye(count)
    chance = rng.standard_normal((DRAWS, len(scores))) @ scores
    chance += rng.standard_normal((DRAWS, count)) @ _root(smooth).T
    result = Moved(directions, found[changes], chance)
    if with_growth:
        chance += rng.standard_normal((DRAWS, 1)) * GROWTH * result.along(pair.longer[:, None]).T
    return result


def seen_directions(pair: Pair, with_growth: bool = False) -> np.ndarray:
    """Directions (d, 6k) of joint errors, each moving the second series by 1 mm rms.

    After the best base and tool where these are its own, and growth of all lengths unless that is
    part of it; orthogonal as movements, so that the root of summed squares along them is the rms
    movement.
    """
    rows = pair.second
    constant, own = pair.constant[rows], pair.frames[rows][:, pair.own]
    if not with_growth:
        own = np.column_stack([own, constant @ pair.longer])
    if own.shape[1]:
        size = np.linalg.norm(own, axis=0)
        left, values, _ = np.linalg.svd(own / np.where(size > 0.0, size, 1.0), full_matrices=False)
        left = left[:, values > _FIRM * values[0]]
        constant = constant - left @ (left.T @ constant)
    at = constant[pair.position[rows]]
    units = np.tile(UNITS, at.shape[1] // 6)
    _, values, right = np.linalg.svd(at * units, full_matrices=False)
    kept = values > _SEEN * values[0]
    return right[kept] * units / values[kept, None] * np.sqrt(len(at) / 3.0)


def _variances(
    gram: np.ndarray, seen: np.ndarray, pair: Pair, split: int, group: np.ndarray
) -> tuple[float, np.ndarray]:
    """Variance of noise, and of every group of random effects, by the evidence (MacKay 1992)."""
    beside = np.column_stack([gram[:split, split:], seen[:split]])
    free = np.linalg.solve(gram[:split, :split], beside)
    inner = gram[split:, split:] - gram[split:, :split] @ free[:, :-1]
    right = seen[split:] - gram[split:, :split] @ free[:, -1]
    square = float(pair.residual @ pair.residual - seen[:split] @ free[:, -1])
    left = len(pair.residual) - split
    prior, noise = np.full(group.max() + 1, _START_MM**2), 0.3 * square / left
    sizes = np.bincount(group)
    for _ in range(_ROUNDS):
        held = noise / prior[group]
        lower, _ = scipy.linalg.lapack.dpotrf(inner + np.diag(held), lower=1)
        found, _ = scipy.linalg.lapack.dpotrs(lower, right, lower=1)
        spread, _ = scipy.linalg.lapack.dpotri(lower, lower=1, overwrite_c=1)
        informed = 1.0 - held * spread.diagonal()
        unexplained = square - 2.0 * found @ right + found @ inner @ found
        noise = unexplained / max(left - informed.sum(), 1.0)
        told = np.bincount(group, informed, len(sizes))
        new = np.bincount(group, found**2, len(sizes)) / np.maximum(told, np.finfo(float).tiny)
        new = np.maximum(new, _LEAST_MM**2)
        # What is no more than a hundredth of the noise settles nothing.
        counts = np.maximum(new, prior) > 1e-4 * noise
        change = np.abs(np.log(new / prior))[counts].max(initial=0.0)
        prior = new
        if change < _SETTLED:
            break
    return noise, prior


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric, positive definite matrix."""
    lower, _ = scipy.linalg.lapack.dpotrf(matrix, lower=1)
    half, _ = scipy.linalg.lapack.dpotri(lower, lower=1)
    return np.tril(half) + np.tril(half, -1).T


def _root(covariance: np.ndarray) -> np.ndarray:
    """A root (d, d) of a covariance, of which directions may have none."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _shares(
    pair: Pair, columns: np.ndarray, found: np.ndarray, inverse: np.ndarray, changes: slice
) -> np.ndarray:
    """Share (c, d) of every configuration in the change, by residuals of a fit without it."""
    left = pair.residual - columns @ found
    pull = columns @ inverse
    order = np.argsort(pair.cluster, kind="stable")
    label, begin, size = np.unique(pair.cluster[order], return_index=True, return_counts=True)
    shares = np.empty((len(label), changes.stop - changes.start))
    for each in np.unique(size):
        ours = np.flatnonzero(size == each)
        rows = order[begin[ours, None] + np.arange(each)]
        own = np.eye(each) - pull[rows] @ columns[rows].transpose(0, 2, 1)
        values, vectors = np.linalg.eigh(own)
        # A direction that one configuration alone decides has no residual, with or without it.
        factor = 1.0 / np.where(values > _FIRM, values, 1.0)
        along = np.einsum("cij,ci->cj", vectors, left[rows]) * factor
        away = np.einsum("cij,cj->ci", vectors, along)
        shares[ours] = np.einsum("cid,ci->cd", pull[rows][:, :, changes], away)
    return shares
