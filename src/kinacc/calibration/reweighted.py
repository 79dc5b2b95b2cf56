"""A truncated fit repeated until its priors and its loss agree with the residuals it leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration import robust, truncated_svd
from kinacc.calibration.held import Kept
from kinacc.calibration.observations import Observations
from kinacc.calibration.robust import Weights
from kinacc.calibration.solve import Solution, System
from kinacc.calibration.truncated_svd import Arrived
from kinacc.errors import FitError

MAX_PASSES = 100
SETTLED = 1e-4  # mm and mrad by which a pass may still move a parameter
SCALE_PASSES = 20  # after these the scale of a loss is held, so that no cycle can form


@dataclass(frozen=True)
class Task:
    """What ``truncated.minimise_truncated`` is asked, with priors by their standard deviation.

    ``prior_std`` (P,) in the parameters' own units about ``nominal``, inf for none.
    ``is_rotation`` (m,) of the residuals where some are of rotations, else None; ``shared``:
    errors that residuals have in common.
    """

    system: System
    start: np.ndarray
    nominal: np.ndarray
    prior_std: np.ndarray
    scale: np.ndarray
    threshold: float
    frames: int
    name: str
    is_rotation: np.ndarray | None = None
    shared: tuple[np.ndarray, ...] = ()

    def keeping(self, keep: np.ndarray) -> Task:
        """The task in the parameters ``keep`` (P,), the others left where they start."""
        return replace(
            self,
            system=Kept(self.system, keep, self.start),
            start=self.start[keep],
            nominal=self.nominal[keep],
            prior_std=self.prior_std[keep],
            scale=self.scale[keep],
            frames=int(keep[: self.frames].sum()),
        )

    def arrived(
        self, start: np.ndarray, variance: float, weights: Weights | None = None
    ) -> Arrived:
        """One pass from ``start`` with residuals of ``variance``."""
        known = np.isfinite(self.prior_std)
        return truncated_svd.arrived(
            self.system if weights is None else self.system.weighted(np.sqrt(weights.row)),
            start,
            self.nominal,
            self.scale,
            self.threshold,
            self.frames,
            self.name,
            np.sqrt(variance) / self.prior_std if known.any() else None,
            self.is_rotation,
        )


def minimise(task: Task, observations: Observations, loss: str) -> tuple[Solution, Weights | None]:
    """The fit of ``task`` and, with another loss than squares, the weights of the rows.

    Squares without a prior take one pass. A prior is weighed by the variance of the residuals,
    which the fit estimates: the first pass leans on no prior, so none can pass for truth before
    the data have spoken. A robust loss is minimised by reweighted squares (see ``robust``);
    ``variance`` is then that of its scale.
    Raises FitError where the passes do not settle.
    """
    found, weights = task.arrived(task.start, 0.0), None
    if loss == robust.SQUARES and np.isinf(task.prior_std).all():
        return found.solution(task.shared), None
    for number in range(MAX_PASSES):
        before = found.x
        if loss != robust.SQUARES:
            scale = weights.scale_mm if weights and number >= SCALE_PASSES else None
            residual = task.system.residual(before)
            weights = robust.weights(loss, residual, observations, scale)
        variance = found.variance if weights is None else weights.scale_mm**2
        if not np.isfinite(variance):
            raise FitError(f"{task.name}: no residuals are left over to weigh a prior by")
        found = task.arrived(before, variance, weights)
        if np.all(np.abs(found.x - before) <= SETTLED * task.scale):
            return _scaled(found.solution(task.shared), weights), weights
    moved = np.max(np.abs(found.x - before) / task.scale)
    raise FitError(
        f"{task.name}: loss {loss} and priors have not settled after {MAX_PASSES} passes; the last "
        f"one moved a parameter by {moved:.3g} mm or mrad (wanted {SETTLED:g})"
    )


def _scaled(solution: Solution, weights: Weights | None) -> Solution:
    """Standard deviations for the residual variance of a robust loss's scale."""
    if weights is None or not solution.variance > 0.0:
        return solution
    factor = weights.scale_mm**2 / solution.variance
    return replace(
        solution,
        variance=weights.scale_mm**2,
        covariance=factor * solution.covariance,
        std=np.sqrt(factor) * solution.std,
    )
