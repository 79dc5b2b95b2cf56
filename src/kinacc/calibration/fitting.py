"""Fit an error model, or base and targets alone, to observations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from kinacc.calibration import robust
from kinacc.calibration.frames import (
    MOTIONS,
    FrameParameters,
    Frames,
    FrameTerms,
    orientations_measured,
)
from kinacc.calibration.hand_eye import closed_form_start
from kinacc.calibration.observations import Observations
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.robust import Weights
from kinacc.calibration.solve import Solution, Task, minimise_robust
from kinacc.calibration.split import TOUCH_SQUARED
from kinacc.calibration.system import PoseSystem, require_enough
from kinacc.calibration.uncertainty import scale_of
from kinacc.geometry import Pose
from kinacc.kinematics.model import ErrorModel
from kinacc.measurements.folds import configurations

# Of the best-seen motion of base and targets. Axes tilted by a mrad, as those of every arm are,
# show as much of a motion that the described arm does not: each model would follow it another way.
SHOWN = 1e-3
FRAME_PRIOR_UNITS = 10.0  # mm and mrad about the starting frames, where priors hold a model
_PREFERRED = 10.0  # times the part of a motion that others have, to be what is held
_TIE = 1e-6  # parts that are equal to this share
MORE_POSES = "measure more poses"
# With fewer residuals a parameter than the first, noise is at least the second.
SURPLUS, LEAST_NOISE_MM = 2, 0.03


@dataclass(frozen=True)
class ModelFit:
    """A fitted model of P parameters, base and targets.

    Attributes
    ----------
    model : ErrorModel
        The model.
    frames : Frames
        Base and targets.
    std : numpy.ndarray
        Standard deviations in the parameters' units, of the shape of ``free``; NaN where
        undetermined.
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

    model: ErrorModel
    frames: Frames
    std: np.ndarray
    free: np.ndarray
    prior_std: np.ndarray
    solution: Solution
    parameters: FrameParameters
    weights: Weights | None = None


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
    frames: Frames | None = None,
    begin: Frames | None = None,
    frame_terms: FrameTerms | None = None,
    std: np.ndarray | None = None,
    scale: np.ndarray | None = None,
    loss: str = robust.SQUARES,
    held: bool = False,
    few: bool | None = None,
    name: str = "DH fit",
    fix: str = MORE_POSES,
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
    frames : Frames, optional
        Base and targets where they are known. Else both are estimated under ``frame_terms``, from
        ``begin`` or a closed form.
    std : numpy.ndarray, optional
        Standard deviations of priors, of the shape of ``free`` in mm and rad, inf for none.
    scale : numpy.ndarray, optional
        Displacements that count as one mm, shape (P,); by the names of the parameters if not given.
    loss : str
        One of ``robust``: squares, huber, tukey.
    held : bool
        Priors hold every parameter and no direction is truncated.
    few : bool, optional
        Fewer residuals than parameters are enough; as ``held`` if not given.
    name, fix : str
        The fit, and what to do where there is too little data, in messages.

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
    few, size = held if few is None else few, int(mask.sum())
    require_enough(observations, 0 if few else size, name, fix)
    parameters = (
        FrameParameters.none(frames)
        if frames is not None
        else placed(observations, nominal, frame_terms, weight, begin)
    )
    place = parameters.size
    require_enough(observations, place + (0 if few else size), name, fix)
    system = PoseSystem(observations, nominal, mask, parameters, weight)
    frame_std, least_variance = parameters.std, 1e-8
    if held:
        system = system.weighted(once(observations))
        loose = FRAME_PRIOR_UNITS * parameters.scale
        frame_std = np.where(np.isfinite(frame_std), frame_std, loose)
        if few and observations.components < SURPLUS * system.size:
            least_variance = LEAST_NOISE_MM**2
    task = Task(
        name,
        system,
        np.concatenate([parameters.begin, nominal.start[mask]]),
        np.concatenate([parameters.mean, nominal.start[mask]]),
        np.concatenate([frame_std, std.ravel()[mask]]),
        np.concatenate([parameters.scale, scale[mask]]),
        None if held else threshold,
        least_variance,
    )
    solution, weights = minimise_robust(task, loss)
    vector, deviation = nominal.start.copy(), np.full(mask.size, np.nan)
    vector[mask], deviation[mask] = solution.x[place:], solution.std[place:]
    return ModelFit(
        nominal.with_parameters(vector), parameters.frames(solution.x[:place]),
        deviation.reshape(free.shape), free, std, solution, parameters, weights,
    )  # fmt: skip


