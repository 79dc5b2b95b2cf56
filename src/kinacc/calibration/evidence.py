"""Order and prior of a VEC model by the evidence of the rows a fit may see.

Errors are small, so poses are linear in the coefficients. Coefficients above order 0 have a
zero-mean Gaussian prior whose width and fall from one order to the next maximise the likelihood of
the data with base, targets, constants and direction offsets integrated out (restricted maximum
likelihood; Harville, J. Am. Stat. Assoc. 72, 1977). The order is the lowest whose evidence comes
near the best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from kinacc.calibration.fitting import distinct, once, scales
from kinacc.calibration.frames import FrameParameters
from kinacc.calibration.observations import Observations
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.system import PoseSystem
from kinacc.calibration.vec_fit import Prior, informed
from kinacc.kinematics import vec
from kinacc.kinematics.vec import VECModel

ORDERS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 28, 40)
USUAL_STD = 0.1  # mm and mrad
CONSTANT_STD = 3.0  # mm and mrad, of order 0 beside a chosen prior: all but free
ENOUGH = 2.0  # log evidence below the best that a lower order may have
PATIENCE = 2  # orders without a gain after which no higher one is tried
FALLS = (0.3, 1.0)  # from each order to the next, least and most
WIDTHS = (1e-4, 1e4)  # of the prior over the noise, mm and mrad
FAR = 4.0  # medians of the error; a reading farther off than that counts less
_SCREENINGS = 3
_STATED_STEPS = 6  # until the noise under a stated prior has settled
_GAUGE_RIDGE = 1e-9  # holds constants no pose shows, as a share of those it does
_FIRST = 12  # normal equations reach up to this order at first


@dataclass(frozen=True)
class Trial:
    """Log evidence of an ``order`` under the ``prior`` that suits it best.

    ``log_ratio``: log of the width of the prior over the noise.
    """

    order: int
    prior: Prior
    log_evidence: float
    log_ratio: float


@dataclass(frozen=True)
class Choice:
    """Trials by rising order and the one ``chosen``, with nothing seen of fold ``held_out``."""

    held_out: int | None
    trials: tuple[Trial, ...]
    chosen: Trial


def highest_order(observations: Observations, joints: int, frames: int) -> int:
    """The highest order with no more parameters than residuals, below 0 where there is none."""
    return (distinct(observations).components - frames) // (6 * joints) - 1


def prior_of(std_mm: float, decay: float, offset_rad: float) -> Prior:
    """The prior of a chosen width and fall."""
    constant = CONSTANT_STD, 1e-3 * CONSTANT_STD
    return Prior(std_mm, 1e-3 * std_mm, decay, offset_rad, *constant)


def without_evidence(order: int, offset_rad: float, held_out: int | None) -> Choice:
    """The choice of too few residuals to judge by: a prior of usual width."""
    only = Trial(order, prior_of(USUAL_STD, 1.0, offset_rad), np.nan, 0.0)
    return Choice(held_out, (only,), only)


@one_thread
def choose(
    observations: Observations,
    empty: VECModel,
    parameters: FrameParameters,
    rotation_weight_mm_per_rad: float,
    orders: Sequence[int],
    offset_rad: float,
    stated: Prior | None = None,
    held_out: int | None = None,
    near: Choice | None = None,
) -> Choice:
    """The order, of ``orders``, and the prior of a VEC model of ``observations``.

    ``empty``: the model at any order. ``parameters`` of base and targets as a fit has them.
    ``stated``: a prior that is not chosen, for which only the order is. ``near``: a choice of
    nearly the same rows, from whose priors the search starts.
    """
    begin = {each.order: each for each in near.trials} if near else {}
    system = _Linear(observations, empty, parameters, rotation_weight_mm_per_rad)
    trials: list[Trial] = []
    at = np.array([0.0, 0.8])
    for order in orders:
        normal, count = system.bent(order, max(orders))
        degree = np.repeat(np.arange(1, order + 1), system.motions)
        if stated is None:
            if order in begin:
                at = np.array([begin[order].log_ratio, begin[order].prior.decay])
            least, at, noise = _best(normal, count, degree, at)
            prior = prior_of(float(np.exp(at[0])) * noise, float(at[1]), offset_rad)
        else:
            prior, noise = stated, 0.1
            for _ in range(_STATED_STEPS):
                at = np.array([np.log(stated.delta_mm / noise), stated.decay])
                least, _, noise = _negative(at, normal, count, degree)
        trials.append(Trial(order, prior, -least, float(at[0])))
        best = max(range(len(trials)), key=lambda i: trials[i].log_evidence)
        if len(trials) - 1 - best >= PATIENCE and len(orders) > 1:
            break
    top = trials[best].log_evidence
    chosen = next(each for each in trials if each.log_evidence >= top - ENOUGH)
    return Choice(held_out, tuple(trials), chosen)


class _Linear:
    """Normal equations of a VEC model about no errors, unknowns sorted by Chebyshev order."""

    def __init__(self, observations, empty, parameters, weight) -> None:
        self.observations, self.empty = observations, empty
        self.parameters, self.weight = parameters, weight
        self.motions = 6 * empty.joints
        self.root = once(observations)
        self.built, self.gram = -1, np.zeros((0, 0))
        # A reading that no arm with constant errors comes near bends high orders most.
        for _ in range(_SCREENINGS):
            system, scale, flat = self._system(0)
            normal = system.normal(self._start(system))[0] * np.outer(scale, scale)
            own = normal[:flat, :flat]
            ridge = _GAUGE_RIDGE * np.maximum(np.diag(own), own.trace() / flat)
            step = -np.linalg.solve(own + np.diag(ridge), normal[:flat, -1])
            squared = self._misfit(system, scale[:-1] * step)
            far = max(FAR**2 * float(np.median(squared)), np.finfo(float).tiny)
            self.root = once(observations) * np.sqrt(far / np.maximum(squared, far))

    def _system(self, order: int) -> tuple[PoseSystem, np.ndarray, int]:
        empty = vec.without_errors(self.empty.dh, self.empty.q_min_rad, self.empty.q_max_rad, order)
        free = informed(self.observations, empty)
        system = PoseSystem(self.observations, empty, free, self.parameters, self.weight, self.root)
        scale = np.concatenate([self.parameters.scale, scales(empty)[free], [1.0]])
        scale[: self.parameters.size] *= self.parameters.free
        return system, scale, len(scale) - 1 - self.motions * order

    def _start(self, system: PoseSystem) -> np.ndarray:
        return np.concatenate([self.parameters.begin, np.zeros(system.free.sum())])

    def _misfit(self, system: PoseSystem, step: np.ndarray) -> np.ndarray:
        """Squared position errors (n,) of a step, by the linear model, rows unweighted."""
        plain = system.weighted(np.ones(len(self.observations)))
        found = [
            np.concatenate([residual, np.zeros(0)]) + jacobian @ step
            for residual, jacobian in plain.blocks(self._start(plain))
        ]
        row = np.repeat(np.arange(len(self.observations)), 3 + 3 * self.observations.has_rotation)
        position = ~self.observations.is_rotation
        squared = np.concatenate(found) ** 2
        return np.bincount(row[position], squared[position], minlength=len(self.observations))

    def bent(self, order: int, highest: int) -> tuple[np.ndarray, float]:
        """Gram matrix of ``[r | J]`` above order 0 up to ``order``, and the count of residuals.

        Base, targets, constants and offsets are projected out, and taken off the count.
        """
        if order > self.built:
            self.built = min(max(order, _FIRST), highest) if order <= _FIRST else highest
            system, scale, flat = self._system(self.built)
            normal = system.normal(self._start(system))[0] * np.outer(scale, scale)
            frames, terms = self.parameters.size, self.built + 1
            degree = np.zeros(len(scale))
            bent = slice(frames, frames + self.motions * terms)
            degree[bent] = np.tile(np.arange(terms), self.motions)
            degree[-1] = 0.5  # the residual follows what every order has
            place = np.argsort(degree, kind="stable")
            normal = normal[np.ix_(place, place)]
            own = normal[:flat, :flat]
            ridge = _GAUGE_RIDGE * np.maximum(np.diag(own), own.trace() / flat)
            factor = np.linalg.cholesky(own + np.diag(ridge))
            sides = scipy.linalg.solve_triangular(factor, normal[:flat, flat:], lower=True)
            self.gram = normal[flat:, flat:] - sides.T @ sides
            self.flat = flat
        size = 1 + self.motions * order
        return self.gram[:size, :size], self._system(0)[0].weight - self.flat


def _best(
    normal: np.ndarray, count: float, degree: np.ndarray, start: np.ndarray
) -> tuple[float, np.ndarray, float]:
    """Least negative log evidence, log of width over noise and fall there, and the noise."""
    bounds = [tuple(np.log(WIDTHS)), FALLS]
    if degree[-1] == 1:
        bounds[1] = (start[1], start[1])  # nothing falls
    noise: dict[bytes, float] = {}

    def value(at: np.ndarray) -> tuple[float, np.ndarray]:
        least, slopes, noise[at.tobytes()] = _negative(at, normal, count, degree)
        return least, slopes

    found = scipy.optimize.minimize(
        value, start, jac=True, method="L-BFGS-B", bounds=bounds,
        options={"ftol": 1e-6, "gtol": 1.0, "maxiter": 30},
    )  # fmt: skip
    return float(found.fun), found.x, noise[found.x.tobytes()]


def _negative(
    at: np.ndarray, normal: np.ndarray, count: float, degree: np.ndarray
) -> tuple[float, np.ndarray, float]:
    """Negative log evidence, its slopes, and the residual standard deviation profiled out.

    ``at``: log of the width of the prior over that deviation, and the fall. With scaled J'J = M and
    J'r = g: 2 E = count log(r'r - g'(1 + M)^-1 g) + log det(1 + M).
    """
    std = np.exp(at[0]) * at[1] ** (degree - 1.0)
    gradient = std * normal[0, 1:]
    matrix = normal[1:, 1:] * np.outer(std, std)
    matrix[np.diag_indices_from(matrix)] += 1.0
    factor = scipy.linalg.cholesky(matrix, lower=True, overwrite_a=True, check_finite=False)
    step = scipy.linalg.cho_solve((factor, True), gradient, check_finite=False)
    misfit = max(normal[0, 0] - gradient @ step, np.finfo(float).tiny)
    value = 0.5 * count * np.log(misfit) + np.sum(np.log(np.diag(factor)))
    root, _ = scipy.linalg.lapack.dtrtri(factor, lower=1, overwrite_c=1)
    # What data decide of each coefficient, less its square beside its prior.
    share = 1.0 - np.einsum("ij,ij->j", root, root) - count / misfit * step**2
    slopes = np.array([np.sum(share), np.sum(share * (degree - 1.0)) / at[1]])
    return value, slopes, float(np.sqrt(misfit / count))
