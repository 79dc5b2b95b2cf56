"""VEC coefficients, base and targets fitted to poses under a Gaussian prior."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from kinacc.calibration import fitting
from kinacc.calibration.fitting import ModelFit
from kinacc.calibration.frames import FrameParameters, Frames, FrameTerms
from kinacc.calibration.observations import Observations
from kinacc.calibration.one_thread import one_thread
from kinacc.calibration.split import Spectrum, singular_values
from kinacc.calibration.system import PoseSystem
from kinacc.kinematics.vec import ERRORS, VECModel

VEC_FIX = "measure more poses, or lower calibration.vec.order"
RANK_THRESHOLD = 1e-10  # far below every weak direction, far above rounding: exact gauges only


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
    constant_mm, constant_rad : float or None
        At order 0 where it differs: constants are what a DH model can express as well.
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
        deviation = np.outer(per_error, falling)
        if self.constant_mm is not None:
            deviation[:3, 0] = self.constant_mm
        if self.constant_rad is not None:
            deviation[3:, 0] = self.constant_rad
        offsets = np.full(model.direction_offsets_rad.size, self.offset_rad)
        return np.concatenate([np.tile(deviation.ravel(), model.joints), offsets])


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
    """Fit the coefficients of a VEC model under a prior, and base and targets where free.

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
    rotation_weight_mm_per_rad : float
        Position error that weighs as much as one radian.
    frames : Frames
        Base and targets, or where they start if ``frames_free``.
    frame_terms : FrameTerms, optional
        What is known of base and targets where they are free.
    few : bool
        Fewer residuals than parameters are enough.

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
        rotation_weight_mm_per_rad=rotation_weight_mm_per_rad,
        frames=None if frames_free else frames,
        begin=frames,
        frame_terms=frame_terms,
        held=True,
        few=few,
        name="VEC fit",
        fix=VEC_FIX,
    )
    return _with_centred_offsets(fitted, observations, prior.std(empty))


@one_thread
def gauge(
    observations: Observations, empty: VECModel, frames: Frames, rotation_weight_mm_per_rad: float
) -> Spectrum:
    """What the poses tell of the coefficients without a prior, about zero errors.

    Base and targets count as known. Directions beyond the rank change no pose to first order:
    constant frame changes between neighbouring joints.
    """
    free, known = informed(observations, empty), FrameParameters.none(frames)
    zero = empty.with_parameters(np.zeros(free.size))
    system = PoseSystem(observations, zero, free, known, rotation_weight_mm_per_rad)
    blocks, scale = system.blocks(np.zeros(system.size)), fitting.scales(empty)[free]
    values = singular_values(jacobian * scale for _, jacobian in blocks)
    return Spectrum.of(values, RANK_THRESHOLD)


def informed(observations: Observations, empty: VECModel) -> np.ndarray:
    """True (P,) for all coefficients but offsets of directions that no observation travels."""
    travelled = (observations.s[:, :, None] == np.array([-1, 1])).any(axis=0)
    return np.concatenate([np.ones(empty.coefficients.size, dtype=bool), travelled.ravel()])


def _with_centred_offsets(fit: ModelFit, observations: Observations, std: np.ndarray) -> ModelFit:
    """The fit with the mean of both offsets of a joint moved into eps_z of order 0.

    A gauge: it changes no pose of a joint whose every observation travels in a known direction.
    Without it the prior splits the constant between both, and a pose at s = 0 loses a part.
    """
    empty, free, frames = cast(VECModel, fit.model), fit.free, fit.parameters.size
    (joints, errors, terms), split = empty.coefficients.shape, empty.coefficients.size
    place, solution = frames + np.cumsum(free) - 1, fit.solution
    if not free[split:].any():
        return replace(fit, prior_std=std)
    mapping = np.eye(solution.x.size)
    for joint in range(joints):
        offsets = split + 2 * joint + np.arange(2)
        if not free[offsets].all() or (observations.s[:, joint] == 0).any():
            continue
        eps_z = (joint * errors + ERRORS.index("eps_z")) * terms
        mapping[place[eps_z], place[offsets]] += 0.5
        mapping[np.ix_(place[offsets], place[offsets])] -= 0.5
    covariance = mapping @ solution.covariance @ mapping.T
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    solution = replace(solution, x=mapping @ solution.x, covariance=covariance, std=deviation)
    vector, fitted_std = np.zeros(free.size), np.full(free.size, np.nan)
    vector[free], fitted_std[free] = solution.x[frames:], deviation[frames:]
    model = fit.model.with_parameters(vector)
    return replace(fit, model=model, std=fitted_std, prior_std=std, solution=solution)
