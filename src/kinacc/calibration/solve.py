"""Least squares on kinematic models: Gauss-Newton under priors, or by truncated SVD.

Normal equations are scaled so that displacements count in mm and mrad. Parameters with a prior lean
on it as much as the residual variance says, which is estimated along. Directions that neither data
nor a prior determine stay nominal: singular values below a share of the largest are left out, first
among base and targets, then among the model's parameters with base and targets projected out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from kinacc.calibration import robust, variances
from kinacc.calibration.robust import Weights
from kinacc.calibration.system import PoseSystem
from kinacc.errors import FitError

STEP_TOLERANCE = 1e-6  # mm and mrad
PRIOR_TOLERANCE = 1e-6  # the same beside priors, unless the objective stands still
MAX_ITERATIONS = 60
PATIENCE, HELD_PATIENCE = 12, 8  # steps after which standing still counts as arrived
STANDSTILL, NO_CHANGE = 1e-9, 1e-5  # share of the objective; of the variance
MAX_HALVINGS = 12
MEMORY = 6  # steps that suggest the next one
# Going back to nominal where the data is (nearly) blind costs a little: the optimum of a truncated
# fit is not quite the least cost.
TRUNCATED_GROWTH, COST_RESOLUTION = 1e-3, 1e-9
LEAST_COST = 1e-10  # mm^2: of noise-free data
FIRST_VARIANCE = 1e-6  # share of the mean squared misfit at the start
VARIANCE_STEPS, FIRST_TOLERANCE = 20, 1e-2  # of the first step, which leads elsewhere
FRAME_THRESHOLD = 1e-5  # frames have no nominal value to keep: only exact ambiguities are cut
TOUCH_SQUARED = 1e-4  # a parameter is undetermined if a truncated direction holds 1 % of it
MOVES_SQUARED = 0.25  # what moves a known frame by half as much as itself is known too
MAX_PASSES = 100
SETTLED = 1e-4  # mm and mrad by which a pass of a robust loss may still move a parameter
SCALE_PASSES = 20  # after these the scale of a loss is held, so that no cycle can form


@dataclass(frozen=True)
class Spectrum:
    """What data can tell of a block of parameters.

    ``values``: singular values of the Jacobian in units of ``scale``, falling, after the frame
    columns are projected out. ``rank`` of them exceed ``threshold`` times the largest; ``gap`` is
    the ratio across that cut, inf at full rank.
    """

    values: np.ndarray
    threshold: float
    rank: int
    gap: float

    @classmethod
    def of(cls, values: np.ndarray, threshold: float, most: int | None = None) -> Spectrum:
        """Spectrum of falling ``values``; no rank above ``most``."""
        rank = int(np.sum(values > threshold * values[0])) if values.size else 0
        rank = rank if most is None else min(rank, most)
        past = values[rank] if rank < values.size else 0.0
        gap = float(values[rank - 1] / past) if rank and past > 0.0 else float("inf")
        return cls(values, threshold, rank, gap)


@dataclass(frozen=True)
class Solution:
    """Outcome of a fit of P parameters to ``count`` residuals.

    ``std`` (P,) and ``covariance`` (P, P) in the parameters' own units for residuals of
    ``variance``. The covariance is that of the determined directions; ``undetermined`` (m, P) are
    the others, unit displacements in units of ``scale`` (P,) that change no residual, and ``std``
    is NaN where one of them reaches a parameter. ``cost`` is the sum of squared residuals,
    ``degrees_of_freedom`` their number less the (effective) number of fitted parameters,
    ``last_step`` the largest last change in units of ``scale``; ``converged`` where it is not above
    the tolerance, else the objective stood still before. ``spectrum``: of the model's parameters.
    """

    x: np.ndarray
    std: np.ndarray
    covariance: np.ndarray
    cost: float
    count: int
    degrees_of_freedom: float
    variance: float
    iterations: int
    last_step: float
    converged: bool
    spectrum: Spectrum | None
    undetermined: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True)
class Task:
    """A fit of P parameters: components of ``system.frames`` first, then those of its model.

    Priors of standard deviation ``prior_std`` (P,), inf for none, expect ``nominal`` (P,), where
    directions that are left out stay. ``scale`` (P,): displacements that count as one mm. Singular
    values below ``threshold`` of the largest are left out; None: priors hold everything.
    ``least_variance`` of residuals beside priors: at least above rounding.
    """

    name: str
    system: PoseSystem
    start: np.ndarray
    nominal: np.ndarray
    prior_std: np.ndarray
    scale: np.ndarray
    threshold: float | None
    least_variance: float = 1e-8

    @property
    def active(self) -> np.ndarray:
        """True (P,) for parameters that are estimated."""
        free = self.system.frames.free
        return np.append(free, np.ones(self.system.free.sum(), dtype=bool))


def minimise(task: Task) -> Solution:
    """The least-squares fit of a task. Raises FitError where it does not converge."""
    return _Descent(task).run()


def minimise_robust(task: Task, loss: str) -> tuple[Solution, Weights | None]:
    """The fit of ``task`` under a ``loss`` and, where that is not squares, the rows' weights.

    A robust loss is minimised by reweighted squares (see ``robust``); ``variance`` is then that of
    its scale. Raises FitError where the passes do not settle.
    """
    found = minimise(task)
    if loss == robust.SQUARES:
        return found, None
    weights, observations = None, task.system.observations
    for number in range(MAX_PASSES):
        before = found.x
        scale = weights.scale_mm if weights and number >= SCALE_PASSES else None
        weights = robust.weights(loss, task.system.residual(before), observations, scale)
        weighted = replace(task, system=task.system.weighted(np.sqrt(weights.row)), start=before)
        found = minimise(weighted)
        moved = float(np.max(np.abs(found.x - before) / task.scale, initial=0.0))
        if moved <= SETTLED:
            factor = weights.scale_mm**2 / found.variance if found.variance > 0.0 else 1.0
            scaled = replace(
                found,
                variance=factor * found.variance,
                covariance=factor * found.covariance,
                std=np.sqrt(factor) * found.std,
            )
            return scaled, weights
    raise FitError(
        f"{task.name}: loss {loss} has not settled after {MAX_PASSES} passes; the last one moved "
        f"a parameter by {moved:.3g} mm or mrad (wanted {SETTLED:g})"
    )


class _Descent:
    """Gauss-Newton steps in the scaled active parameters of a task."""

    def __init__(self, task: Task) -> None:
        self.task, self.x = task, np.array(task.start, dtype=float)
        self.active = task.active
        self.scale = task.scale[self.active]
        self.expected = np.isfinite(task.prior_std[self.active])
        with np.errstate(divide="ignore"):
            self.weight = self.scale / task.prior_std[self.active]  # for unit variance
        self.frames = int(self.active[: task.system.frames.size].sum())
        self.count = float(task.system.counts.sum())
        if task.threshold is None:
            self.count = task.system.weight
        self.variance = 0.0
        self.ranks: tuple[int, int] | None = None
        self.past: list[tuple[np.ndarray, np.ndarray]] = []
        self.look(self.x)

    @property
    def cost(self) -> float:
        """Sum of squared residuals."""
        return float(self.costs.sum())

    def look(self, x: np.ndarray) -> float:
        """Normal equations at ``x`` and the objective there."""
        grams = self.task.system.normal(x, by_kind=self.task.threshold is not None)
        keep = np.append(self.active, True)
        unit = np.append(self.scale, 1.0)
        self.grams = grams[:, keep][:, :, keep] * np.outer(unit, unit)
        self.gram = self.grams.sum(axis=0)
        self.costs = self.grams[:, -1, -1]
        off = (x[self.active] - self.task.nominal[self.active]) / self.scale
        self.displacement = off
        return self.cost + self.variance * float(self.weight**2 @ off**2)

    def split(self, telling: bool = False) -> Split:
        """What the latest normal equations determine under the latest variance."""
        weight = np.sqrt(self.variance) * self.weight
        if self.task.threshold is None:
            return Split.held(self.gram, weight, self.task.name)
        least = self.task.threshold if telling else FRAME_THRESHOLD
        thresholds = max(least, FRAME_THRESHOLD), self.task.threshold
        expected = weight if self.variance > 0.0 else self.weight * 0.0
        most = None if telling else self.ranks
        return Split.of(self.gram, self.frames, expected, thresholds, most, telling)

    def balanced(self, first: bool) -> tuple[Split, np.ndarray]:
        """A step, and the residual variance it leaves, which weighs the priors.

        From below: started at the variance of the whole misfit, a tight prior could pass for truth
        and everything it forbids for noise.
        """
        if not self.expected.any():
            split = self.split()
            return split, split.step(self.gram[:-1, -1], self.displacement, 0.0 * self.weight)
        if first:
            self.variance = max(FIRST_VARIANCE * self.cost / self.count, self.task.least_variance)
        for _ in range(VARIANCE_STEPS if first else 1):
            split = self.split()
            squared = self.variance * self.weight**2
            step = split.step(self.gram[:-1, -1], self.displacement, squared)
            to = np.append(step, 1.0)
            left = float(to @ self.gram @ to) / max(self.count - split.effective, 1.0)
            before, self.variance = self.variance, max(left, self.task.least_variance)
            if abs(self.variance - before) <= FIRST_TOLERANCE * before:
                break
        return split, step

    def run(self) -> Solution:
        """Steps until one is small or the objective stands still."""
        growth = COST_RESOLUTION if self.task.threshold is None else TRUNCATED_GROWTH
        tolerance = STEP_TOLERANCE if self.task.threshold is not None else PRIOR_TOLERANCE
        for iteration in range(1, MAX_ITERATIONS + 1):
            settled = self.variance
            split, step = self.balanced(iteration == 1)
            size = float(np.max(np.abs(step), initial=0.0))
            if not np.isfinite(size):
                raise FitError(f"{self.task.name}: a step is not finite at cost {self.cost:.6g}")
            if iteration > 2:
                self.ranks = split.ranks  # a rank that has been lost is not taken back
            if size <= tolerance and abs(self.variance - settled) <= 1e-9 * settled:
                self.x[self.active] += self.scale * step
                to = np.append(step, 1.0)
                self.costs = to @ self.grams @ to
                return self.solution(iteration, size, True)
            before = self.cost + self.variance * float(self.weight**2 @ self.displacement**2)
            moves = [self.accelerated(step)] if self.task.threshold is None else []
            moves += [step / 2**halving for halving in range(MAX_HALVINGS)]
            here = self.x
            for move in moves:
                self.x = here.copy()
                self.x[self.active] += self.scale * move
                after = self.look(self.x)
                if after <= before * (1.0 + growth) + LEAST_COST:
                    break
                self.past.clear()
            else:
                self.x, after = here, before
                self.look(here)
            least = max(STANDSTILL * before, NO_CHANGE * self.variance)
            patience = PATIENCE if self.task.threshold is not None else HELD_PATIENCE
            if iteration >= patience and abs(before - after) <= least:
                return self.solution(iteration, size, self.task.threshold is None)
        raise FitError(
            f"{self.task.name}: not converged after {iteration} iterations; last step {size:.3g} "
            f"mm or mrad (wanted {tolerance:g}), cost {self.cost:.6g} over {self.count} residuals"
        )

    def accelerated(self, step: np.ndarray) -> np.ndarray:
        """The step that past ones suggest (Anderson, J. ACM 12, 1965).

        Along directions that data hardly show, Gauss-Newton steps die out slowly.
        """
        self.past.append((self.displacement, step))
        del self.past[:-MEMORY]
        if len(self.past) < 2:
            return step
        moved, changed = (np.diff(each, axis=0).T for each in zip(*self.past, strict=True))
        share = np.linalg.lstsq(changed, step, rcond=1e-8)[0]
        return step - (moved + changed) @ share

    def solution(self, iterations: int, size: float, converged: bool) -> Solution:
        """What the latest normal equations say of the parameters."""
        fitted = self.split()
        told = self.split(telling=True)
        freedom = self.count - fitted.effective
        variance = self.cost / freedom if freedom > 0 else np.nan
        if self.task.threshold is None:
            variance = self.variance
        along = variance * np.eye(told.root.shape[1])
        spectrum = fitted.spectrum
        if len(self.grams) == 2:  # of truncated fits
            if freedom > 0:
                along = self.spread(fitted.root, told.root, variance)
            values = singular_values(self.task.system, self.x, self.task.scale, self.active)
            spectrum = Spectrum.of(values, self.task.threshold, fitted.spectrum.rank)
        return self._embedded(told, along, spectrum, freedom, variance, iterations, size, converged)

    def spread(self, fitted: np.ndarray, told: np.ndarray, variance: float) -> np.ndarray:
        """Covariance (r, r) along ``told`` (P, r), by the variances of each kind of error."""
        system, counts = self.task.system, self.task.system.counts
        shared = variances.shared_errors(system.observations)
        if shared:
            roots = np.zeros((2, self.active.size, max(fitted.shape[1], told.shape[1])))
            for root, own in zip(roots, (fitted, told), strict=True):
                root[self.active, : own.shape[1]] = self.scale[:, None] * own
            ends = roots[0][:, : fitted.shape[1]], roots[1][:, : told.shape[1]]
            return variances.along_root(system, self.x, shared, *ends, variance)
        along = variance * np.eye(told.shape[1])
        if np.all(counts > 0):
            parts = np.stack([fitted.T @ each[:-1, :-1] @ fitted for each in self.grams])
            found = variances.of_kinds(self.costs, counts, parts, variance)
            for each, own in zip(self.grams, found - variance, strict=True):
                along += own * (told.T @ each[:-1, :-1] @ told)
        return along

    def _embedded(self, told, along, spectrum, freedom, variance, iterations, size, converged):
        frames, active = self.task.system.frames, self.active
        covariance = np.zeros((active.size, active.size))
        own = told.root @ along @ told.root.T * np.outer(self.scale, self.scale)
        covariance[np.ix_(active, active)] = own
        lost = np.zeros((told.lost.shape[1] + len(frames.hidden), active.size))
        lost[: told.lost.shape[1], active] = told.lost.T
        lost[told.lost.shape[1] :, : frames.size] = frames.hidden
        touched = np.zeros(active.size)
        touched[active] = np.sum(told.anchor**2, axis=1)
        touched[: frames.size] += np.sum(frames.hidden**2, axis=0)
        blank = ~active & (touched <= TOUCH_SQUARED)
        std = np.where(
            (touched > TOUCH_SQUARED) | blank, np.nan, np.sqrt(np.maximum(np.diag(covariance), 0.0))
        )
        return Solution(
            self.x, std, covariance, self.cost, self.count, freedom, variance, iterations, size,
            converged, spectrum, lost, self.task.scale,
        )  # fmt: skip


@dataclass(frozen=True)
class Split:
    """Scaled parameters (P,) cut into directions that are determined and those that are not.

    ``root`` (P, r): its product with its transpose inverts the normal matrix and the prior's on the
    determined directions. ``lost`` (P, l): the others, base and targets following those of the
    model, of which ``anchor`` (P, l) is the part that stays nominal. ``effective``: number of
    parameters that the data, not a prior, decide.
    """

    root: np.ndarray
    lost: np.ndarray
    anchor: np.ndarray
    spectrum: Spectrum | None = None
    ranks: tuple[int, int] | None = None
    effective: float = 0.0

    @classmethod
    def held(cls, gram: np.ndarray, weight: np.ndarray, name: str) -> Split:
        """Everything is determined, by priors where data do not."""
        normal = gram[:-1, :-1].copy()
        normal[np.diag_indices_from(normal)] += weight**2
        factor, failed = scipy.linalg.lapack.dpotrf(normal, lower=1)
        if failed:
            raise FitError(
                f"{name}: the normal matrix of {len(normal)} parameters is not positive definite; "
                "give every undetermined direction a prior"
            )
        root = scipy.linalg.lapack.dtrtri(factor, lower=1, overwrite_c=1)[0].T
        nothing = np.zeros((len(normal), 0))
        by_prior = float(weight**2 @ np.sum(root**2, axis=1))
        return cls(root, nothing, nothing, effective=len(normal) - by_prior)

    @classmethod
    def of(
        cls,
        gram: np.ndarray,
        frames: int,
        weight: np.ndarray,
        thresholds: tuple[float, float],
        most: tuple[int, int] | None = None,
        telling: bool = False,
    ) -> Split:
        """Cut by ``thresholds`` of the first ``frames`` parameters and of the others.

        ``weight`` (P,): residual over prior standard deviation of parameters, 0 for none. A
        direction that a prior speaks of is determined. ``telling``: in what is said of a fit, also
        one that moves a frame with a prior.
        """
        normal, own = gram[:-1, :-1].copy(), slice(frames, None)
        normal[np.diag_indices(frames)] += weight[:frames] ** 2
        placed = np.eye(frames)[weight[:frames] > 0.0]
        base = normal[:frames, :frames]
        spoken = [(placed, TOUCH_SQUARED)] if telling else []
        kept, lost_base, at = _cut(base, thresholds[0], most and most[0], spoken)
        root_base = _root(kept, base)
        follow = -root_base @ (root_base.T @ normal[:frames, own])
        left = normal[own, own] + normal[own, :frames] @ follow
        spoken = [(np.eye(len(left))[weight[own] > 0.0], TOUCH_SQUARED)]
        spoken += [(placed @ follow, MOVES_SQUARED)] if telling else []
        kept, lost, spectrum = _cut(left, thresholds[1], most and most[1], spoken)
        root = _root(kept, left + np.diag(weight[own] ** 2))
        blank = np.zeros((len(left), root_base.shape[1])), np.zeros((len(left), lost_base.shape[1]))
        both = np.block([[root_base, follow @ root], [blank[0], root]])
        return cls(
            both,
            np.block([[lost_base, follow @ lost], [blank[1], lost]]),
            np.block([[lost_base, np.zeros((frames, lost.shape[1]))], [blank[1], lost]]),
            spectrum,
            (at.rank, spectrum.rank),
            float(np.sum(both * (gram[:-1, :-1] @ both))),
        )

    def step(
        self, gradient: np.ndarray, displacement: np.ndarray, weight_sq: np.ndarray
    ) -> np.ndarray:
        """Least squares in the determined directions, back to nominal in the others."""
        down = self.root @ (self.root.T @ (gradient + weight_sq * displacement))
        return -down - self.lost @ (self.anchor.T @ displacement)


def _cut(
    normal: np.ndarray,
    threshold: float,
    most: int | None,
    spoken: Sequence[tuple[np.ndarray, float]],
) -> tuple[np.ndarray, np.ndarray, Spectrum]:
    """Orthonormal directions (P, r) kept, (P, l) lost, and the spectrum by which they are cut.

    ``spoken``: derivatives of what is known otherwise; a lost direction is kept where its squared
    change exceeds the number beside.
    """
    values, vectors = np.linalg.eigh(normal)
    spectrum = Spectrum.of(np.sqrt(np.maximum(values[::-1], 0.0)), threshold, most)
    vectors = vectors[:, ::-1]
    kept, lost = vectors[:, : spectrum.rank], vectors[:, spectrum.rank :]
    for known, least in spoken:
        if len(known) and lost.size:
            _, change, turn = np.linalg.svd(known @ lost)
            told = int(np.sum(change**2 > least))
            turned = lost @ turn.T
            kept, lost = np.concatenate([kept, turned[:, :told]], axis=1), turned[:, told:]
    return kept, lost, spectrum


def _root(kept: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Matrix (P, r) whose product with its transpose inverts ``normal`` on ``kept`` (P, r)."""
    return kept @ np.linalg.inv(np.linalg.cholesky(kept.T @ normal @ kept)).T


