"""VEC coefficients, base and targets under a Gaussian prior; its order and width by evidence.

Errors are small, so poses are linear in the coefficients. Coefficients above order 0 have a
zero-mean Gaussian prior whose width and fall from one order to the next maximise the likelihood of
the data with base, targets, constants and direction offsets integrated out (restricted maximum
likelihood; Harville, J. Am. Stat. Assoc. 72, 1977). The order is the lowest whose evidence comes
near the best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
import scipy
from scipy.linalg import lapack

from kinacc.calibration import fitting
from kinacc.calibration.fitting import ModelFit, PoseSystem, distinct, once, scales
from kinacc.calibration.frames import FrameParameters
from kinacc.calibration.least_squares import one_thread
from kinacc.calibration.observations import Observations
from kinacc.kinematics import vec
from kinacc.kinematics.vec import ERRORS, VECModel


@dataclass(frozen=True)
class Prior:
    """Zero-mean Gaussian prior of a Chebyshev coefficient of order n.

    A smooth error has a falling spectrum: standard deviations at orders 0 and 1, times
    ``decay ** (n - 1)`` above.

    Attributes
    ----------
    delta_mm, eps_rad : float
        Standard deviation at order 1 of a displacement and of a rotation.
    decay : float
        From each order to the next.
    offset_rad : float
        Of a direction offset.
    constant : float or None
        At order 0 where it differs, mm and mrad: what a DH model can express as well.
    """

    delta_mm: float
    eps_rad: float
    decay: float
    offset_rad: float
    constant: float | None = None

    def std(self, model: VECModel) -> np.ndarray:
        """Standard deviations (P,) ordered as the parameters of a VEC model."""
        falling = self.decay ** np.maximum(np.arange(model.order + 1) - 1, 0)
        per_error = np.where(np.arange(len(ERRORS)) < 3, self.delta_mm, self.eps_rad)
        deviation = np.outer(per_error, falling)
        if self.constant is not None:
            deviation[:, 0] = self.constant * np.repeat([1.0, 1e-3], 3)
        offsets = np.full(model.direction_offsets_rad.size, self.offset_rad)
        return np.concatenate([np.tile(deviation.ravel(), model.joints), offsets])


def fit(
    observations: Observations,
    empty: VECModel,
    *,
    prior: Prior,
    few: bool = False,
    **settings: Any,
) -> ModelFit:
    """Fit the coefficients of a VEC model under a prior, and base and targets if not known.

    Direction offsets that no observation shows stay at zero, std NaN; the two of a joint that
    always travelled sum to zero, so that the model at an unknown direction is the mean of both.

    Parameters
    ----------
    observations : Observations
        Measured points and poses.
    empty : VECModel
        The nominal arm with its joint range and order, all errors zero.
    prior : Prior
        Prior of the coefficients.
    few : bool
        Fewer residuals than parameters are enough.
    settings
        ``rotation_weight_mm_per_rad``, ``frames`` and ``begin`` of ``fitting.fit``.

    Raises
    ------
    FitError
        The fit does not converge.
    InputError
        There are fewer residuals than parameters.
    """
    fitted = fitting.fit(
        observations,
        empty,
        free=informed(observations, empty),
        std=prior.std(empty),
        held=True,
        few=few,
        name="VEC fit",
        **settings,
    )
    return _with_centred_offsets(fitted, observations)


def informed(observations: Observations, empty: VECModel) -> np.ndarray:
    """True (P,) for all coefficients but offsets of directions that no observation travels."""
    travelled = (observations.s[:, :, None] == np.array([-1, 1])).any(axis=0)
    return np.concatenate([np.ones(empty.coefficients.size, dtype=bool), travelled.ravel()])


def _with_centred_offsets(fit: ModelFit, observations: Observations) -> ModelFit:
    """The fit with the mean of both offsets of a joint moved into eps_z of order 0.

    A gauge: it changes no pose of a joint whose every observation travels in a known direction.
    Without it the prior splits the constant between both, and a pose at s = 0 loses a part.
    """
    free, frames, solution = fit.free, fit.parameters.size, fit.solution
    offsets = np.arange(free.size)[-2 * observations.joints :].reshape(-1, 2)
    centred = observations.s.all(axis=0) & free[offsets].all(axis=1)
    if not centred.any():
        return fit
    change = np.eye(free.size)
    for joint in np.flatnonzero(centred):
        both = offsets[joint]
        change[fit.model.names.index(f"j{joint + 1}.eps_z.0"), both] += 0.5
        change[both[:, None], both] -= 0.5
    mapping = scipy.linalg.block_diag(np.eye(frames), change[free][:, free])
    covariance = mapping @ solution.covariance @ mapping.T
    solution = replace(
        solution,
        x=mapping @ solution.x,
        covariance=covariance,
        std=np.sqrt(np.maximum(np.diag(covariance), 0.0)),
    )
    model = fit.model.with_parameters(change @ fit.model.start)
    return replace(fit, model=model, solution=solution)


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
_STEPS, _LONGEST, _FLAT = 30, 2.0, 1e-6  # of the search for a prior
_GAIN = 0.005  # of log evidence, that a further step or order must have
_FIRST = 12  # normal equations reach up to this order at first


def highest_order(observations: Observations, joints: int, frames: int) -> int:
    """The highest order with no more parameters than residuals, below 0 where there is none."""
    return (distinct(observations).components - frames) // (6 * joints) - 1


def prior_of(std_mm: float, decay: float, offset_rad: float) -> Prior:
    """The prior of a chosen width and fall."""
    return Prior(std_mm, 1e-3 * std_mm, decay, offset_rad, CONSTANT_STD)


@one_thread
def choose(
    observations: Observations,
    empty: VECModel,
    parameters: FrameParameters,
    rotation_weight_mm_per_rad: float,
    orders: Sequence[int],
    stated: Prior | None = None,
    near: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Choose order and prior of a VEC model of some observations.

    Parameters
    ----------
    observations : Observations
        Measured points and poses.
    empty : VECModel
        The model at any order.
    parameters : FrameParameters
        Base and targets as a fit has them.
    rotation_weight_mm_per_rad : float
        Position error that weighs as much as one radian.
    orders : sequence of int
        Orders to try, rising.
    stated : Prior, optional
        A prior that is not chosen, for which only the order is.
    near : pandas.DataFrame, optional
        The result for nearly the same rows, from whose priors the search starts.

    Returns
    -------
    pandas.DataFrame
        Orders tried: ``order``, ``prior_std_mm``, ``prior_std_mrad`` and ``prior_decay`` that suit
        it best, ``log_evidence``, ``log_evidence_less`` (than the best), ``chosen``, and
        ``start`` (2,), the logs of the width of the prior over the noise and of the decay.
    """
    starts = {} if near is None else near.set_index("order")["start"].to_dict()
    linear = _Linear(observations, empty, parameters, rotation_weight_mm_per_rad)
    rows: list[tuple[Any, ...]] = []
    at = np.log([1.0, 0.8])
    for order in orders:
        normal, count = linear.above_constants(order, max(orders))
        degree = np.repeat(np.arange(1, order + 1), linear.motions)
        if stated is None:
            at = starts.get(order, at)
            least, at, noise = _best(normal, count, degree, at)
            prior = prior_of(float(np.exp(at[0])) * noise, float(np.exp(at[1])), 0.0)
        else:
            prior, noise = stated, 0.1
            for _ in range(_STATED_STEPS):
                at = np.log([stated.delta_mm / noise, stated.decay])
                least, _, _, noise = _negative(at, normal, count, degree)
        rows.append((order, prior, -least, at))
        reached = np.array([row[2] for row in rows])
        if len(rows) > PATIENCE + int(np.argmax(reached > reached.max() - _GAIN)):
            break
    return table_of(rows)


