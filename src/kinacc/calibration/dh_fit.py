"""DH parameters, base and targets fitted to poses, from nominal values and no starting frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration.frames import FrameCoordinates, Frames, coordinates
from kinacc.calibration.observations import Observations
from kinacc.calibration.solve import Solution
from kinacc.calibration.start import closed_form_start
from kinacc.calibration.system import FlangeModel, PoseSystem, require_enough
from kinacc.calibration.truncated import minimise_truncated
from kinacc.models import dh
from kinacc.models.dh import DHModel

ANGLE_UNIT_RAD = 1e-3  # one mrad counts as much displacement as one mm
DH_FIX = "measure more poses"
_ANGLES = np.array([True, False, False, True, True])  # of dh.PARAMETERS


@dataclass(frozen=True)
class DHFit:
    """Fitted ``model`` and ``frames``; ``std`` (k, 5) as ``dh.PARAMETERS``, NaN undetermined.

    ``free`` (k, 5) marks the parameters that took part; ``solution`` has the figures of the fit,
    frame coordinates (``coordinates``) first.
    """

    model: DHModel
    frames: Frames
    std: np.ndarray
    free: np.ndarray
    solution: Solution
    coordinates: FrameCoordinates

    def with_frames(self, frames: Frames) -> DHFit:
        """The same arm seen through other frames."""
        return replace(self, frames=frames)


def free_parameters(joints: int, hayati_joints: tuple[int, ...] = ()) -> np.ndarray:
    """Mask (k, 5): four DH parameters per joint, and beta on ``hayati_joints`` (1-based)."""
    free = np.ones((joints, 5), dtype=bool)
    free[:, 4] = False
    for joint in hayati_joints:
        free[joint - 1, 4] = True
    return free


def fit(
    observations: Observations,
    nominal: DHModel,
    *,
    free: np.ndarray,
    rotation_weight_mm_per_rad: float,
    threshold: float,
    frames: Frames | None = None,
    start: DHModel | None = None,
) -> DHFit:
    """DH model of the ``free`` (k, 5) parameters closest to ``observations``.

    ``frames`` given: base and targets are known. None: both are estimated, from a closed form.
    Directions of singular value below ``threshold`` times the largest stay nominal.
    Raises FitError, and InputError where there are fewer residuals than parameters.
    """
    start = start or nominal
    held = dh.to_vector(nominal)
    mask = free.ravel()
    known = frames is not None
    require_enough(observations, int(mask.sum()), "DH fit", DH_FIX)
    anchor = frames if known else _start_frames(observations, start)
    coords = coordinates(observations, anchor, base_free=not known, targets_free=not known)
    flange = flange_model(nominal, free)
    require_enough(observations, coords.size + flange.size, "DH fit", DH_FIX)
    system = PoseSystem(observations, flange, coords, rotation_weight_mm_per_rad)
    zeros = np.zeros(coords.size)
    scale = np.concatenate([_units(coords.is_angle()), _units(np.tile(_ANGLES, len(free))[mask])])
    solution = minimise_truncated(
        system,
        start=np.concatenate([zeros, dh.to_vector(start)[mask]]),
        nominal=np.concatenate([zeros, held[mask]]),
        scale=scale,
        threshold=threshold,
        frames=coords.size,
        name="DH fit",
    )
    vector, std = held.copy(), np.full(held.size, np.nan)
    vector[mask] = solution.x[coords.size :]
    std[mask] = solution.std[coords.size :]
    return DHFit(
        model=dh.with_vector(nominal, vector),
        frames=coords.frames(solution.x[: coords.size]),
        std=std.reshape(free.shape),
        free=free,
        solution=solution,
        coordinates=coords,
    )


def fit_frames(
    observations: Observations,
    model: DHModel,
    *,
    rotation_weight_mm_per_rad: float,
    frames: Frames | None = None,
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
    )


def flange_model(nominal: DHModel, free: np.ndarray) -> FlangeModel:
    """The DH arm as a function of its ``free`` (k, 5) parameters, the others nominal."""
    held, mask = dh.to_vector(nominal), free.ravel()

    def model(x: np.ndarray) -> DHModel:
        vector = held.copy()
        vector[mask] = x
        return dh.with_vector(nominal, vector)

    def jacobian(x: np.ndarray, q_rad: np.ndarray, s: np.ndarray) -> np.ndarray:
        full = dh.parameter_jacobian(model(x), q_rad)
        return full.reshape(len(full), 6, -1)[:, :, mask]

    return FlangeModel(int(mask.sum()), lambda x, q, s: dh.forward(model(x), q), jacobian)


def _start_frames(observations: Observations, model: DHModel) -> Frames:
    return closed_form_start(observations, dh.forward(model, observations.q_rad))


def _units(is_angle: np.ndarray) -> np.ndarray:
    return np.where(is_angle, ANGLE_UNIT_RAD, 1.0)