def scales(model: ErrorModel) -> np.ndarray:
    """Displacements (P,) of the parameters of a model that count as one mm."""
    return np.array([scale_of(name) for name in model.names])


def fit_frames(
    observations: Observations,
    model: ErrorModel,
    *,
    rotation_weight_mm_per_rad: float,
    frame_terms: FrameTerms | None = None,
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
    frame_terms : FrameTerms, optional
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
        frame_terms=frame_terms,
        name="fit of base and tool",
    ).frames


def placed(
    observations: Observations,
    arm: ErrorModel,
    terms: FrameTerms | None,
    rotation_weight_mm_per_rad: float,
    start: Frames | None = None,
) -> FrameParameters:
    """Parameters of base and targets under ``terms``, from ``start`` or a closed form for ``arm``.

    Motions that poses of the arm show less than ``SHOWN`` of the best-seen one, and no prior holds,
    are held: as many places of targets as there are such motions stay where they are stated, and
    the others follow; where no target takes part, the base stays. So all models of the same poses
    hold the same.
    """
    if start is None:
        start = closed_form_start(observations, arm.pose(observations.at))
        if terms is not None:
            measured = orientations_measured(observations)[:, None, None]
            turned = np.where(measured, start.targets.rotation, terms.stated.targets.rotation)
            start = replace(start, targets=Pose(turned, start.targets.position_mm))
    found = FrameParameters.of(observations, start, terms)
    still = np.zeros(len(arm.start), dtype=bool)
    system = PoseSystem(observations, arm, still, found, rotation_weight_mm_per_rad)
    keep = np.flatnonzero(found.free)
    gram = system.normal(found.begin)[:-1, :-1] * np.outer(found.scale, found.scale)
    values, vectors = np.linalg.eigh(gram[np.ix_(keep, keep)])
    hidden = vectors[:, values <= SHOWN**2 * max(values[-1:], default=0.0)].T
    hidden = _without_known(hidden, np.isfinite(found.std[keep]))
    if not len(hidden):
        return found
    of_base = np.arange(found.size) < len(MOTIONS) * start.sessions
    held = keep[_pivots(hidden, (~of_base & ~found.angle)[keep])]
    free, begin = found.free.copy(), found.begin.copy()
    free[held] = False
    if terms is not None:
        placed = held[~of_base[held] & ~found.angle[held]]
        begin[placed] = terms.value[placed]
    motions = np.zeros((len(hidden), found.size))
    motions[:, keep] = hidden
    return replace(found, free=free, begin=begin, hidden=motions)


def _without_known(hidden: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Mixtures of directions ``hidden`` (m, F) that no prior on components ``known`` speaks of."""
    if not len(hidden) or not known.any():
        return hidden
    _, values, turn = np.linalg.svd(hidden[:, known].T)
    return turn[int(np.sum(values**2 > TOUCH_SQUARED)) :] @ hidden


def _pivots(motions: np.ndarray, preferred: np.ndarray) -> np.ndarray:
    """A component for each of ``motions`` (m, F) that stops it, ``preferred`` (F,) where it can.

    Ties go to the first, so that models of the same poses hold the same.
    """
    scale = np.where(preferred, _PREFERRED, 1.0) * (1.0 - _TIE * np.arange(len(preferred)))
    return scipy.linalg.qr(motions * scale, mode="r", pivoting=True)[1][: len(motions)]
