"""VEC coefficients, base and targets fitted to poses under a stated Gaussian prior."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration.basis_expansion import Group
from kinacc.calibration.constrained import ConstrainedFrames, FrameTerms
from kinacc.calibration.frames import ANGLE_UNIT_RAD, FrameCoordinates, Frames, coordinates
from kinacc.calibration.held import (
    Kept,
    Placed,
    known_frames,
    placed,
    pose_system,
)
from kinacc.calibration.map_estimate import minimise_with_prior
from kinacc.calibration.observations import Observations
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.solve import Solution, Spectrum, spectrum
from kinacc.calibration.system import FlangeModel, PoseSystem, Pull, require_enough
from kinacc.geometry import Pose
from kinacc.kinematics import vec
from kinacc.kinematics.model import JointState
from kinacc.kinematics.vec import ERRORS, VECModel

VEC_FIX = "measure more poses, or lower calibration.vec.order"
FRAME_PRIOR_UNITS = 10.0  # mm and mrad about the starting frames; holds what no pose shows
RANK_THRESHOLD = 1e-10  # far below every weak direction, far above rounding: exact gauges only


@dataclass(frozen=True)
class Prior:
    """Zero-mean Gaussian prior of a Chebyshev coefficient of order n.

    Standard deviation ``delta_mm`` or ``eps_rad`` at order 0 and 1, times ``decay ** (n - 1)``
    above: a smooth error has a falling spectrum. ``offset_rad`` is that of a direction offset.
    ``constant_mm`` and ``constant_rad`` are those of order 0 where it differs: constants are what
    a DH model can express as well.
    """

    delta_mm: float
    eps_rad: float
    decay: float
    offset_rad: float
    constant_mm: float | None = None
    constant_rad: float | None = None

    def std(self, model: VECModel) -> np.ndarray:
        """Standard deviations (P,) ordered as ``vec.to_vector``."""
        falling = self.decay ** np.maximum(np.arange(model.order + 1) - 1, 0)
        per_error = np.where(np.arange(len(ERRORS)) < 3, self.delta_mm, self.eps_rad)
        one = np.outer(per_error, falling)
        if self.constant_mm is not None:
            one[:3, 0] = self.constant_mm
        if self.constant_rad is not None:
            one[3:, 0] = self.constant_rad
        offsets = np.full(model.direction_offsets_rad.size, self.offset_rad)
        return np.concatenate([np.tile(one.ravel(), model.joints), offsets])


@dataclass(frozen=True)
class VECFit:
    """Fitted ``model`` and ``frames``; ``std`` (P,) as ``vec.to_vector``; ``prior_std`` (P,).

    ``solution`` has the figures of the fit over the frame coordinates (``coordinates``) and the
    ``free`` (P,) coefficients.
    """

    model: VECModel
    frames: Frames
    std: np.ndarray
    prior_std: np.ndarray
    free: np.ndarray
    solution: Solution
    coordinates: FrameCoordinates | ConstrainedFrames


@one_thread
def fit(
    observations: Observations,
    empty: VECModel,
    *,
    prior: Prior,
    rotation_weight_mm_per_rad: float,
    frames: Frames,
    frames_free: bool,
    frame_terms: FrameTerms | None = None,
    start: VECModel | None = None,
) -> VECFit:
    """Coefficients of ``empty`` (its DH arm, joint range and order) from ``observations``.

    Base and targets are ``frames``, or start there if ``frames_free``, under ``frame_terms``;
    coefficients start at those of ``start``, a model like ``empty``, or at zero. Direction offsets
    that no observation shows are left at zero, std NaN; the two of a joint that always travelled
    sum to zero, so that the model at an unknown direction is the mean of both.
    Raises FitError, and InputError where there are fewer residuals than parameters.
    """
    free, flange = flange_model(observations, empty)
    require_enough(observations, flange.size, "VEC fit", VEC_FIX)
    at = frames_of(
        observations, empty, frames, frames_free, frame_terms, rotation_weight_mm_per_rad
    )
    coords = at.coordinates
    require_enough(observations, coords.size + flange.size, "VEC fit", VEC_FIX)
    system = pose_system(observations, flange, coords, rotation_weight_mm_per_rad)
    prior_std = prior.std(empty)
    expected, stated_std = at.known
    frame_std = np.where(np.isfinite(stated_std), stated_std, FRAME_PRIOR_UNITS * at.scale)
    begin = np.zeros(system.size)
    if start is not None:
        begin[coords.size :] = vec.to_vector(start)[free]
    scale = np.concatenate([at.scale, _units(_is_angle(empty)[free])])
    keep = np.append(~at.held, np.ones(flange.size, dtype=bool))
    kept = Kept(system, keep, begin)
    solution = minimise_with_prior(
        kept if at.held.any() else system,
        start=begin[keep],
        prior_mean=np.concatenate([expected, np.zeros(flange.size)])[keep],
        prior_std=np.concatenate([frame_std, prior_std[free]])[keep],
        scale=scale[keep],
        name="VEC fit",
    )
    if at.held.any():
        solution = kept.solution(solution, at.open, scale)
    solution = _with_centred_offsets(solution, observations, empty, free, coords.size)
    vector, std = np.zeros(free.size), np.full(free.size, np.nan)
    vector[free] = solution.x[coords.size :]
    std[free] = solution.std[coords.size :]
    return VECFit(
        model=vec.with_vector(empty, vector),
        frames=coords.frames(solution.x[: coords.size]),
        std=std,
        prior_std=prior_std,
        free=free,
        solution=solution,
        coordinates=coords,
    )


def frames_of(
    observations: Observations,
    empty: VECModel,
    frames: Frames,
    frames_free: bool,
    terms: FrameTerms | None,
    rotation_weight_mm_per_rad: float,
) -> Placed:
    """Coordinates of base and targets of a fit, none where these are known."""
    if not frames_free:
        return known_frames(observations, frames)
    return placed(observations, empty.dh.pose, frames, terms, rotation_weight_mm_per_rad)


@one_thread
def gauge(
    observations: Observations, empty: VECModel, frames: Frames, rotation_weight_mm_per_rad: float
) -> Spectrum:
    """What the poses tell of the coefficients without a prior, about zero errors.

    Base and targets count as known. Directions beyond the rank change no pose to first order:
    constant frame changes between neighbouring joints.
    """
    coords = coordinates(observations, frames, base_free=False, targets_free=False)
    free, flange = flange_model(observations, empty)
    system = PoseSystem(observations, flange, coords, rotation_weight_mm_per_rad)
    return spectrum(
        system, np.zeros(system.size), _units(_is_angle(empty)[free]), 0, RANK_THRESHOLD
    )


def flange_model(observations: Observations, empty: VECModel) -> tuple[np.ndarray, FlangeModel]:
    """Mask (P,) of the coefficients that ``observations`` speak of, and the arm they move."""
    free = _informed(observations, empty)
    return free, _flange_model(empty, free)


def _informed(observations: Observations, empty: VECModel) -> np.ndarray:
    """Mask (P,): every coefficient, and the offsets of directions that occur in the data."""
    directions = np.array([-1, 1])
    seen = (observations.s[:, :, None] == directions).any(axis=0)
    return np.concatenate([np.ones(empty.coefficients.size, dtype=bool), seen.ravel()])


def _with_centred_offsets(
    solution: Solution,
    observations: Observations,
    empty: VECModel,
    free: np.ndarray,
    frames: int,
) -> Solution:
    """The solution with the mean of both offsets of a joint moved into eps_z of order 0.

    A gauge: it changes no pose of a joint whose every observation travels in a known direction.
    Without it the prior splits the constant between both, and a pose at s = 0 loses a part.
    """
    joints, errors, terms = empty.coefficients.shape
    split = empty.coefficients.size
    place = frames + np.cumsum(free) - 1
    if not free[split:].any():
        return solution
    mapping = np.eye(solution.x.size)
    for joint in range(joints):
        offsets = split + 2 * joint + np.arange(2)
        if not free[offsets].all() or (observations.s[:, joint] == 0).any():
            continue
        eps_z = (joint * errors + ERRORS.index("eps_z")) * terms
        mapping[place[eps_z], place[offsets]] += 0.5
        mapping[np.ix_(place[offsets], place[offsets])] -= 0.5
    covariance = mapping @ solution.covariance @ mapping.T
    return replace(
        solution,
        x=mapping @ solution.x,
        covariance=covariance,
        std=np.sqrt(np.maximum(np.diag(covariance), 0.0)),
    )


def _flange_model(empty: VECModel, free: np.ndarray) -> FlangeModel:
    seen = free[empty.coefficients.size :].reshape(empty.joints, 2)
    directed = np.flatnonzero(seen.any(axis=1))
    errors = len(ERRORS)

    def model(x: np.ndarray) -> VECModel:
        vector = np.zeros(free.size)
        vector[free] = x
        return vec.with_vector(empty, vector)

    about_z = np.concatenate([np.arange(errors * empty.joints), errors * directed + errors - 1])

    def linearised(x: np.ndarray, at: JointState) -> tuple[Pose, np.ndarray]:
        moved = vec.motions(model(x), at.q_rad, at.s)
        jacobian = moved.jacobian()
        return moved.pose, jacobian[about_z] if directed.size else jacobian

    def pulled(x: np.ndarray, at: JointState) -> tuple[Pose, Pull]:
        moved = vec.motions(model(x), at.q_rad, at.s)
        return moved.pose, lambda *wrench: moved.pulled(*wrench)[about_z]

    def expansion(at: JointState) -> list[Group]:
        basis, travelled = vec.chebyshev_basis(empty, at.q_rad), vec.direction_basis(at.s)
        groups = [
            Group(slice(errors * joint, errors * (joint + 1)), basis[:, joint])
            for joint in range(empty.joints)
        ]
        for number, joint in enumerate(directed, errors * empty.joints):
            groups.append(Group(slice(number, number + 1), travelled[:, joint, seen[joint]]))
        return groups

    return FlangeModel(
        int(free.sum()), lambda x, at: model(x).pose(at), linearised, expansion, pulled
    )


def _is_angle(model: VECModel) -> np.ndarray:
    one = np.repeat(np.arange(len(ERRORS)) >= 3, model.order + 1)
    offsets = np.ones(model.direction_offsets_rad.size, dtype=bool)
    return np.concatenate([np.tile(one.ravel(), model.joints), offsets])


def _units(is_angle: np.ndarray) -> np.ndarray:
    return np.where(is_angle, ANGLE_UNIT_RAD, 1.0)