def singular_values(
    system: PoseSystem, x: np.ndarray, scale: np.ndarray, active: np.ndarray | None = None
) -> np.ndarray:
    """Singular values of the scaled Jacobian at ``x``, base and targets projected out.

    Of the columns ``active`` (P,), all where not given. By orthogonal reduction they keep their
    digits below 1e-7 of the largest, unlike through the normal equations.
    """
    active = np.ones(system.size, dtype=bool) if active is None else active
    factor = np.zeros((0, int(active.sum())))
    for columns, _ in system.columns(x):
        rows = columns.reshape(len(columns), -1)[:-1][active] * scale[active, None]
        factor = np.concatenate([factor.T, rows], axis=1).T  # by columns, as LAPACK wants them
        (factor,) = scipy.linalg.qr(factor, mode="r", overwrite_a=True, check_finite=False)
        factor = factor[: factor.shape[1]]
    frames = int(active[: system.frames.size].sum())
    return np.linalg.svd(factor[frames:, frames:], compute_uv=False)


def undetermined(
    system: PoseSystem, x: np.ndarray, scale: np.ndarray, threshold: float
) -> np.ndarray:
    """Directions (m, P) that ``system`` linearised at ``x`` does not show, as in ``Solution``."""
    gram = system.normal(x)[0] * np.outer(np.append(scale, 1.0), np.append(scale, 1.0))
    split = Split.of(gram, system.frames.size, np.zeros(system.size), (threshold, threshold))
    return split.lost.T
