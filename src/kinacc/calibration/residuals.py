"""Errors of models pose by pose, in sample and cross-validated, and their statistics."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration import models
from kinacc.calibration.frames import Frames
from kinacc.calibration.models import Options
from kinacc.calibration.observations import Observations
from kinacc.distributions import gamma99
from kinacc.geometry import Pose, compose, log_so3
from kinacc.kinematics import dh, vec
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.vec import VECModel

COMPARISONS = ("vec_vs_measured", "dh_vs_vec", "dh_vs_measured", "nominal_vs_measured")


@dataclass(frozen=True)
class FittedModels:
    """The models of one fit with their frames."""

    vec: VECModel
    vec_frames: Frames
    dh: DHModel
    dh_frames: Frames
    nominal: DHModel
    nominal_frames: Frames


@dataclass(frozen=True)
class Errors:
    """Errors (n, 3) in the robot base: reference minus model, mm; rotation vectors, rad.

    A rotation vector w turns the model's orientation into the reference's: exp(w) R_model; NaN
    where no orientation was measured.
    """

    position_mm: np.ndarray
    rotation_rad: np.ndarray

    def select(self, rows: np.ndarray) -> Errors:
        """The errors of ``rows``."""
        return Errors(self.position_mm[rows], self.rotation_rad[rows])


@dataclass(frozen=True)
class Statistics:
    """Statistics of n magnitudes, in their unit."""

    n: int
    mean: float
    max: float
    rms: float
    gamma99: float


def fit_all(
    observations: Observations,
    nominal: DHModel,
    joint_range_rad: tuple[np.ndarray, np.ndarray],
    options: Options,
    near: VECModel | None = None,
) -> FittedModels:
    """Every model fitted to ``observations``; the VEC model starts ``near``. Raises FitError."""
    # High orders are worth it; the end is the same to a few nm, which the paper's tables keep.
    worth = options.grid is not None and near is not None and near.order == options.order
    start = near if worth else None
    volumetric = models.fit_vec(observations, nominal, joint_range_rad, options, start)
    best = models.fit_dh(observations, nominal, options, volumetric.model, volumetric.frames)
    plain = models.fit_nominal(observations, nominal, options)
    return FittedModels(
        volumetric.model, volumetric.frames, best.model, best.frames, nominal, plain.frames
    )


def errors(fitted: FittedModels, observations: Observations) -> dict[str, Errors]:
    """Errors of every comparison at ``observations``.

    Comparisons with the measurement are in the base of the model compared. ``dh_vs_vec`` (VEC minus
    DH) takes both through their own base to the instrument and from there to the DH model's base.
    """
    q_rad, s = observations.q_rad, observations.s
    by_vec = _seen(vec.pose(fitted.vec, q_rad, s), fitted.vec_frames, observations)
    by_dh = _seen(dh.forward(fitted.dh, q_rad), fitted.dh_frames, observations)
    by_nominal = _seen(dh.forward(fitted.nominal, q_rad), fitted.nominal_frames, observations)
    measured = observations.measured
    return {
        "vec_vs_measured": _difference(measured, by_vec, _bases(fitted.vec_frames, observations)),
        "dh_vs_vec": _difference(by_vec, by_dh, _bases(fitted.dh_frames, observations)),
        "dh_vs_measured": _difference(measured, by_dh, _bases(fitted.dh_frames, observations)),
        "nominal_vs_measured": _difference(
            measured, by_nominal, _bases(fitted.nominal_frames, observations)
        ),
    }


def cross_validated(
    observations: Observations,
    refit: Callable[[Observations, int], FittedModels],
    folds: Iterable[int],
) -> tuple[dict[str, Errors], dict[int, dict[str, Errors]]]:
    """Errors of every row by a model that has not seen its fold, and each fold's training errors.

    ``refit(train, fold)`` fits the models to the rows outside the fold. Rows without a fold
    (-1) always train and stay NaN.
    """
    count = len(observations)
    blank = Errors(np.full((count, 3), np.nan), np.full((count, 3), np.nan))
    held_out = {name: replace(blank) for name in COMPARISONS}
    held_out = {
        name: Errors(each.position_mm.copy(), each.rotation_rad.copy())
        for name, each in held_out.items()
    }
    trained: dict[int, dict[str, Errors]] = {}
    for fold in folds:
        out = observations.fold == fold
        fitted = refit(observations.select(~out), fold)
        for name, each in errors(fitted, observations.select(out)).items():
            held_out[name].position_mm[out] = each.position_mm
            held_out[name].rotation_rad[out] = each.rotation_rad
        trained[fold] = errors(fitted, observations.select(~out))
    return held_out, trained


def statistics(vectors: np.ndarray) -> Statistics | None:
    """Statistics of the magnitudes of ``vectors`` (n, 3); None without a finite one.

    gamma99 is NaN where a magnitude is zero: the likelihood has no maximum there.
    """
    magnitudes = np.linalg.norm(vectors, axis=1)
    magnitudes = magnitudes[np.isfinite(magnitudes)]
    if magnitudes.size == 0:
        return None
    return Statistics(
        n=int(magnitudes.size),
        mean=float(magnitudes.mean()),
        max=float(magnitudes.max()),
        rms=float(np.sqrt(np.mean(magnitudes**2))),
        gamma99=gamma99(magnitudes) if magnitudes.min() > 0.0 else float("nan"),
    )


def _seen(flange: Pose, frames: Frames, observations: Observations) -> Pose:
    targets = Pose(
        frames.targets.rotation[observations.target],
        frames.targets.position_mm[observations.target],
    )
    return compose(_bases(frames, observations), compose(flange, targets))


def _bases(frames: Frames, observations: Observations) -> Pose:
    """The base of every row's session, (n, ...)."""
    rows = observations.session
    return Pose(frames.bases.rotation[rows], frames.bases.position_mm[rows])


def _difference(reference: Pose, model: Pose, bases: Pose) -> Errors:
    back = np.swapaxes(bases.rotation, 1, 2)
    known = np.isfinite(reference.rotation[:, 0, 0])
    rotation = np.full(reference.position_mm.shape, np.nan)
    turned = reference.rotation[known] @ np.swapaxes(model.rotation[known], 1, 2)
    rotation[known] = (back[known] @ log_so3(turned)[..., None])[..., 0]
    position = (back @ (reference.position_mm - model.position_mm)[..., None])[..., 0]
    return Errors(position, rotation)
