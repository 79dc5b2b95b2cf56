"""Least squares on kinematic models: Gauss-Newton under priors, or by truncated SVD.

Normal equations are scaled so that displacements count in mm and mrad. Parameters with a prior lean
on it as much as the residual variance says, which is estimated along. Directions that neither data
nor a prior determine stay nominal: singular values below a share of the largest are left out, first
among base and targets, then among the model's parameters with base and targets projected out. A
robust loss leans less on rows far off, with a scale taken from the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ContextDecorator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy
import scipy.linalg
from threadpoolctl import ThreadpoolController

from kinacc.calibration.observations import Observations
from kinacc.calibration.uncertainty import TOUCH_SQUARED, covariance_along, shared_errors
from kinacc.errors import FitError

if TYPE_CHECKING:
    from kinacc.calibration.fitting import PoseSystem

MOVES_SQUARED = 0.25  # what moves a known frame by half as much as itself is known too


# Matrices are small: more BLAS threads than one only wait.
one_thread: ContextDecorator = ThreadpoolController().wrap(limits=1, user_api="blas")


@dataclass(frozen=True)
class Spectrum:
    """What data can tell of a block of parameters.

    ``values``: singular values of the Jacobian in units of ``scale``, falling, after the frame
    columns are projected out. ``rank`` of them exceed ``threshold`` times the largest.
    """

    values: np.ndarray
    threshold: float
    rank: int


@dataclass(frozen=True)
class Split:
    """Scaled parameters (P,) cut into directions that are determined and those that are not.

    ``root`` (P, r): its product with its transpose inverts the normal matrix and the prior's on the
    determined directions. ``lost`` (P, l): the others, base and targets following those of the
    model, of which ``anchor`` (P, l) is the part that stays nominal. ``effective``: number of
    parameters that the data, not a prior, decide. ``ranks``: numbers of frame and model directions
    above the thresholds.
    """

    root: np.ndarray
    lost: np.ndarray
    anchor: np.ndarray
    effective: float
    ranks: tuple[int, int] | None = None

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
        return cls(root, nothing, nothing, len(normal) - by_prior)

    @classmethod
    def of(
        cls,
        gram: np.ndarray,
        frames: int,
        weight: np.ndarray,
        thresholds: tuple[float, float],
        most: tuple[int, int] | None = None,
        reported: bool = False,
    ) -> Split:
        """Cut by ``thresholds`` of the first ``frames`` parameters and of the others.

        ``weight`` (P,): residual over prior standard deviation of parameters, 0 for none. A
        direction that a prior speaks of is determined; ``reported``: in the report of a fit, also
        one that moves a frame with a prior.
        """
        normal, arm = gram[:-1, :-1].copy(), slice(frames, None)
        normal[np.diag_indices(frames)] += weight[:frames] ** 2
        placed = np.eye(frames)[weight[:frames] > 0.0]
        base = normal[:frames, :frames]
        known = [(placed, TOUCH_SQUARED)] if reported else []
        directions, lost_base, rank_base = _cut(base, thresholds[0], most and most[0], known)
        root_base = _root(directions, base)
        follow = np.eye(len(normal))
        follow[:frames, arm] = -root_base @ (root_base.T @ normal[:frames, arm])
        rest = normal[arm, arm] + normal[arm, :frames] @ follow[:frames, arm]
        known = [(np.eye(len(rest))[weight[arm] > 0.0], TOUCH_SQUARED)]
        known += [(placed @ follow[:frames, arm], MOVES_SQUARED)] if reported else []
        directions, lost_arm, rank_arm = _cut(rest, thresholds[1], most and most[1], known)
        root_arm = _root(directions, rest + np.diag(weight[arm] ** 2))
        root = follow @ scipy.linalg.block_diag(root_base, root_arm)
        anchor = scipy.linalg.block_diag(lost_base, lost_arm)
        effective = float(np.sum(root * (gram[:-1, :-1] @ root)))
        return cls(root, follow @ anchor, anchor, effective, (rank_base, rank_arm))

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
    known: Sequence[tuple[np.ndarray, float]],
) -> tuple[np.ndarray, np.ndarray, int]:
    """Orthonormal directions (P, r) kept, (P, l) lost, and the number above ``threshold``.

    ``known``: derivatives of what is known otherwise; a lost direction is kept where its squared
    change exceeds the number beside.
    """
    values, vectors = np.linalg.eigh(normal)
    rank = _rank(np.sqrt(np.maximum(values[::-1], 0.0)), threshold, most)
    directions, lost = np.split(vectors[:, ::-1], [rank], axis=1)
    for derivative, least in known:
        _, change, turn = np.linalg.svd(derivative @ lost)
        back, lost = np.split(lost @ turn.T, [int(np.sum(change**2 > least))], axis=1)
        directions = np.concatenate([directions, back], axis=1)
    return directions, lost, rank


def _rank(values: np.ndarray, threshold: float, most: int | None) -> int:
    """Number of falling ``values`` above a share of the first, no more than ``most``."""
    return int(np.sum(values[:most] > threshold * values[:1]))


def _root(directions: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Matrix (P, r) whose product with its transpose inverts ``normal`` on the directions."""
    return directions @ np.linalg.inv(np.linalg.cholesky(directions.T @ normal @ directions)).T


