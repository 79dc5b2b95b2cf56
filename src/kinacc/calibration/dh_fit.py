"""DH parameters, base and targets fitted to poses, from nominal values and no starting frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration import reweighted, robust, variances
from kinacc.calibration.constrained import ConstrainedFrames, FrameTerms
from kinacc.calibration.constraints import free_parameters  # noqa: F401 (the usual mask of a fit)
from kinacc.calibration.frames import (
    ANGLE_UNIT_RAD,
    FrameCoordinates,
    Frames,
    with_stated_orientations,
)
from kinacc.calibration.hand_eye import closed_form_start
from kinacc.calibration.held import (
    Kept,
    Placed,
    known_frames,
    placed,
    pose_system,
)
from kinacc.calibration.observations import Observations, full_poses
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.robust import Weights
from kinacc.calibration.solve import Solution
from kinacc.calibration.system import FlangeModel, require_enough
from kinacc.calibration.truncated_svd import unseen
from kinacc.geometry import Pose, compose
from kinacc.kinematics import dh
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.model import JointState

DH_FIX = "measure more poses"
UNSEEN_POSES = 60
UNSEEN_WEIGHT = 500.0  # mm per rad; what is null is so by any weight
_ANGLES = np.array([True, False, False, True, True])  # of dh.PARAMETERS


@dataclass(frozen=True)
class DHFit:
    """Fitted ``model`` and ``frames``; ``std`` (k, 5) as ``dh.PARAMETERS``, NaN undetermined.

    ``free`` (k, 5) marks the parameters that took part; ``solution`` has the figures of the fit,
    frame coordinates (``coordinates``) first. ``weights`` of the rows, where the loss had some;
    ``prior_std`` (k, 5) of free parameters, inf without a prior.
    """

    model: DHModel
    frames: Frames
    std: np.ndarray
    free: np.ndarray
    solution: Solution
    coordinates: FrameCoordinates | ConstrainedFrames
    weights: Weights | None = None
    prior_std: np.ndarray | None = None

    def with_frames(self, frames: Frames) -> DHFit:
        """The same arm seen through other frames."""
        return replace(self, frames=frames)


def fit(
    observations: Observations,
    nominal: DHModel,
    *,
    free: np.ndarray,
    rotation_weight_mm_per_rad: float,
    threshold: float,
    frames: Frames | None = None,
    start: DHModel | None = None,
    std: np.ndarray | None = None,
    frame_terms: FrameTerms | None = None,
    loss: str = robust.SQUARES,
) -> DHFit:
    """DH model of the ``free`` (k, 5) parameters closest to ``observations``.

    ``frames`` given: base and targets are known. None: both are estimated, from a closed form and
    under ``frame_terms``. ``std`` (k, 5): of priors about ``nominal``, inf for none.
    Directions of singular value below ``threshold`` times the largest stay nominal, where no prior
    speaks of them. ``loss``: see ``robust``.
    Raises FitError, and InputError where there are fewer residuals than parameters.
    """
    start = start or nominal
    held = dh.to_vector(nominal)
    mask = free.ravel()
    unknowns = Unknowns(
        "DH fit",
        flange_model(nominal, free),
        start=dh.to_vector(start)[mask],
        nominal=held[mask],
        prior_std=np.full(mask.sum(), np.inf) if std is None else std.ravel()[mask],
        scale=scales(free),
    )
    coords, solution, weights = solved(
        observations,
        unknowns,
        start,
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        threshold=threshold,
        frames=frames,
        frame_terms=frame_terms,
        loss=loss,
    )
    vector, found = held.copy(), np.full(held.size, np.nan)
    vector[mask] = solution.x[coords.size :]
    found[mask] = solution.std[coords.size :]
    return DHFit(
        model=dh.with_vector(nominal, vector),
        frames=coords.frames(solution.x[: coords.size]),
        std=found.reshape(free.shape),
        free=free,
        solution=solution,
        coordinates=coords,
        weights=weights,
        prior_std=np.full(free.shape, np.inf) if std is None else np.where(free, std, np.inf),
    )


@dataclass(frozen=True)
class Unknowns:
    """Free parameters (P,) of a model: how they move it, where they start, and what is known.

    ``nominal``: where they stay without data and what priors expect; ``prior_std``: inf for none;
    ``scale``: displacements that count as much as one mm. ``name`` is that of the fit.
    """

    name: str
    flange: FlangeModel
    start: np.ndarray
    nominal: np.ndarray
    prior_std: np.ndarray
    scale: np.ndarray


@one_thread
def solved(
    observations: Observations,
    unknowns: Unknowns,
    start: DHModel,
    *,
    rotation_weight_mm_per_rad: float,
    threshold: float,
    frames: Frames | None,
    frame_terms: FrameTerms | None,
    loss: str,
) -> tuple[FrameCoordinates | ConstrainedFrames, Solution, Weights | None]:
    """Frames and ``unknowns`` closest to ``observations``, as ``fit`` does it.

    Estimated frames start where the arm ``start`` has them.
    """
    name, flange = unknowns.name, unknowns.flange
    require_enough(observations, flange.size, name, DH_FIX)
    at = _placed(observations, unknowns, start, rotation_weight_mm_per_rad, frames, frame_terms)
    coords = at.coordinates
    require_enough(observations, coords.size + flange.size, name, DH_FIX)
    expected, frame_std = at.known
    task = reweighted.Task(
        system=pose_system(observations, flange, coords, rotation_weight_mm_per_rad),
        start=np.concatenate([np.zeros(coords.size), unknowns.start]),
        nominal=np.concatenate([expected, unknowns.nominal]),
        prior_std=np.concatenate([frame_std, unknowns.prior_std]),
        scale=np.concatenate([at.scale, unknowns.scale]),
        threshold=threshold,
        frames=coords.size,
        name=name,
        is_rotation=observations.is_rotation if observations.has_rotation.any() else None,
        shared=variances.shared_errors(observations),
    )
    if not at.held.any():
        return coords, *reweighted.minimise(task, observations, loss)
    keep = np.append(~at.held, np.ones(flange.size, dtype=bool))
    solution, weights = reweighted.minimise(task.keeping(keep), observations, loss)
    kept = Kept(task.system, keep, task.start)
    return coords, kept.solution(solution, at.open, task.scale), weights


def fit_frames(
    observations: Observations,
    model: DHModel,
    *,
    rotation_weight_mm_per_rad: float,
    frames: Frames | None = None,
    frame_terms: FrameTerms | None = None,
) -> DHFit:
    """Base and targets alone (as in ``fit``), the arm held at ``model``. Raises FitError."""
    nothing = np.zeros((model.joints, 5), dtype=bool)
    return fit(
        observations,
        model,
        free=nothing,
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        threshold=0.0,
        frames=frames,
        frame_terms=frame_terms,
    )


def _placed(
    observations: Observations,
    unknowns: Unknowns,
    start: DHModel,
    weight: float,
    frames: Frames | None,
    terms: FrameTerms | None,
) -> Placed:
    if frames is not None:
        return known_frames(observations, frames)
    begin = closed_form_start(observations, dh.forward(start, observations.q_rad))
    if terms is not None:
        begin = with_stated_orientations(begin, terms.stated, observations)
    return placed(
        observations, lambda at: unknowns.flange.pose(unknowns.nominal, at), begin, terms, weight
    )


@one_thread
def unseen_anywhere(fit: DHFit, observations: Observations, threshold: float) -> np.ndarray:
    """Directions (m, P) of a fit's coordinates that no pose shows, whatever the joints.

    ``observations`` say which targets were seen in which sessions, and how. Poses all over the
    joints' turns (prismatic ones: a metre) are put where the model has them: without residuals what
    cannot be seen is null to rounding.
    """
    seen = _everywhere(fit, observations)
    flange = flange_model(fit.model, fit.free)
    system = pose_system(seen, flange, fit.coordinates, UNSEEN_WEIGHT)
    scale = np.concatenate([_units(fit.coordinates.is_angle()), scales(fit.free)])
    return unseen(system, fit.solution.x, scale, fit.coordinates.size, threshold)


def _everywhere(fit: DHFit, observations: Observations) -> Observations:
    """Poses at joints of all kinds, by the model: every kind of row of ``observations`` in each."""
    kinds = np.unique(
        np.stack([observations.session, observations.target, observations.has_rotation], axis=1),
        axis=0,
    )
    q_rad = joints_anywhere(fit.model)
    pose, kind = np.repeat(np.arange(len(q_rad)), len(kinds)), np.tile(kinds.T, len(q_rad))
    session, target, turned = kind
    frames = fit.frames
    at = compose(
        dh.forward(fit.model, q_rad[pose]),
        Pose(frames.targets.rotation[target], frames.targets.position_mm[target]),
    )
    at = compose(Pose(frames.bases.rotation[session], frames.bases.position_mm[session]), at)
    made = full_poses(q_rad[pose], at)
    return replace(
        made,
        rotation=np.where(turned.astype(bool)[:, None, None], at.rotation, np.nan),
        pose=pose,
        target=target,
        session=session,
        target_names=observations.target_names,
        session_names=observations.session_names,
    )


def joints_anywhere(model: DHModel) -> np.ndarray:
    """Joints (n, k) of all kinds, beyond any limits: a whole turn each, or a metre either way."""
    reach = np.where(model.prismatic, 1e3, np.pi)
    return np.random.default_rng(0).uniform(-reach, reach, (UNSEEN_POSES, model.joints))


def flange_model(nominal: DHModel, free: np.ndarray) -> FlangeModel:
    """The DH arm as a function of its ``free`` (k, 5) parameters, the others nominal."""
    held, mask = dh.to_vector(nominal), free.ravel()

    def model(x: np.ndarray) -> DHModel:
        vector = held.copy()
        vector[mask] = x
        return dh.with_vector(nominal, vector)

    def linearised(x: np.ndarray, at: JointState) -> tuple[Pose, np.ndarray]:
        pose, jacobian = dh.pose_and_parameter_jacobian(model(x), at.q_rad)
        return pose, jacobian.reshape(len(at), 6, -1).transpose(2, 1, 0)[chosen]

    chosen = np.flatnonzero(mask)
    return FlangeModel(
        int(mask.sum()),
        lambda x, at: model(x).pose(at),
        linearised,
    )


def scales(free: np.ndarray) -> np.ndarray:
    """Displacements of the ``free`` (k, 5) DH parameters that count as one mm."""
    return _units(np.tile(_ANGLES, len(free))[free.ravel()])


def _units(is_angle: np.ndarray) -> np.ndarray:
    return np.where(is_angle, ANGLE_UNIT_RAD, 1.0)
