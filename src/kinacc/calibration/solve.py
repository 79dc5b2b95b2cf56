"""Least squares on kinematic models: Gauss-Newton under priors, or by truncated SVD.

Normal equations are scaled so that displacements count in mm and mrad. Parameters with a prior lean
on it as much as the residual variance says, which is estimated along. Directions that neither data
nor a prior determine stay nominal: singular values below a share of the largest are left out, first
among base and targets, then among the model's parameters with base and targets projected out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration import robust, variances
from kinacc.calibration.robust import Weights
from kinacc.calibration.split import TOUCH_SQUARED, Spectrum, Split, singular_values
from kinacc.calibration.system import PoseSystem
from kinacc.errors import FitError

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


def minimise_robust(task: Task, loss: str) -> tuple[Solution, Weights | None]:
    """The fit of ``task`` under a ``loss`` and, where that is not squares, the rows' weights.

    A robust loss is minimised by reweighted squares (see ``robust``); ``variance`` is then that of
    its scale. Raises FitError where the passes do not settle.
    """
    solution = _Descent(task).run()
    if loss == robust.SQUARES:
        return solution, None
    weights, observations = None, task.system.observations
    for number in range(MAX_PASSES):
        before = solution.x
        scale = weights.scale_mm if weights and number >= SCALE_PASSES else None
        weights = robust.weights(loss, task.system.residual(before), observations, scale)
        weighted = replace(task, system=task.system.weighted(np.sqrt(weights.row)), start=before)
        solution = _Descent(weighted).run()
        moved = float(np.max(np.abs(solution.x - before) / task.scale, initial=0.0))
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
        f"{task.name}: loss {loss} has not settled after {MAX_PASSES} passes; the last one moved "
        f"a parameter by {moved:.3g} mm or mrad (wanted {SETTLED:g})"
    )


class _Descent:
    """Gauss-Newton steps in the scaled active parameters of a task."""

    def __init__(self, task: Task) -> None:
        self.task, self.x = task, np.array(task.start, dtype=float)
        self.truncated = task.threshold is not None
        free = task.system.frames.free
        self.active = np.append(free, np.ones(task.system.free.sum(), dtype=bool))
        self.frames, self.scale = int(free.sum()), task.scale[self.active]
        with np.errstate(divide="ignore"):
            self.weight = self.scale / task.prior_std[self.active]  # for unit variance
        self.count = float(
            task.system.observations.components if self.truncated else task.system.weight
        )
        self.variance = 0.0
        self.ranks: tuple[int, int] | None = None
        self.past: list[tuple[np.ndarray, np.ndarray]] = []
        self.look(self.x)

    def look(self, x: np.ndarray) -> float:
        """Normal equations at ``x`` and the objective there."""
        keep, unit = np.append(self.active, True), np.append(self.scale, 1.0)
        self.gram = self.task.system.normal(x)[keep][:, keep] * np.outer(unit, unit)
        self.cost = float(self.gram[-1, -1])
        self.displacement = (x - self.task.nominal)[self.active] / self.scale
        return self.objective

    @property
    def objective(self) -> float:
        """Sum of squared residuals, and of displacements beside their priors."""
        return self.cost + self.variance * float(self.weight**2 @ self.displacement**2)

    def split(self, reported: bool = False) -> Split:
        """What the latest normal equations determine under the latest variance."""
        weight = np.sqrt(self.variance) * self.weight
        if self.task.threshold is None:
            return Split.held(self.gram, weight, self.task.name)
        least = max(self.task.threshold if reported else 0.0, FRAME_THRESHOLD)
        expected = weight if self.variance > 0.0 else self.weight * 0.0
        most = None if reported else self.ranks
        thresholds = least, self.task.threshold
        return Split.of(self.gram, self.frames, expected, thresholds, most, reported)

    def balanced(self, first: bool) -> tuple[Split, np.ndarray]:
        """A step, and the residual variance it leaves, which weighs the priors.

        From below: started at the variance of the whole misfit, a tight prior could pass for truth
        and everything it forbids for noise.
        """
        expected, least = self.weight.any(), self.task.least_variance
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
                raise FitError(f"{self.task.name}: a step is not finite at cost {self.cost:.6g}")
            if iteration > 2:
                self.ranks = split.ranks  # a rank that has been lost is not taken back
            if size <= STEP_TOLERANCE and abs(self.variance - settled) <= 1e-9 * settled:
                self.x[self.active] += self.scale * step
                to = np.append(step, 1.0)
                self.cost = float(to @ self.gram @ to)
                return self.solution(iteration, size, True)
            before, here = self.objective, self.x
            moves = [] if self.truncated else [self.accelerated(step)]
            for move in (*moves, *(step / 2**halving for halving in range(MAX_HALVINGS))):
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
            if iteration >= patience and abs(before - after) <= least:
                return self.solution(iteration, size, not self.truncated)
        raise FitError(
            f"{self.task.name}: not converged after {iteration} iterations; last step {size:.3g} "
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
        system, frames, active = self.task.system, self.task.system.frames, self.active
        freedom, spectrum = self.count - fitted.effective, None
        variance = self.cost / freedom if freedom > 0 else np.nan
        variance = variance if self.truncated else self.variance
        along = variance * np.eye(reported.root.shape[1])
        if self.task.threshold is not None and fitted.spectrum is not None:
            parts = zip(*system.blocks(self.x), strict=True)
            residual, jacobian = (np.concatenate(part) for part in parts)
            jacobian = jacobian[:, active] * self.scale
            values = singular_values([jacobian], self.frames)
            spectrum = Spectrum.of(values, self.task.threshold, fitted.spectrum.rank)
            if freedom > 0:
                along = variances.covariance_along(
                    residual, jacobian, variances.shared_errors(system.observations),
                    fitted.root, reported.root, variance,
                )  # fmt: skip
        covariance = np.zeros((active.size, active.size))
        root = self.scale[:, None] * reported.root
        covariance[np.ix_(active, active)] = root @ along @ root.T
        hidden = np.zeros((len(frames.hidden), active.size))
        hidden[:, : frames.size] = frames.hidden
        lost = np.zeros((reported.lost.shape[1], active.size))
        lost[:, active] = reported.lost.T
        touched = np.sum(hidden**2, axis=0)
        touched[active] += np.sum(reported.anchor**2, axis=1)
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        std[(touched > TOUCH_SQUARED) | ~active] = np.nan
        return Solution(
            self.x, std, covariance, self.cost, self.count, freedom, variance, iterations, size,
            converged, spectrum, np.concatenate([lost, hidden]), self.task.scale,
        )  # fmt: skip
