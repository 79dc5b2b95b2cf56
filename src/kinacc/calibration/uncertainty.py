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
import scipy
from scipy.sparse import csr_array

from kinacc.calibration.frames import ANGLE_UNIT_RAD
from kinacc.calibration.observations import Observations
from kinacc.measurements.folds import configurations

if TYPE_CHECKING:
    from kinacc.calibration.fitting import ModelFit

TOUCH_SQUARED = 1e-4  # a parameter is undetermined if a truncated direction holds 1 % of it


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
    scales = [scale_of(name) for name in compress(fit.model.names, fit.free.ravel())]
    units = np.concatenate([fit.parameters.scale, scales])
    return (directions * fit.solution.scale) @ _change(fit).T / units


def _change(fit: ModelFit) -> np.ndarray:
    """Derivative (P, P) of motions and parameters in the fit's own coordinates."""
    frames = fit.parameters.size
    change = np.eye(len(fit.solution.x))
    change[:frames, :frames] = fit.parameters.motions(fit.solution.x[:frames])
    return change


# Unit of a parameter by the end of its name.
_UNITS = {"_rad": "rad", "_rad_per_nm": "rad/(N m)", "_rad_per_mm": "rad/mm"}


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
    if ".eps_" in name:
        return "rad"
    return next((unit for end, unit in _UNITS.items() if name.endswith(end)), "mm")


def scale_of(name: str) -> float:
    """What of a parameter moves a pose as much as one mm does.

    Parameters
    ----------
    name : str
        As ``j1.d_mm``.

    Returns
    -------
    float
        In the parameter's unit: 1 mm, one mrad, 1e-6 of a coefficient.
    """
    return {"mm": 1.0, "rad": ANGLE_UNIT_RAD}.get(unit_of(name), 1e-6)


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


WORST_CONDITION = 1e6  # of the equations for variances: beyond it they cannot be told apart
LEAST_FREEDOM = 1e-12  # in residuals


def shared_errors(observations: Observations) -> list[csr_array]:
    """Sums (labels, components) over the residuals that share one error, for each kind of error.

    Kinds of one reading come first; those of configurations are there where any is read again.
    """
    configuration = configurations(observations.pose, observations.q_rad)
    both = np.stack([configuration, observations.target])
    of_target = np.unique(both, axis=1, return_inverse=True)[1].ravel()
    levels = [np.arange(len(observations))]
    if of_target.max() + 1 < len(observations):
        levels.append(of_target)
        if configuration.max() < of_target.max():
            levels.append(configuration)
    row, axis = observations.places
    return [
        csr_array((np.ones(len(part)), (6 * level[row[part]] + axis[part], part)),
                  (6 * (level.max() + 1), len(row)))
        for level in levels
        for part in (np.flatnonzero(axis < 3), np.flatnonzero(axis >= 3))
        if part.size
    ]  # fmt: skip


def covariance_along(
    residual: np.ndarray,
    jacobian: np.ndarray,
    errors: list[csr_array],
    fitted: np.ndarray,
    reported: np.ndarray,
    pooled: float,
) -> np.ndarray:
    """Covariance (r, r) of coordinates along directions: a sandwich of the variances of all errors.

    Parameters
    ----------
    residual, jacobian : numpy.ndarray
        Of the fit, shapes (m,) and (m, P).
    errors : list of scipy.sparse.csr_array
        See ``shared_errors``.
    fitted, reported : numpy.ndarray
        Roots (P, q) and (P, r) of ``Split`` by which the parameters were fitted, and along which
        the covariance is wanted.
    pooled : float
        Variance of the rows of priors, above 0.
    """
    variances = _variances(residual, jacobian @ fitted, errors, pooled)
    along = jacobian @ reported
    total = pooled * (np.eye(along.shape[1]) - along.T @ along)
    for variance, sums in zip(variances, errors, strict=False):
        added = sums @ along
        total += variance * (added.T @ added)
    return total


def _variances(
    residual: np.ndarray, along: np.ndarray, errors: list[csr_array], pooled: float
) -> np.ndarray:
    """Variances of the first of ``errors``, as many as can be told apart; none is negative.

    ``along`` (m, r): the Jacobian along a root. With H = along along' the expected square sum of
    (I - H) e added up by Za is the sum over kinds b of variance_b |Za (I - H) Zb'|^2.
    """
    count, added = len(errors), [sums @ along for sums in errors]
    grams, expected = [part.T @ part for part in added], np.zeros((count, count))
    for a, b in np.ndindex(count, count):
        common = errors[a] @ errors[b].T
        crossed = np.sum(added[a] * (common @ added[b]))
        expected[a, b] = common.power(2).sum() - 2.0 * crossed + np.sum(grams[a] * grams[b])
    prior = np.eye(along.shape[1]) - along.T @ along
    squares = np.array([np.sum((sums @ residual) ** 2) for sums in errors])
    squares -= pooled * np.array([np.sum(gram * prior) for gram in grams])
    unit = np.sqrt(np.maximum(np.diag(expected), LEAST_FREEDOM))
    scaled, wanted = expected / np.outer(unit, unit), squares / (pooled * unit)
    while count > 1 and np.linalg.cond(scaled[:count, :count]) > WORST_CONDITION:
        count -= 1
    return pooled * scipy.optimize.nnls(scaled[:count, :count], wanted[:count])[0] / unit[:count]