def _singular_values(jacobian: np.ndarray, frames: int) -> np.ndarray:
    """Singular values of a Jacobian (m, P), its first columns projected out.

    By orthogonal reduction they keep their digits below 1e-7 of the largest, unlike through the
    normal equations.
    """
    (factor,) = scipy.linalg.qr(jacobian, mode="r", check_finite=False)
    return np.linalg.svd(factor[frames : factor.shape[1], frames:], compute_uv=False)


SQUARES, HUBER, TUKEY = "squares", "huber", "tukey"
# Share of rows of Gaussian noise alone that lies beyond the bend: of one component those are the
# usual 1.345 and 4.685 standard deviations (95 % efficiency).
_BEYOND = {HUBER: 0.17863, TUKEY: 2.7995e-6}


@dataclass(frozen=True)
class Weights:
    """``row`` (n,) weights of the rows; ``scale_mm`` per component."""

    row: np.ndarray
    scale_mm: float


def row_weights(
    loss: str, residual: np.ndarray, observations: Observations, scale_mm: float | None = None
) -> Weights:
    """Weights of ``loss`` at whitened residuals (m,), one weight per row (target of a pose).

    A row's d components (3, or 6 with its orientation) are judged together by their length u. The
    scale is the median over rows of u divided by its value for unit Gaussian noise, the root of
    the median of chi-square with d degrees of freedom: half the rows may be off. Huber's weight is
    1 up to the bend and bend / u beyond, Tukey's (1 - (u / bend)^2)^2 and 0 beyond (Holland and
    Welsch, Communications in Statistics 6, 1977), with the bend where the same share of Gaussian
    noise lies beyond as for one component. ``scale_mm``: a scale held from before.
    """
    components = np.where(observations.has_rotation, 6, 3)
    length = np.sqrt(np.bincount(observations.places[0], residual**2))
    scale = scale_mm
    if scale is None:
        scale = float(np.median(length / np.sqrt(scipy.special.chdtri(components, 0.5))))
    bend = np.sqrt(scipy.special.chdtri(components, _BEYOND[loss])) * max(
        scale, np.finfo(float).tiny
    )
    share = length / bend
    if loss == HUBER:
        weight = 1.0 / np.maximum(share, 1.0)
    else:
        weight = np.maximum(1.0 - share**2, 0.0) ** 2
    return Weights(weight, scale)


STEP_TOLERANCE = 1e-6  # mm and mrad
MAX_ITERATIONS = 200
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
MAX_PASSES = 100
SETTLED = 1e-4  # mm and mrad by which a pass of a robust loss may still move a parameter
SCALE_PASSES = 20  # after these the scale of a loss is held, so that no cycle can form


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
    count: float
    degrees_of_freedom: float
    variance: float
    iterations: int
    last_step: float
    converged: bool
    spectrum: Spectrum | None
    undetermined: np.ndarray
    scale: np.ndarray


