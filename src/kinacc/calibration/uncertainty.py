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
from kinacc.calibration.frames import FrameCoordinates, left_jacobian
from kinacc.calibration.truncated import TOUCH_SQUARED
from kinacc.calibration.vec_fit import VECFit
from kinacc.geometry import skew
from kinacc.models.dh import PARAMETERS
from kinacc.models.vec import ERRORS, VECModel

MOTIONS = ("x_mm", "y_mm", "z_mm", "rx_rad", "ry_rad", "rz_rad")
BASE = "base"


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


def frame_motion_names(coordinates: FrameCoordinates, target_names: tuple[str, ...]) -> list[str]:
    """Names of the frame parameters, in the order of the rows of ``frame_motions``."""
    names = []
    for session in range(coordinates.anchor.sessions if coordinates.base_free else 0):
        base = BASE if session == 0 else f"{BASE}{session + 1}"
        names += [f"{base}.{motion}" for motion in MOTIONS]
    if coordinates.targets_free:
        for name, turns in zip(target_names, coordinates.turns, strict=True):
            names += [f"{name}.{motion}" for motion in (MOTIONS if turns else MOTIONS[:3])]
    return names


def frame_motions(coordinates: FrameCoordinates, x: np.ndarray) -> np.ndarray:
    """Derivative (F, F) of the named motions of base and targets in the frame coordinates at x."""
    motions = np.zeros((coordinates.size, coordinates.size))
    for session in range(coordinates.anchor.sessions if coordinates.base_free else 0):
        inverse = coordinates.inverse_base(x, session)
        place = coordinates.base_columns(session)
        shift, turned = slice(place.start, place.start + 3), slice(place.start + 3, place.stop)
        base = inverse.rotation.T
        turn = base @ left_jacobian(x[turned])
        # m = c - R'p, R' turning by exp(-R'J dw): see FrameCoordinates.inverse_base.
        motions[shift, shift] = -base
        motions[shift, turned] = -skew(base @ inverse.position_mm) @ turn
        motions[turned, turned] = -turn
    if coordinates.targets_free:
        for target, turns in enumerate(coordinates.turns):
            columns = coordinates.target_columns(target)
            begin = columns.start
            motions[begin : begin + 3, begin : begin + 3] = np.eye(3)
            if turns:
                turned = left_jacobian(x[begin + 3 : begin + 6])
                motions[begin + 3 : begin + 6, begin + 3 : begin + 6] = turned
    return motions


def _uncertainty(
    fit: DHFit | VECFit, target_names: tuple[str, ...], free: list[str]
) -> Uncertainty:
    frames = fit.coordinates.size
    names = (*frame_motion_names(fit.coordinates, target_names), *free)
    change = np.eye(len(names))
    change[:frames, :frames] = frame_motions(fit.coordinates, fit.solution.x[:frames])
    undetermined = np.zeros((0, len(names)))
    if fit.solution.undetermined is not None:
        units = _units(names)
        # The fit's own scale has the same units: frame coordinates are mm and rad as well.
        undetermined = (fit.solution.undetermined * units) @ change.T / units
    return Uncertainty(names, change @ fit.solution.covariance @ change.T, undetermined)


def _units(names: tuple[str, ...]) -> np.ndarray:
    return np.where([is_angle(name) for name in names], ANGLE_UNIT_RAD, 1.0)
