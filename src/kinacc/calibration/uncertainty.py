"""Joint uncertainty of everything a fit estimated, in coordinates that need no memory of the fit.

Parameters are named: ``base.x_mm`` .. ``base.rz_rad`` move the robot base in the instrument's
frame, ``base2`` and so on that of further sessions in the order they come in; ``<target>.x_mm`` ..
``<target>.rz_rad`` move a target in the flange frame; a rotation vector w turns R to exp(w) R in
the frame the motion is given in. DH parameters are ``j1.d_mm`` and the like, VEC coefficients
``j1.delta_x.0``.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np

from kinacc.calibration.frames import ANGLE_UNIT_RAD
from kinacc.calibration.split import TOUCH_SQUARED

if TYPE_CHECKING:
    from kinacc.calibration.fitting import ModelFit


@dataclass(frozen=True)
class Uncertainty:
    """What a fit knows of its P parameters, and what it does not.

    Attributes
    ----------
    names : tuple of str
        The parameters, those of base and targets first.
    covariance : numpy.ndarray
        Of the directions the data determine, shape (P, P) in mm and rad.
    undetermined : numpy.ndarray
        The others, shape (m, P): each a displacement of unit length in mm and mrad of the model's
        parameters (base and targets following) that changes no measured pose.
    """

    names: tuple[str, ...]
    covariance: np.ndarray
    undetermined: np.ndarray

    @property
    def determined(self) -> np.ndarray:
        """True (P,) where no undetermined direction reaches a parameter."""
        return np.sum(self.undetermined**2, axis=0) <= TOUCH_SQUARED


def of_fit(fit: ModelFit) -> Uncertainty:
    """Uncertainty of base and targets if estimated, then of the parameters that took part.

    Parameters
    ----------
    fit : ModelFit
        A fit.

    Returns
    -------
    Uncertainty
        Of shifts and turns of the frames (mm, rad) and of parameters in their units.
    """
    names = (*fit.parameters.names, *compress(fit.model.names, fit.free.ravel()))
    change = _change(fit)
    covariance = change @ fit.solution.covariance @ change.T
    return Uncertainty(names, covariance, named_directions(fit, fit.solution.undetermined))


def named_directions(fit: ModelFit, directions: np.ndarray) -> np.ndarray:
    """Directions (m, P) of a fit's own coordinates, in units of its scale, as of its names."""
    units = [scale_of(name) for name in compress(fit.model.names, fit.free.ravel())]
    units = np.concatenate([fit.parameters.scale, units])
    return (directions * fit.solution.scale) @ _change(fit).T / units


def _change(fit: ModelFit) -> np.ndarray:
    """Derivative (P, P) of motions and parameters in the fit's own coordinates."""
    frames = fit.parameters.size
    change = np.eye(len(fit.solution.x))
    change[:frames, :frames] = fit.parameters.motions(fit.solution.x[:frames])
    return change


# Unit of a parameter by the end of its name, and what of it moves a pose as much as one mm does.
_UNITS = {
    "_rad": ("rad", ANGLE_UNIT_RAD),
    "_rad_per_nm": ("rad/(N m)", 1e-6),
    "_rad_per_mm": ("rad/mm", 1e-6),
}


def unit_of(name: str) -> str:
    """Unit of a named parameter.

    Parameters
    ----------
    name : str
        As ``j1.d_mm``.

    Returns
    -------
    str
        mm, rad, or what a coefficient of it is per.
    """
    return _unit(name)[0]


def scale_of(name: str) -> float:
    """What of a parameter counts as one mm.

    Parameters
    ----------
    name : str
        As ``j1.d_mm``.

    Returns
    -------
    float
        In the parameter's unit: 1 mm, one mrad, 1e-6 of a coefficient.
    """
    return _unit(name)[1]


def scaled_unit(name: str) -> str:
    """Unit of a displacement measured in ``scale_of``.

    Parameters
    ----------
    name : str
        As ``j1.d_mm``.

    Returns
    -------
    str
        mm, mrad, or 1e-6 of a coefficient's unit.
    """
    unit = unit_of(name)
    return {"mm": unit, "rad": "mrad"}.get(unit, f"1e-6 {unit}")


def is_angle(name: str) -> bool:
    """Whether a parameter is in rad.

    Parameters
    ----------
    name : str
        As ``j1.theta_rad``.

    Returns
    -------
    bool
        True for rad.
    """
    return unit_of(name) == "rad"


def _unit(name: str) -> tuple[str, float]:
    if ".eps_" in name:
        return _UNITS["_rad"]
    return next((unit for end, unit in _UNITS.items() if name.endswith(end)), ("mm", 1.0))
