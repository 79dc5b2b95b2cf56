"""Fit an error model, or base and targets alone, to observations: residuals, Jacobian and fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy

from kinacc.calibration.frames import (
    FrameParameters,
    Frames,
    closed_form_start,
    frame_terms,
    left_jacobians,
    places,
)
from kinacc.calibration.least_squares import (
    SQUARES,
    Descent,
    Solution,
    Weights,
    minimise_robust,
    one_thread,
)
from kinacc.calibration.observations import Observations
from kinacc.calibration.uncertainty import TOUCH_SQUARED, scale_of
from kinacc.errors import input_error
from kinacc.geometry import Pose, inverse_transposed, log_so3, skew
from kinacc.kinematics.model import ErrorModel
from kinacc.measurements.folds import configurations

BLOCK_ROWS = 1024


@dataclass(frozen=True)
class PoseSystem:
    """Residuals model minus measurement in the robot base, in mm.

    Per observation three position residuals and, where an orientation was measured, three of the
    rotation vector log(R_model R_measured'), times the rotation weight.

    Attributes
    ----------
    observations : Observations
        n measured points or poses.
    model : ErrorModel
        The arm; parameters that are not free stay as they are in it.
    free : numpy.ndarray
        True for the parameters of the model that are estimated, shape (P,).
    frames : FrameParameters
        F components of base and targets. Vectors of this system have these first, then the free
        parameters of the model.
    rotation_weight_mm_per_rad : float
        Position error that weighs as much as one radian.
    root : numpy.ndarray or None
        Factors of the residuals of every observation, shape (n,); None for ones.
    """

    observations: Observations
    model: ErrorModel
    free: np.ndarray
    frames: FrameParameters
    rotation_weight_mm_per_rad: float
    root: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of estimated parameters."""
        return self.frames.size + int(self.free.sum())

    @property
    def weight(self) -> float:
        """Number of residuals, each times its squared factor."""
        squared = 1.0 if self.root is None else self.root**2
        return float(np.sum(squared * (3 + 3 * self.observations.has_rotation)))

    def residual(self, x: np.ndarray) -> np.ndarray:
        """All residuals (m,), observation by observation."""
        known = FrameParameters.none(self.frames.frames(x[: self.frames.size]))
        still = np.zeros_like(self.free)
        system = replace(self, model=self.arm(x), free=still, frames=known)
        return np.concatenate([residual for residual, _ in system.blocks(x[:0])])

    def blocks(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Residual (m,) and Jacobian (m, P) per block of observations, ordered as ``residual``."""
        for columns, measured in self.columns(x):
            rows = columns.transpose(2, 1, 0)[measured.T]
            yield rows[:, -1], rows[:, :-1]

    def normal(self, x: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """Normal equations (P+1, P+1) in units of ``scale`` (P,): Gram matrix of ``[J | r]``."""
        unit, total = np.append(scale, 1.0), np.zeros((self.size + 1, self.size + 1))
        for columns, _ in self.columns(x):
            flat = columns.reshape(self.size + 1, -1)
            total += flat @ flat.T
        return total * np.outer(unit, unit)

    def columns(self, x: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Weighted ``[J | r]`` (P+1, c, n) per block, 0 where nothing was measured; a mask (c, n).

        c = 3, or 6 in a block with orientations.
        """
        size, model = self.frames.size, self.arm(x)
        frames = self.frames.frames(x[:size])
        root = np.ones(len(self.observations)) if self.root is None else self.root
        for begin in range(0, len(root), BLOCK_ROWS):
            rows = slice(begin, begin + BLOCK_ROWS)
            part = self.observations.select(rows)
            if self.free.any():
                flange, motions, of, factors = model.motions(part.at)
            else:
                flange, motions = model.pose(part.at), np.zeros((0, 6, len(part)))
            view = _View.of(part, flange, frames, self.rotation_weight_mm_per_rad)
            lifted = view.lifted(motions)
            columns = np.zeros((self.size + 1, *view.residual.shape))
            columns[-1] = view.residual
            for place, parameter in enumerate(np.flatnonzero(self.free), size):
                factor = 1.0 if factors is None else factors[parameter]
                np.multiply(lifted[of[parameter]], factor, out=columns[place])
            for kind, number, at in self.frames.slots:
                of_base = kind == "session"
                here = np.flatnonzero(getattr(part, kind) == number)
                ahead = (view.back if of_base else flange.rotation)[here]
                slopes = np.zeros((len(here), len(view.residual), len(at)))
                slopes[:, :3, :3] = ahead
                turn = left_jacobians(x[at[3:]]) if len(at) == 6 else None
                if turn is not None and of_base:
                    slopes[:, :3, 3:] = -ahead @ skew(view.reach[here]) @ turn
                if turn is not None and view.turning is not None:
                    # The measured side stands behind exp(r): L^-1 exp(r) is L^-1 transposed.
                    spin = view.turning[here]
                    spin = np.swapaxes(spin, 1, 2) if of_base else spin
                    slopes[:, 3:, 3:] = spin @ (ahead @ turn)
                columns[at[0] : at[-1] + 1, :, here] = slopes.transpose(2, 1, 0)
            columns *= root[rows] * view.measured
            yield columns, view.measured

    def arm(self, x: np.ndarray) -> ErrorModel:
        """The model with the parameters of ``x`` (P,)."""
        vector = self.model.start.copy()
        vector[self.free] = x[self.frames.size :]
        return self.model.with_parameters(vector)


class _View(NamedTuple):
    """Residuals (c, n) of a block, whether measured (c, n), and what their derivatives are made of.

    ``arm`` (3, n): from the flange to the target, robot base. ``turning`` (n, 3, 3): derivative of
    rotation residuals by turns in the robot base. ``back`` (n, 3, 3): from the instrument to the
    robot base; ``reach`` (n, 3): from the base to the measured point, in the instrument's frame.
    """

    residual: np.ndarray
    measured: np.ndarray
    arm: np.ndarray
    turning: np.ndarray | None
    back: np.ndarray
    reach: np.ndarray

    @classmethod
    def of(cls, part: Observations, flange: Pose, frames: Frames, weight: float) -> _View:
        """Observations beside what an arm and its frames predict."""
        back = np.swapaxes(frames.bases.rotation, 1, 2)[part.session]
        reach = part.position_mm - frames.bases.position_mm[part.session]
        arm = (flange.rotation @ frames.targets.position_mm[part.target][..., None])[..., 0]
        residual = (flange.position_mm + arm - (back @ reach[..., None])[..., 0]).T
        turned, turning = part.has_rotation, None
        if turned.any():
            model = flange.rotation @ frames.targets.rotation[part.target]
            measured = back @ np.where(turned[:, None, None], part.rotation, np.eye(3))
            angles = log_so3(model @ np.swapaxes(measured, 1, 2)) * turned[:, None]
            residual = np.concatenate([residual, weight * angles.T])
            transposed = left_jacobians(angles).transpose(2, 1, 0)
            turning = weight * inverse_transposed(transposed).transpose(2, 0, 1)
        there = np.repeat(np.stack([np.ones_like(turned), turned]), 3, axis=0)
        return cls(residual, there[: len(residual)], arm.T, turning, back, reach)

    def lifted(self, motions: np.ndarray) -> np.ndarray:
        """Derivatives (E, c, n) of the residuals by motions (E, 6, n) of the flange."""
        lifted, turns = np.empty((len(motions), *self.residual.shape)), motions[:, 3:]
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            # A turn w of the flange swings the target: w x arm.
            lifted[:, i] = motions[:, i] + turns[:, j] * self.arm[k] - turns[:, k] * self.arm[j]
            if self.turning is not None:
                lifted[:, 3 + i] = np.einsum("nj,ejn->en", self.turning[:, i], turns)
        return lifted


# Of the best-seen motion of base and targets. Axes tilted by a mrad, as those of every arm are,
# show as much of a motion that the described arm does not: each model would follow it another way.
SHOWN = 1e-3
FRAME_PRIOR_UNITS = 10.0  # mm and mrad about the starting frames, where priors hold a model
_PREFERRED = 10.0  # times the part of a motion that others have, to be what is held
_TIE = 1e-6  # parts that are equal to this share
# With fewer residuals a parameter than the first, noise is at least the second.
SURPLUS, LEAST_NOISE_MM = 2, 0.03


@dataclass(frozen=True)
class Fit:
    """A model with the base and targets it was fitted with.

    Attributes
    ----------
    model : ErrorModel
        The arm.
    frames : Frames
        Base in the instrument's frame, targets in the flange frame, mm.
    """

    model: ErrorModel
    frames: Frames


@dataclass(frozen=True)
class ModelFit(Fit):
    """A fitted model of P parameters, base and targets, and how it was fitted.

    Attributes
    ----------
    free : numpy.ndarray
        Parameters that were estimated, shape (P,) or (k, 5).
    prior_std : numpy.ndarray
        Of the shape of ``free``, inf without a prior.
    solution : Solution
        Figures of the fit, the components of the frames first.
    parameters : FrameParameters
        Those components.
    weights : Weights or None
        Of the rows, where the loss had some.
    """

    free: np.ndarray
    prior_std: np.ndarray
    solution: Solution
    parameters: FrameParameters
    weights: Weights | None = None

    @property
    def std(self) -> np.ndarray:
        """Standard deviations in the parameters' units, shaped as ``free``; NaN: undetermined."""
        std = np.full(self.free.shape, np.nan)
        std[self.free] = self.solution.std[self.parameters.size :]
        return std


def once(observations: Observations) -> np.ndarray:
    """Factors (n,) of residuals by which a configuration counts once, however often it was read.

    What a model cannot explain is common to all readings of a configuration and target: beside a
    prior they are one.
    """
    _, group, count = _groups(observations)
    return 1.0 / np.sqrt(count[group.ravel()])


def distinct(observations: Observations) -> Observations:
    """One reading of every configuration and target: another of the same tells nothing new."""
    return observations.select(_groups(observations)[0])


def _groups(observations: Observations) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First rows (g,) of configurations and targets, the group (n,) of rows, and sizes (g,)."""
    same = configurations(observations.pose, observations.q_rad)
    both = np.stack([same, observations.target])
    return np.unique(both, axis=1, return_index=True, return_inverse=True, return_counts=True)[1:]


@one_thread
def fit(
    observations: Observations,
    nominal: ErrorModel,
    *,
    free: np.ndarray,
    rotation_weight_mm_per_rad: float,
    threshold: float = 0.0,
    frames: FrameParameters | None = None,
    begin: Frames | None = None,
    std: np.ndarray | None = None,
    scale: np.ndarray | None = None,
    loss: str = SQUARES,
    held: bool = False,
    few: bool | None = None,
    name: str = "DH fit",
) -> ModelFit:
    """Fit the free parameters of a model, and base and targets, to observations.

    Parameters
    ----------
    observations : Observations
        Measured points and poses.
    nominal : ErrorModel
        The arm with P parameters where a fit starts, where parameters stay without data, and what
        priors expect.
    free : numpy.ndarray
        True for parameters that are estimated, shape (P,) or (k, 5).
    rotation_weight_mm_per_rad : float
        Position error that weighs as much as one radian.
    threshold : float
        Directions of singular value below this share of the largest stay nominal, where no prior
        holds them.
    frames : FrameParameters, optional
        Base and targets: without components where they are known; all free if not given.
    begin : Frames, optional
        Where they start; by a closed form if not given.
    std : numpy.ndarray, optional
        Standard deviations of priors, of the shape of ``free`` in mm and rad, inf for none.
    scale : numpy.ndarray, optional
        Displacements that count as one mm, shape (P,); by the names of the parameters if not given.
    loss : str
        One of the losses squares, huber, tukey.
    held : bool
        Priors hold every parameter and no direction is truncated.
    few : bool, optional
        Fewer residuals than parameters are enough; as ``held`` if not given.
    name : str
        The fit in messages.

    Returns
    -------
    ModelFit
        The model, its frames, and the figures of the fit.

    Raises
    ------
    FitError
        The fit does not converge.
    InputError
        There are fewer residuals than parameters.
    """
    weight, mask = rotation_weight_mm_per_rad, free.ravel()
    std = np.full(free.shape, np.inf) if std is None else np.where(free, std, np.inf)
    scale = scales(nominal) if scale is None else scale
    few = held if few is None else few
    estimated = frames is None or frames.size > 0
    needed = len(places(observations)[0]) if estimated else 0
    needed += 0 if few else int(mask.sum())
    if observations.components < max(needed, 1):
        what = (
            f"{observations.components} residual components of {len(observations)} training rows "
            f"for the {needed} free parameters of the {name}"
        )
        allowed = "at least as many components as parameters"
        raise input_error("measurements", what, allowed, "measure more poses")
    parameters = placed(observations, nominal, frames, weight, begin)
    system = PoseSystem(observations, nominal, mask, parameters, weight)
    frame_std, least_variance = parameters.std, 1e-8
    if held:
        system = replace(system, root=once(observations))
        loose = FRAME_PRIOR_UNITS * parameters.scale
        frame_std = np.where(np.isfinite(frame_std), frame_std, loose)
        if few and observations.components < SURPLUS * system.size:
            least_variance = LEAST_NOISE_MM**2
    descent = Descent(
        name,
        system,
        np.concatenate([parameters.begin, nominal.start[mask]]),
        np.concatenate([parameters.mean, nominal.start[mask]]),
        np.concatenate([frame_std, std.ravel()[mask]]),
        np.concatenate([parameters.scale, scale[mask]]),
        None if held else threshold,
        least_variance,
    )
    solution, weights = minimise_robust(descent, loss)
    model, frames_there = system.arm(solution.x), parameters.frames(solution.x[: parameters.size])
    return ModelFit(model, frames_there, free, std, solution, parameters, weights)


def scales(model: ErrorModel) -> np.ndarray:
    """Displacements (P,) of the parameters of a model that count as one mm."""
    return np.array([scale_of(name) for name in model.names])


def fit_frames(
    observations: Observations,
    model: ErrorModel,
    *,
    rotation_weight_mm_per_rad: float,
    frames: FrameParameters | None = None,
) -> Frames:
    """Fit base and targets, the arm held at a model.

    Parameters
    ----------
    observations : Observations
        Measured points and poses.
    model : ErrorModel
        The arm.
    rotation_weight_mm_per_rad : float
        Position error that weighs as much as one radian.
    frames : FrameParameters, optional
        What is known of base and targets.

    Returns
    -------
    Frames
        Base in the instrument's frame, targets in the flange frame, mm.

    Raises
    ------
    FitError
        The fit does not converge.
    InputError
        There are fewer residuals than components.
    """
    return fit(
        observations,
        model,
        free=np.zeros(len(model.start), dtype=bool),
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        frames=frames,
        name="fit of base and tool",
    ).frames


def placed(
    observations: Observations,
    arm: ErrorModel,
    terms: FrameParameters | None,
    rotation_weight_mm_per_rad: float,
    start: Frames | None = None,
) -> FrameParameters:
    """Parameters of base and targets under ``terms``, from ``start`` or a closed form for ``arm``.

    Motions that poses of the arm show less than ``SHOWN`` of the best-seen one, and no prior holds,
    are held: as many places of targets as there are such motions stay where they are stated, and
    the others follow; where no target takes part, the base stays. So all models of the same poses
    hold the same. Terms without components stay as they are.
    """
    if terms is not None and not terms.size:
        return terms
    if start is None:
        start = closed_form_start(observations, arm.pose(observations.at))
        if terms is not None:
            unseen = ~np.isin(np.arange(len(start.poses.position_mm)), terms.places[0][terms.angle])
            start.poses.rotation[unseen] = terms.reference.poses.rotation[unseen]
    terms = frame_terms(observations, start) if terms is None else terms
    coordinates = terms.starting(start)
    still = np.zeros(len(arm.start), dtype=bool)
    system = PoseSystem(observations, arm, still, coordinates, rotation_weight_mm_per_rad)
    keep = np.flatnonzero(coordinates.free)
    gram = system.normal(coordinates.begin, coordinates.scale)[:-1, :-1]
    values, vectors = np.linalg.eigh(gram[np.ix_(keep, keep)])
    hidden = vectors[:, values <= SHOWN**2 * max(values[-1:], default=0.0)].T
    # Mixtures of which no prior speaks.
    _, known, turn = np.linalg.svd(hidden[:, np.isfinite(coordinates.std[keep])].T)
    hidden = turn[int(np.sum(known**2 > TOUCH_SQUARED)) :] @ hidden
    if not len(hidden):
        return coordinates
    of_target = (coordinates.places[0] >= start.sessions) & ~coordinates.angle
    held = keep[_pivots(hidden, of_target[keep])]
    free = coordinates.free.copy()
    free[held] = False
    begin = np.where(of_target & ~free & coordinates.free, terms.begin, coordinates.begin)
    motions = np.zeros((len(hidden), coordinates.size))
    motions[:, keep] = hidden
    return replace(coordinates, free=free, begin=begin, hidden=motions)


def _pivots(motions: np.ndarray, preferred: np.ndarray) -> np.ndarray:
    """A component for each of ``motions`` (m, F) that stops it, ``preferred`` (F,) where it can.

    Ties go to the first, so that models of the same poses hold the same.
    """
    scale = np.where(preferred, _PREFERRED, 1.0) * (1.0 - _TIE * np.arange(len(preferred)))
    return scipy.linalg.qr(motions * scale, mode="r", pivoting=True)[1][: len(motions)]
