"""Joint uncertainty of everything a fit estimated, in coordinates that need no memory of the fit.

Parameters are named: ``base.x_mm`` .. ``base.rz_rad`` move the robot base in the instrument's
frame, ``base2`` and so on that of further sessions in the order they come in; ``<target>.x_mm`` ..
``<target>.rz_rad`` move a target in the flange frame; a rotation vector w turns R to exp(w) R in
the frame the motion is given in. DH parameters are ``j1.d_mm`` and the like, VEC coefficients
``j1.delta_x.0``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.calibration.dh_fit import ANGLE_UNIT_RAD, DHFit
from kinacc.calibration.truncated_svd import TOUCH_SQUARED
from kinacc.calibration.vec_fit import VECFit
from kinacc.kinematics.dh import PARAMETERS
from kinacc.kinematics.vec import ERRORS, VECModel


@dataclass(frozen=True)
class Uncertainty:
    """What a fit knows of its P parameters, and what it does not.

    ``covariance`` (P, P) in mm and rad, of the directions the data determine;
    ``undetermined`` (m, P): the others, each a displacement of unit length in mm and mrad of the
    model's parameters (base and targets following) that changes no measured pose.
    """

    names: tuple[str, ...]
    covariance: np.ndarray
    undetermined: np.ndarray

    @property
    def determined(self) -> np.ndarray:
        """True (P,) where no undetermined direction reaches a parameter."""
        return np.sum(self.undetermined**2, axis=0) <= TOUCH_SQUARED


def of_dh(fit: DHFit, target_names: tuple[str, ...]) -> Uncertainty:
    """Uncertainty of a DH fit: base and targets if estimated, then its free parameters."""
    names = dh_parameter_names(len(fit.free))
    free = [name for name, chosen in zip(names, fit.free.ravel(), strict=True) if chosen]
    return _uncertainty(fit, target_names, free)


def of_vec(fit: VECFit, target_names: tuple[str, ...]) -> Uncertainty:
    """Posterior uncertainty of a VEC fit: base and targets if estimated, then coefficients."""
    names = vec_parameter_names(fit.model)
    free = [name for name, chosen in zip(names, fit.free, strict=True) if chosen]
    return _uncertainty(fit, target_names, free)


def dh_parameter_names(joints: int) -> list[str]:
    """Names (5k,) of the DH parameters, ordered as ``dh.to_vector``: j1.theta_offset_rad, ..."""
    return [f"j{joint}.{name}" for joint in range(1, joints + 1) for name in PARAMETERS]


def vec_parameter_names(model: VECModel) -> list[str]:
    """Names (P,) of the coefficients, ordered as ``vec.to_vector``: j1.delta_x.0, ..."""
    coefficients = [
        f"j{joint}.{error}.{order}"
        for joint in range(1, model.joints + 1)
        for error in ERRORS
        for order in range(model.order + 1)
    ]
    offsets = [
        f"j{joint}.eps_z.{direction}"
        for joint in range(1, model.joints + 1)
        for direction in ("minus", "plus")
    ]
    return coefficients + offsets


def is_angle(name: str) -> bool:
    """Whether a named parameter is in rad; otherwise it is in mm."""
    return name.endswith("_rad") or ".eps_" in name


def _uncertainty(
    fit: DHFit | VECFit, target_names: tuple[str, ...], free: list[str]
) -> Uncertainty:
    names, change = _named(fit, target_names, free)
    undetermined = np.zeros((0, len(names)))
    if fit.solution.undetermined is not None:
        undetermined = _directions(fit, fit.solution.undetermined, names, change)
    return Uncertainty(names, change @ fit.solution.covariance @ change.T, undetermined)


def named_directions(
    fit: DHFit, target_names: tuple[str, ...], directions: np.ndarray
) -> np.ndarray:
    """Directions (m, P) of a fit's own coordinates, in units of its scale, as of its names."""
    names = dh_parameter_names(len(fit.free))
    free = [name for name, chosen in zip(names, fit.free.ravel(), strict=True) if chosen]
    return _directions(fit, directions, *_named(fit, target_names, free))


def _named(
    fit: DHFit | VECFit, target_names: tuple[str, ...], free: list[str]
) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of motions and parameters, and their derivative in the fit's own coordinates."""
    frames, moving = fit.coordinates.size, fit.coordinates.motion_names(target_names)
    names = (*moving, *free)
    change = np.zeros((len(names), len(fit.solution.x)))
    change[: len(moving), :frames] = fit.coordinates.motions(fit.solution.x[:frames])
    change[len(moving) :, frames:] = np.eye(len(free))
    return names, change


def _directions(
    fit: DHFit | VECFit, directions: np.ndarray, names: tuple[str, ...], change: np.ndarray
) -> np.ndarray:
    # The fit's own scale has the same units: frame coordinates are mm and rad as well.
    free = names[len(names) - (change.shape[1] - fit.coordinates.size) :]
    angle = [*fit.coordinates.is_angle(), *(is_angle(name) for name in free)]
    own = np.where(angle, ANGLE_UNIT_RAD, 1.0)
    return (directions * own) @ change.T / _units(names)


def _units(names: tuple[str, ...]) -> np.ndarray:
    return np.where([is_angle(name) for name in names], ANGLE_UNIT_RAD, 1.0)
