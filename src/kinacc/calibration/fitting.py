"""Fit an error model, or base and targets alone, to observations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

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
from kinacc.calibration.solve import TOUCH_SQUARED, Solution, Task, minimise_robust
from kinacc.calibration.system import FlangeModel, PoseSystem, require_enough
from kinacc.calibration.uncertainty import scale_of
from kinacc.geometry import Pose
from kinacc.kinematics.model import ErrorModel, JointState
from kinacc.measurements.folds import configurations

# Of the best-seen motion of base and targets. Axes tilted by a mrad, as those of every arm are,
# show as much of a motion that the described arm does not: each model would follow it another way.
SHOWN = 1e-3
FRAME_PRIOR_UNITS = 10.0  # mm and mrad about the starting frames, where priors hold a model
_PART = 0.1  # of a unit motion that a target must have to be what is held
_SAME = 6  # digits to which parts are equal
MORE_POSES = "measure more poses"
SURPLUS, LEAST_NOISE_MM = (
    2,
    0.03,
)  # with fewer residuals a parameter, noise is taken as this at least


@dataclass(frozen=True)
class ModelFit:
    """A fitted ``model`` and its ``frames``.

    ``std`` (P,) and ``free`` (P,) as the model's parameters, std NaN where undetermined;
    ``prior_std`` (P,), inf without a prior. ``solution`` has the figures of the fit, the frames'
    components (``parameters``) first. ``weights`` of the rows, where the loss had some.
    """

    model: ErrorModel
    frames: Frames
    std: np.ndarray
    free: np.ndarray
    prior_std: np.ndarray
    solution: Solution
    parameters: FrameParameters
    weights: Weights | None = None

    def with_frames(self, frames: Frames) -> ModelFit:
        """The same arm seen through other frames."""
        return replace(self, frames=frames)


@dataclass(frozen=True)
class Unknowns:
    """Free parameters (P,) of a model: how they move it, where they start, and what is known.

    ``nominal``: where they stay without data and what priors expect; ``prior_std``: inf for none;
    ``scale``: displacements that count as much as one mm. ``name`` is that of the fit.
    ``held``: priors hold every parameter, no direction is truncated; ``few``: of fewer residuals
    than parameters, too.
    """

    name: str
    flange: FlangeModel
    start: np.ndarray
    nominal: np.ndarray
    prior_std: np.ndarray
    scale: np.ndarray
    held: bool = False
    few: bool = False
    fix: str = MORE_POSES


@one_thread
def solved(
    observations: Observations,
    unknowns: Unknowns,
    parameters: FrameParameters,
    *,
    rotation_weight_mm_per_rad: float,
    threshold: float = 0.0,
    loss: str = robust.SQUARES,
) -> tuple[Frames, Solution, Weights | None]:
    """Base, targets and ``unknowns`` closest to ``observations``.

    Raises FitError, and InputError where there are fewer residuals than parameters.
    """
    flange, frames = unknowns.flange, parameters
    own = 0 if unknowns.few else flange.size
    few = unknowns.few and observations.components < SURPLUS * (frames.size + flange.size)
    require_enough(observations, frames.size + own, unknowns.name, unknowns.fix)
    frame_std = frames.std
    system = PoseSystem(observations, flange, frames, rotation_weight_mm_per_rad)
    if unknowns.held:
        system = system.weighted(once(observations))
        frame_std = np.where(np.isfinite(frame_std), frame_std, FRAME_PRIOR_UNITS * frames.scale)
    task = Task(
        unknowns.name,
        system,
        np.concatenate([frames.begin, unknowns.start]),
        np.concatenate([frames.mean, unknowns.nominal]),
        np.concatenate([frame_std, unknowns.prior_std]),
        np.concatenate([frames.scale, unknowns.scale]),
        None if unknowns.held else threshold,
        LEAST_NOISE_MM**2 if few else 1e-8,
    )
    solution, weights = minimise_robust(task, loss)
    return frames.frames(solution.x[: frames.size]), solution, weights


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
    threshold: float,
    frames: Frames | None = None,
    start: ErrorModel | None = None,
    std: np.ndarray | None = None,
    scale: np.ndarray | None = None,
    frame_terms: FrameTerms | None = None,
    loss: str = robust.SQUARES,
    held: bool = False,
    name: str = "DH fit",
) -> ModelFit:
    """Model of the ``free`` (P,) or (k, 5) parameters closest to ``observations``.

    Parameters
    ----------
    observations
        Measured points and poses.
    nominal
        Where parameters stay without data, and what priors expect; ``start``: where a fit begins,
        if elsewhere.
    free
        True for parameters that are estimated.
    rotation_weight_mm_per_rad
        Position error that weighs as much as one radian.
    threshold
        Directions of singular value below this share of the largest stay nominal, where no prior
        speaks of them.
    frames
        Base and targets where they are known. None: both are estimated, from a closed form and
        under ``frame_terms``.
    std
        Standard deviations of priors, of the shape of ``free`` in mm and rad, inf for none.
    scale
        Displacements (P,) that count as one mm; by the units of the parameters where not given.
    loss
        See ``robust``.
    held
        Priors hold every parameter and no direction is truncated.

    Raises
    ------
    FitError
        The fit does not converge.
    InputError
        There are fewer residuals than parameters.
    """
    begin = start or nominal
    mask, fixed = free.ravel(), nominal.start
    if scale is None:
        scale = np.array([scale_of(each) for each in nominal.names])
    std = np.full(free.shape, np.inf) if std is None else np.where(free, std, np.inf)
    unknowns = Unknowns(
        name,
        flange_model(nominal, mask),
        begin.start[mask],
        fixed[mask],
        std.ravel()[mask],
        scale[mask],
        held,
        held,
    )
    require_enough(observations, 0 if held else unknowns.flange.size, name, MORE_POSES)
    if frames is None:
        parameters = placed(observations, begin, frame_terms, rotation_weight_mm_per_rad, nominal)
    else:
        parameters = FrameParameters.none(frames)
    found, solution, weights = solved(
        observations,
        unknowns,
        parameters,
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        threshold=threshold,
        loss=loss,
    )
    vector, deviation = fixed.copy(), np.full(fixed.size, np.nan)
    vector[mask] = solution.x[parameters.size :]
    deviation[mask] = solution.std[parameters.size :]
    return ModelFit(
        nominal.with_parameters(vector), found, deviation.reshape(free.shape), free, std, solution,
        parameters, weights,
    )  # fmt: skip


def flange_model(nominal: ErrorModel, free: np.ndarray) -> FlangeModel:
    """The arm as a function of its ``free`` (P,) parameters, the others nominal."""
    fixed = nominal.start

    def model(x: np.ndarray) -> ErrorModel:
        vector = fixed.copy()
        vector[free] = x
        return nominal.with_parameters(vector)

    chosen = np.flatnonzero(free)

    def linearised(x: np.ndarray, at: JointState) -> tuple[Pose, np.ndarray]:
        pose, jacobian = model(x).linearised(at)
        return pose, jacobian.transpose(2, 1, 0)[chosen]

    return FlangeModel(int(free.sum()), lambda x, at: model(x).pose(at), linearised)


@one_thread
def fit_frames(
    observations: Observations,
    model: ErrorModel,
    *,
    rotation_weight_mm_per_rad: float,
    frame_terms: FrameTerms | None = None,
) -> Frames:
    """Base and targets of ``observations``, the arm held at ``model``. Raises FitError."""
    nothing, held = np.zeros(0), FlangeModel(0, lambda x, at: model.pose(at))
    unknowns = Unknowns("fit of base and tool", held, *[nothing] * 4)
    parameters = placed(observations, model, frame_terms, rotation_weight_mm_per_rad)
    return solved(
        observations, unknowns, parameters, rotation_weight_mm_per_rad=rotation_weight_mm_per_rad
    )[0]


def placed(
    observations: Observations,
    arm: ErrorModel,
    terms: FrameTerms | None,
    rotation_weight_mm_per_rad: float,
    described: ErrorModel | None = None,
    start: Frames | None = None,
) -> FrameParameters:
    """Parameters of base and targets under ``terms``, from ``start`` or a closed form for ``arm``.

    Motions that poses of the arm as ``described`` (``arm`` where not given) show less than
    ``SHOWN`` of the best-seen one, and no prior speaks of, are held: as many places of targets as
    there are such motions stay where they are stated, and the others follow; where no target takes
    part, the base stays. So all models of the same poses hold the same.
    """
    if start is None:
        start = closed_form_start(observations, arm.pose(observations.at))
        if terms is not None:
            measured = orientations_measured(observations)[:, None, None]
            turned = np.where(measured, start.targets.rotation, terms.stated.targets.rotation)
            start = replace(start, targets=Pose(turned, start.targets.position_mm))
    described = described or arm
    found = FrameParameters.of(observations, start, terms)
    nothing = FlangeModel(0, lambda x, at: described.pose(at))
    system = PoseSystem(observations, nothing, found, rotation_weight_mm_per_rad)
    keep = np.flatnonzero(found.free)
    gram = system.normal(found.begin)[0, :-1, :-1] * np.outer(found.scale, found.scale)
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
        stated = dict(zip(terms.names, terms.value, strict=True))
        for index in held:
            if not of_base[index] and not found.angle[index]:
                begin[index] = stated[found.names[index]]
    motions = np.zeros((len(hidden), found.size))
    motions[:, keep] = hidden
    return replace(found, free=free, begin=begin, hidden=motions)


def _without_known(hidden: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Mixtures of directions ``hidden`` (m, F) that no prior on components ``known`` speaks of."""
    if not len(hidden) or not known.any():
        return hidden
    _, values, turn = np.linalg.svd(hidden[:, known].T)
    return turn[int(np.sum(values**2 > TOUCH_SQUARED)) :] @ hidden


def _pivots(motions: np.ndarray, preferred: np.ndarray) -> list[int]:
    """A component for each of ``motions`` (m, F) that stops it, ``preferred`` (F,) where it can.

    Ties go to the first, so that models of the same poses hold the same.
    """
    rest, chosen = motions, []
    while len(rest):
        part = np.round(np.linalg.norm(rest, axis=0), _SAME)
        first = np.where(preferred, part, 0.0)
        chosen.append(int(np.argmax(first if first.max(initial=0.0) > _PART else part)))
        # The mixtures of what is left that do not move what has been chosen.
        rest = np.linalg.qr(rest[:, chosen[-1:]], mode="complete")[0][:, 1:].T @ rest
    return chosen