def minimise_robust(fit: Descent, loss: str) -> tuple[Solution, Weights | None]:
    """A ``fit`` under a ``loss`` and, where that is not squares, the rows' weights.

    A robust loss is minimised by reweighted squares (see ``row_weights``); ``variance`` is then
    that of its scale. Raises FitError where the passes do not settle.
    """
    solution = fit.run()
    if loss == SQUARES:
        return solution, None
    weights, observations = None, fit.system.observations
    for number in range(MAX_PASSES):
        before = solution.x
        scale = weights.scale_mm if weights and number >= SCALE_PASSES else None
        weights = row_weights(loss, fit.system.residual(before), observations, scale)
        system = replace(fit.system, root=np.sqrt(weights.row))
        solution = replace(fit, system=system, start=before).run()
        moved = float(np.max(np.abs(solution.x - before) / fit.scale, initial=0.0))
        if moved <= SETTLED:
            factor = weights.scale_mm**2 / solution.variance if solution.variance > 0.0 else 1.0
            scaled = replace(
                solution,
                variance=factor * solution.variance,
                covariance=factor * solution.covariance,
                std=np.sqrt(factor) * solution.std,
            )
            return scaled, weights
    raise FitError(
        f"{fit.name}: loss {loss} has not settled after {MAX_PASSES} passes; the last one moved "
        f"a parameter by {moved:.3g} mm or mrad (wanted {SETTLED:g})"
    )