def table_of(rows: Sequence[tuple[Any, ...]]) -> pd.DataFrame:
    """The table of ``choose`` from order, prior, log evidence and start of each trial."""
    table = pd.DataFrame(rows, columns=["order", "prior", "log_evidence", "start"])
    table["prior_std_mm"] = [prior.delta_mm for prior in table["prior"]]
    table["prior_decay"] = [prior.decay for prior in table["prior"]]
    table["prior_std_mrad"] = [1e3 * prior.eps_rad for prior in table["prior"]]
    table["log_evidence_less"] = table["log_evidence"] - table["log_evidence"].max()
    table["chosen"] = table.index == int(np.argmax(table["log_evidence_less"] >= -ENOUGH))
    return table


class _Linear:
    """Normal equations of a VEC model about no errors, unknowns sorted by Chebyshev order."""

    def __init__(
        self,
        observations: Observations,
        empty: VECModel,
        parameters: FrameParameters,
        weight: float,
    ) -> None:
        self.observations, self.empty = observations, empty
        self.parameters, self.weight = parameters, weight
        self.motions = 6 * empty.joints
        self.root = once(observations)
        self.built, self.gram = -1, np.zeros((0, 0))
        # A reading that no arm with constant errors comes near bends high orders most.
        for _ in range(_SCREENINGS):
            system, start, scale = self._system(0)
            normal = system.normal(start, scale)
            step = -np.linalg.solve(_steady(normal[:-1, :-1]), normal[:-1, -1])
            to = np.append(scale * step, 1.0)
            parts = [np.tensordot(to, part[:, :3], 1) for part, _ in system.columns(start)]
            squared = np.sum(np.concatenate(parts, axis=1) ** 2, axis=0) / self.root**2
            far = max(FAR**2 * float(np.median(squared)), np.finfo(float).tiny)
            self.root = once(observations) * np.sqrt(far / np.maximum(squared, far))

    def _system(self, order: int) -> tuple[PoseSystem, np.ndarray, np.ndarray]:
        """The system, where it is linearised, and the scale of its columns."""
        empty = vec.without_errors(self.empty.dh, self.empty.q_min_rad, self.empty.q_max_rad, order)
        free, frames = informed(self.observations, empty), self.parameters
        system = PoseSystem(self.observations, empty, free, frames, self.weight, self.root)
        start = np.concatenate([frames.begin, np.zeros(free.sum())])
        return system, start, np.append(frames.scale * frames.free, scales(empty)[free])

    def above_constants(self, order: int, highest: int) -> tuple[np.ndarray, float]:
        """Gram matrix of ``[r | J]`` above order 0 up to ``order``, and the count of residuals.

        Base, targets, constants and offsets are projected out, and taken off the count.
        """
        if order > self.built:
            self.built = min(max(order, _FIRST), highest) if order <= _FIRST else highest
            system, start, scale = self._system(self.built)
            degree = np.zeros(len(scale) + 1)
            series = self.parameters.size + np.arange(self.motions * (self.built + 1))
            degree[series] = np.tile(np.arange(self.built + 1), self.motions)
            degree[-1] = 0.5  # the residual follows what every order has
            place, flat = np.argsort(degree, kind="stable"), int(np.sum(degree == 0.0))
            normal = system.normal(start, scale)[np.ix_(place, place)]
            factor = np.linalg.cholesky(_steady(normal[:flat, :flat]))
            sides = scipy.linalg.solve_triangular(factor, normal[:flat, flat:], lower=True)
            self.gram = normal[flat:, flat:] - sides.T @ sides
            self.count = system.weight - flat
        size = 1 + self.motions * order
        return self.gram[:size, :size], self.count


