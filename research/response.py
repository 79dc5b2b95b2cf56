"""How both fits answer to small errors of the arm: linear, so four factors are solved at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kinacc.kinematics.model import JointState
from kinacc.kinematics.vec import VECModel

_DH_UNITS = np.tile([1e-3, 1.0, 1.0, 1e-3], 6)  # one mrad counts as much as one mm
_DH_THRESHOLD = 1e-4


@dataclass(frozen=True)
class Answer:
    """Answers to g patterns of error.

    Residuals of the training poses (g, t, 6) in mm and rad: ``vec_vs_measured`` (Table I) and
    ``dh_vs_vec`` (Table III); ``at_points_mm`` (g, p, 3): VEC minus DH at the assessed points;
    ``dh`` (g, 6, 4): DH parameters in the order of Table II, as changes.
    """

    vec_vs_measured: np.ndarray
    dh_vs_vec: np.ndarray
    at_points_mm: np.ndarray
    dh: np.ndarray


@dataclass(frozen=True)
class Response:
    """Both fits linearised at one arm; ``weights`` (6,) whiten a pose error.

    ``train`` (n,) marks the poses fitted. Fits: ``vec_fit`` (P, 6t) on whitened errors and
    ``dh_fit`` (24, 6t) on whitened VEC errors. Jacobians, whitened: ``vec_train`` (6t, P) and
    ``dh_train`` (6t, 24); in mm: ``vec_points`` (3p, P) and ``dh_points`` (3p, 24).
    """

    train: np.ndarray
    weights: np.ndarray
    vec_fit: np.ndarray
    dh_fit: np.ndarray
    vec_train: np.ndarray
    dh_train: np.ndarray
    vec_points: np.ndarray
    dh_points: np.ndarray


def linearise(
    empty: VECModel,
    prior_std: np.ndarray,
    noise_mm: float,
    rotation_weight_mm_per_rad: float,
    q_rad: np.ndarray,
    s: np.ndarray,
    train: np.ndarray,
    points_rad: np.ndarray,
) -> Response:
    """Response at the arm of ``empty``, fitted at ``q_rad[train]`` under a prior (P,).

    ``noise_mm`` is the whitened residual that balances the prior; ``points_rad`` (p, 6) are the
    assessed points.
    """
    weights = np.array([1.0, 1.0, 1.0, *[rotation_weight_mm_per_rad] * 3])
    size = prior_std.size
    vec_all = empty.linearised(JointState(q_rad[train], s[train]))[1]
    vec_train = (vec_all * weights[:, None]).reshape(-1, size)
    gram = vec_train.T @ vec_train / noise_mm**2
    gram[np.diag_indices(size)] += prior_std**-2
    dh_all = _dh_slopes(empty, q_rad[train]).reshape(-1, 6, 24)
    dh_train = (dh_all * weights[:, None]).reshape(-1, 24)
    # At rest between both directions: the mean of what each of them gives.
    one_way = np.ones(points_rad.shape)
    vec_points = (
        sum(empty.linearised(JointState(points_rad, s))[1] for s in (-one_way, one_way)) / 2
    )
    dh_points = _dh_slopes(empty, points_rad)[:, :3]
    return Response(
        train=train,
        weights=weights,
        vec_fit=np.linalg.solve(gram, vec_train.T / noise_mm**2),
        dh_fit=_DH_UNITS[:, None] * np.linalg.pinv(dh_train * _DH_UNITS, rcond=_DH_THRESHOLD),
        vec_train=vec_train,
        dh_train=dh_train,
        vec_points=vec_points[:, :3].reshape(-1, size),
        dh_points=dh_points.reshape(-1, 24),
    )


def _dh_slopes(empty: VECModel, q_rad: np.ndarray) -> np.ndarray:
    """Jacobian (n, 6, 6, 4) of the DH arm in theta, d, a and alpha."""
    slopes = empty.dh.linearised(JointState(q_rad))[1]
    return slopes.reshape(len(q_rad), 6, -1, 5)[..., :4]


def answer(response: Response, errors: np.ndarray) -> Answer:
    """Answers to pose errors (g, n, 6) in mm and rad at all poses of the plan."""
    count = len(errors)
    seen = (errors[:, response.train] * response.weights).reshape(count, -1)
    coefficients = seen @ response.vec_fit.T
    modelled = coefficients @ response.vec_train.T
    parameters = modelled @ response.dh_fit.T
    beyond_dh = modelled - parameters @ response.dh_train.T
    at_points = coefficients @ response.vec_points.T - parameters @ response.dh_points.T
    return Answer(
        (seen - modelled).reshape(count, -1, 6) / response.weights,
        beyond_dh.reshape(count, -1, 6) / response.weights,
        at_points.reshape(count, -1, 3),
        parameters.reshape(count, 6, 4),
    )