@dataclass
class Descent:
    """A fit of P parameters by Gauss-Newton steps in its scaled active ones.

    Components of ``system.frames`` come first, then those of its model. Priors of standard
    deviation ``prior_std`` (P,), inf for none, expect ``nominal`` (P,), where directions that are
    left out stay. ``scale`` (P,): displacements that count as one mm. Singular values below
    ``threshold`` of the largest are left out; None: priors hold everything. ``least_variance`` of
    residuals beside priors: at least above rounding.
    """

    name: str
    system: PoseSystem
    start: np.ndarray
    nominal: np.ndarray
    prior_std: np.ndarray
    scale: np.ndarray
    threshold: float | None
    least_variance: float = 1e-8

    def __post_init__(self) -> None:
        self.truncated = self.threshold is not None
        free = self.system.frames.free
        self.active = np.append(free, np.ones(self.system.free.sum(), dtype=bool))
        self.frames, self.unit = int(free.sum()), self.scale[self.active]
        self.weight = self.unit / self.prior_std[self.active]  # for unit variance
        system = self.system
        self.count = float(system.observations.components if self.truncated else system.weight)
        self.variance = 0.0
        self.ranks: tuple[int, int] | None = None
        self.past: list[tuple[np.ndarray, np.ndarray]] = []
        self.look(self.start)

    def look(self, x: np.ndarray) -> float:
        """Go to ``x``: normal equations and the objective there."""
        self.x, keep = x, np.append(self.active, True)
        self.gram = self.system.normal(x, self.scale)[keep][:, keep]
        self.cost = float(self.gram[-1, -1])
        self.displacement = (x - self.nominal)[self.active] / self.unit
        return self.objective

    @property
    def objective(self) -> float:
        """Sum of squared residuals, and of displacements beside their priors."""
        return self.cost + self.variance * float(self.weight**2 @ self.displacement**2)

    def split(self, reported: bool = False) -> Split:
        """What the latest normal equations determine under the latest variance."""
        weight = np.sqrt(self.variance) * self.weight
        if self.threshold is None:
            return Split.held(self.gram, weight, self.name)
        least = max(self.threshold if reported else 0.0, FRAME_THRESHOLD)
        most = None if reported else self.ranks
        thresholds = least, self.threshold
        return Split.of(self.gram, self.frames, weight, thresholds, most, reported)

    def moved(self, x: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Parameters ``x`` (P,) after a step of the scaled active ones."""
        x = x.copy()
        x[self.active] += self.unit * step
        return x

    def balanced(self, first: bool) -> tuple[Split, np.ndarray]:
        """A step, and the residual variance it leaves, which weighs the priors.

        From below: started at the variance of the whole misfit, a tight prior could pass for truth
        and everything it forbids for noise.
        """
        expected, least = self.weight.any(), self.least_variance
        if first and expected:
            self.variance = max(FIRST_VARIANCE * self.cost / self.count, least)
        for _ in range(VARIANCE_STEPS if first else 1):
            split = self.split()
            squared = self.variance * self.weight**2
            step = split.step(self.gram[:-1, -1], self.displacement, squared)
            if not expected:
                break
            to = np.append(step, 1.0)
            variance = float(to @ self.gram @ to) / max(self.count - split.effective, 1.0)
            before, self.variance = self.variance, max(variance, least)
            if abs(self.variance - before) <= FIRST_TOLERANCE * before:
                break
        return split, step

    def run(self) -> Solution:
        """Steps until one is small or the objective stands still."""
        growth = TRUNCATED_GROWTH if self.truncated else COST_RESOLUTION
        patience = PATIENCE if self.truncated else HELD_PATIENCE
        for iteration in range(1, MAX_ITERATIONS + 1):
            settled = self.variance
            split, step = self.balanced(iteration == 1)
            size = float(np.max(np.abs(step), initial=0.0))
            if not np.isfinite(size):
                raise FitError(f"{self.name}: a step is not finite at cost {self.cost:.6g}")
            if iteration > 2:
                self.ranks = split.ranks  # a rank that has been lost is not taken back
            if size <= STEP_TOLERANCE and abs(self.variance - settled) <= 1e-9 * settled:
                to = np.append(step, 1.0)
                self.x, self.cost = self.moved(self.x, step), float(to @ self.gram @ to)
                return self.solution(iteration, size, True)
            before, here = self.objective, self.x
            moves = [step / 2**halving for halving in range(MAX_HALVINGS)]
            moves = moves if self.truncated else [self.accelerated(step), *moves]
            for move in moves:
                after = self.look(self.moved(here, move))
                if after <= before * (1.0 + growth) + LEAST_COST:
                    break
                self.past.clear()
            else:
                after = self.look(here)
            least = max(STANDSTILL * before, NO_CHANGE * self.variance)
            if iteration >= patience and abs(before - after) <= least:
                return self.solution(iteration, size, not self.truncated)
        raise FitError(
            f"{self.name}: not converged after {iteration} iterations; last step {size:.3g} "
            f"mm or mrad (wanted {STEP_TOLERANCE:g}), cost {self.cost:.6g} over {self.count} "
            "residuals"
        )

    def accelerated(self, step: np.ndarray) -> np.ndarray:
        """The step that past ones suggest (Anderson, J. ACM 12, 1965).

        Along directions that data hardly show, Gauss-Newton steps die out slowly.
        """
        self.past.append((self.displacement, step))
        del self.past[:-MEMORY]
        if len(self.past) < 2:
            return step
        moved, changed = (np.diff(part, axis=0).T for part in zip(*self.past, strict=True))
        share = np.linalg.lstsq(changed, step, rcond=1e-8)[0]
        return step - (moved + changed) @ share

    def solution(self, iterations: int, size: float, converged: bool) -> Solution:
        """What the latest normal equations say of the parameters."""
        fitted, reported = self.split(), self.split(reported=True)
        system, frames, active = self.system, self.system.frames, self.active

        def everywhere(part: np.ndarray) -> np.ndarray:
            whole = np.zeros((active.size, part.shape[1]))
            whole[active] = part
            return whole

        freedom, spectrum = self.count - fitted.effective, None
        variance = self.cost / freedom if freedom > 0 else np.nan
        variance = variance if self.truncated else self.variance
        along = variance * np.eye(reported.root.shape[1])
        if self.threshold is not None and fitted.ranks is not None:
            parts = zip(*system.blocks(self.x), strict=True)
            residual, jacobian = (np.concatenate(part) for part in parts)
            jacobian = jacobian[:, active] * self.unit
            values, threshold = _singular_values(jacobian, self.frames), self.threshold
            spectrum = Spectrum(values, threshold, _rank(values, threshold, fitted.ranks[1]))
            if variance > 0.0:
                along = covariance_along(
                    residual, jacobian, shared_errors(system.observations),
                    fitted.root, reported.root, variance,
                )  # fmt: skip
        root = everywhere(self.unit[:, None] * reported.root)
        covariance = root @ along @ root.T
        hidden = np.pad(frames.hidden, ((0, 0), (0, active.size - frames.size)))
        touched = np.sum(hidden**2, axis=0) + np.sum(everywhere(reported.anchor) ** 2, axis=1)
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        std[(touched > TOUCH_SQUARED) | ~active] = np.nan
        return Solution(
            self.x, std, covariance, self.cost, self.count, freedom, variance, iterations, size,
            converged, spectrum, np.concatenate([everywhere(reported.lost).T, hidden]), self.scale,
        )  # fmt: skip
