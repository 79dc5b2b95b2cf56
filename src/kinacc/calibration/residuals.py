"""Errors of models pose by pose, in sample and cross-validated, and their statistics."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.calibration.models import Fit
from kinacc.calibration.observations import Observations
from kinacc.config.error_models import MEASURED, comparisons
from kinacc.distributions import gamma99
from kinacc.geometry import Pose, log_so3


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


def errors(fits: Mapping[str, Fit], observations: Observations) -> dict[str, Errors]:
    """Errors of every comparison, each in the base of the model compared.

    A model that is the reference is taken through its own base to the instrument, and from there to
    that base.

    Parameters
    ----------
    fits : mapping
        ``Fit`` by kind.
    observations : Observations
        n measured points and poses.

    Returns
    -------
    dict
        ``Errors`` (n, 3) by name of the comparison, mm and rad.
    """
    bases = {name: fit.frames.at_rows(observations)[0] for name, fit in fits.items()}
    poses = {name: fit.frames.seen(fit.model, observations) for name, fit in fits.items()}
    poses[MEASURED] = observations.measured
    return {
        comparison.name: _difference(
            poses[comparison.reference], poses[comparison.model], bases[comparison.model]
        )
        for comparison in comparisons(fits)
    }


def cross_validated(
    observations: Observations,
    refit: Callable[[Observations, int], Mapping[str, Fit]],
    folds: Iterable[int],
    models: Collection[str],
) -> tuple[dict[str, Errors], dict[int, dict[str, Errors]]]:
    """Errors of every row by a model that has not seen its fold, and each fold's training errors.

    ``refit(train, fold)`` fits the ``models`` to the rows outside the fold. Rows without a fold
    (-1) always train and stay NaN.
    """
    count = len(observations)
    held_out = {
        comparison.name: Errors(*np.full((2, count, 3), np.nan))
        for comparison in comparisons(models)
    }
    trained: dict[int, dict[str, Errors]] = {}
    for fold in folds:
        out = observations.fold == fold
        fitted = refit(observations.select(~out), fold)
        for name, off in errors(fitted, observations.select(out)).items():
            held_out[name].position_mm[out] = off.position_mm
            held_out[name].rotation_rad[out] = off.rotation_rad
        trained[fold] = errors(fitted, observations.select(~out))
    return held_out, trained


def statistics(vectors: np.ndarray) -> Statistics | None:
    """Statistics of magnitudes.

    Parameters
    ----------
    vectors : numpy.ndarray
        Shape (n, 3), of any unit.

    Returns
    -------
    Statistics or None
        Of the finite ones, None without any; gamma99 is NaN where a magnitude is zero: the
        likelihood
        has no maximum there.
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


def _difference(reference: Pose, model: Pose, bases: Pose) -> Errors:
    back = np.swapaxes(bases.rotation, 1, 2)
    known = np.isfinite(reference.rotation[:, 0, 0])
    rotation = np.full(reference.position_mm.shape, np.nan)
    turned = reference.rotation[known] @ np.swapaxes(model.rotation[known], 1, 2)
    rotation[known] = (back[known] @ log_so3(turned)[..., None])[..., 0]
    position = (back @ (reference.position_mm - model.position_mm)[..., None])[..., 0]
    return Errors(position, rotation)