def _steady(normal: np.ndarray) -> np.ndarray:
    """A normal matrix that is definite where no pose shows a constant."""
    diagonal = np.diag(normal)
    return normal + np.diag(_GAUGE_RIDGE * np.maximum(diagonal, diagonal.mean()))


def _best(
    normal: np.ndarray, count: float, degree: np.ndarray, start: np.ndarray
) -> tuple[float, np.ndarray, float]:
    """Least negative log evidence, logs of width over noise and of fall there, and the noise.

    By Newton steps within bounds; where the evidence is not concave, as if it were.
    """
    low, high = np.log([WIDTHS, FALLS]).T
    at, step, least, noise = start, np.zeros(2), np.inf, np.nan
    for _ in range(_STEPS):
        value, slopes, curvature, deviation = _negative(at + step, normal, count, degree)
        if value > least + _GAIN:
            step = step / 4.0
            continue
        at, least, noise = at + step, value, deviation
        (of_width, mixed), (_, of_fall) = curvature
        of_width = max(abs(of_width), _FLAT)
        fall = mixed / of_width * slopes[0] - slopes[1]
        fall /= max(abs(of_fall - mixed**2 / of_width), _FLAT)
        fall = np.clip(at[1] + fall, low[1], high[1]) - at[1]
        step = np.array([-(slopes[0] + mixed * fall) / of_width, fall])
        step *= min(1.0, _LONGEST / max(np.abs(step).max(), _FLAT))
        step[0] = np.clip(at[0] + step[0], low[0], high[0]) - at[0]
        gain = -slopes @ step
        if gain < _GAIN:
            break
    return float(least - gain / 2.0), at + step, noise


def _negative(
    at: np.ndarray, normal: np.ndarray, count: float, degree: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray, float]:
    """Negative log evidence, slopes (2,), curvature (2, 2), and the noise profiled out.

    ``at``: logs of the width of the prior over the noise, and of the fall. With scaled J'J = M and
    J'r = g, B = (1 + M)^-1: 2 E = count log(r'r - g'B g) - log det B. By the log of each standard
    deviation, dB = -B D (1 - B) - (1 - B) D B and d(B g) = 2 B D B g - D B g.
    """
    change = np.stack([np.ones(len(degree)), degree - 1.0])
    std = np.exp(at @ change)
    gradient = std * normal[0, 1:]
    matrix = normal[1:, 1:] * std
    matrix *= std[:, None]
    matrix[np.diag_indices_from(matrix)] += 1.0
    factor, _ = lapack.dpotrf(matrix.T, overwrite_a=1)
    step = lapack.dpotrs(factor, gradient)[0]
    misfit = max(normal[0, 0] - gradient @ step, np.finfo(float).tiny)
    value = 0.5 * count * np.log(misfit) + np.sum(np.log(np.diag(factor)))
    inverse, _ = lapack.dpotri(factor, overwrite_c=1)
    diagonal, ratio = np.diag(inverse).copy(), count / misfit
    inverse += np.triu(inverse, 1).T
    squares, moved = change @ step**2, change * step
    slopes = change @ (1.0 - diagonal) - ratio * squares
    curvature = (change * (diagonal + ratio * step**2)) @ change.T
    curvature -= 2.0 * ratio * moved @ inverse @ moved.T
    curvature -= change @ inverse**2 @ change.T + ratio / misfit * np.outer(squares, squares)
    return float(value), slopes, 2.0 * curvature, np.sqrt(misfit / count)
