"""VEC coefficients, base and targets fitted to poses under a Gaussian prior."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration.fitting import ModelFit, Unknowns, placed, solved
from kinacc.calibration.frames import ANGLE_UNIT_RAD, FrameParameters, Frames, FrameTerms
from kinacc.calibration.observations import Observations
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.solve import Solution, Spectrum, singular_values
from kinacc.calibration.system import FlangeModel, Group, PoseSystem
from kinacc.geometry import Pose
from kinacc.kinematics import vec
from kinacc.kinematics.model import JointState
from kinacc.kinematics.vec import ERRORS, VECModel

VEC_FIX = "measure more poses, or lower calibration.vec.order"
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
        """Standard deviations (P,) ordered as the parameters of a VEC model."""
        falling = self.decay ** np.maximum(np.arange(model.order + 1) - 1, 0)
        per_error = np.where(np.arange(len(ERRORS)) < 3, self.delta_mm, self.eps_rad)
        one = np.outer(per_error, falling)
        if self.constant_mm is not None:
            one[:3, 0] = self.constant_mm
        if self.constant_rad is not None:
            one[3:, 0] = self.constant_rad
        offsets = np.full(model.direction_offsets_rad.size, self.offset_rad)
        return np.concatenate([np.tile(one.ravel(), model.joints), offsets])


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
    few: bool = False,
) -> ModelFit:
    """Coefficients of ``empty`` (its DH arm, joint range and order) from ``observations``.

    Base and targets are ``frames``, or start there if ``frames_free``, under ``frame_terms``.
    Direction offsets that no observation shows are left at zero, std NaN; the two of a joint that
    always travelled sum to zero, so that the model at an unknown direction is the mean of both.
    Raises FitError and, unless ``few`` residuals are enough, InputError where there are fewer than
    parameters.
    """
    weight = rotation_weight_mm_per_rad
    free, flange = flange_model(observations, empty)
    prior_std, nothing = prior.std(empty), np.zeros(flange.size)
    unknowns = Unknowns(
        "VEC fit",
        flange,
        nothing,
        nothing,
        prior_std[free],
        scales(empty)[free],
        True,
        few,
        VEC_FIX,
    )
    parameters = FrameParameters.none(frames)
    if frames_free:
        parameters = placed(observations, empty.dh, frame_terms, weight, start=frames)
    found, solution, _ = solved(
        observations, unknowns, parameters, rotation_weight_mm_per_rad=weight
    )
    solution = _with_centred_offsets(solution, observations, empty, free, parameters.size)
    vector, std = np.zeros(free.size), np.full(free.size, np.nan)
    vector[free] = solution.x[parameters.size :]
    std[free] = solution.std[parameters.size :]
    model = empty.with_parameters(vector)
    return ModelFit(model, found, std, free, prior_std, solution, parameters)


@one_thread
def gauge(
    observations: Observations, empty: VECModel, frames: Frames, rotation_weight_mm_per_rad: float
) -> Spectrum:
    """What the poses tell of the coefficients without a prior, about zero errors.

    Base and targets count as known. Directions beyond the rank change no pose to first order:
    constant frame changes between neighbouring joints.
    """
    free, flange = flange_model(observations, empty)
    known = FrameParameters.none(frames)
    system = PoseSystem(observations, flange, known, rotation_weight_mm_per_rad)
    values = singular_values(system, np.zeros(system.size), scales(empty)[free])
    return Spectrum.of(values, RANK_THRESHOLD)


def flange_model(observations: Observations, empty: VECModel) -> tuple[np.ndarray, FlangeModel]:
    """Mask (P,) of the coefficients that ``observations`` speak of, and the arm they move.

    These are all but the offsets of directions that do not occur in the data.
    """
    errors, joints = len(ERRORS), empty.joints
    seen = (observations.s[:, :, None] == np.array([-1, 1])).any(axis=0)
    free = np.concatenate([np.ones(empty.coefficients.size, dtype=bool), seen.ravel()])
    directed = np.flatnonzero(seen.any(axis=1))
    about_z = np.concatenate([np.arange(errors * joints), errors * directed + errors - 1])

    def model(x: np.ndarray) -> VECModel:
        vector = np.zeros(free.size)
        vector[free] = x
        return empty.with_parameters(vector)

    def linearised(x: np.ndarray, at: JointState) -> tuple[Pose, np.ndarray]:
        walk = vec.walk(model(x), at.q_rad, at.s)
        return walk.pose, walk.by_errors().reshape(errors * joints, 6, -1)[about_z]

    def expansion(at: JointState) -> list[Group]:
        basis, travelled = vec.chebyshev_basis(empty, at.q_rad), vec.direction_basis(at.s)
        groups = [Group(slice(errors * i, errors * (i + 1)), basis[:, i]) for i in range(joints)]
        for number, joint in enumerate(directed, errors * joints):
            groups.append(Group(slice(number, number + 1), travelled[:, joint, seen[joint]]))
        return groups

    return free, FlangeModel(
        int(free.sum()), lambda x, at: model(x).pose(at), linearised, expansion
    )


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


def scales(model: VECModel) -> np.ndarray:
    """Displacements (P,) of the coefficients that count as one mm."""
    one = np.repeat(np.arange(len(ERRORS)) >= 3, model.order + 1)
    offsets = np.ones(model.direction_offsets_rad.size, dtype=bool)
    is_angle = np.concatenate([np.tile(one, model.joints), offsets])
    return np.where(is_angle, ANGLE_UNIT_RAD, 1.0)
