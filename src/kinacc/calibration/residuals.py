"""Errors of models pose by pose, in sample and held out; model selection, bias, worst rows."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from kinacc.calibration.fitting import Fit
from kinacc.calibration.observations import Observations
from kinacc.config.error_models import MEASURED, comparisons
from kinacc.distributions import gamma99
from kinacc.geometry import Pose, log_so3


def errors(fits: Mapping[str, Fit], observations: Observations) -> dict[str, np.ndarray]:
    """Errors of every comparison: reference minus model, in the base of the model compared.

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
        Errors (n, 6) by name of the comparison: position in mm, then in mrad the rotation vector w
        that turns the model's orientation into the reference's, exp(w) R_model; NaN where no
        orientation was measured.
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
) -> tuple[dict[str, np.ndarray], dict[int, dict[str, np.ndarray]]]:
    """Errors of every row by a model that has not seen its fold, and each fold's training errors.

    ``refit(train, fold)`` fits the ``models`` to the rows outside the fold. Rows without a fold
    (-1) always train and stay NaN.
    """
    nothing = np.full((len(observations), 6), np.nan)
    held_out = {comparison.name: nothing.copy() for comparison in comparisons(models)}
    trained: dict[int, dict[str, np.ndarray]] = {}
    for fold in folds:
        out = observations.fold == fold
        fitted = refit(observations.select(~out), fold)
        for name, off in errors(fitted, observations.select(out)).items():
            held_out[name][out] = off
        trained[fold] = errors(fitted, observations.select(~out))
    return held_out, trained


def statistics(vectors: np.ndarray) -> tuple[int, float, float, float, float] | None:
    """Number, mean, largest, rms and gamma99 of magnitudes, in their unit.

    Parameters
    ----------
    vectors : numpy.ndarray
        Shape (n, 3), of any unit.

    Returns
    -------
    tuple or None
        Of the finite ones, None without any; gamma99 is NaN where a magnitude is zero: the
        likelihood has no maximum there.
    """
    size = np.linalg.norm(vectors, axis=1)
    size = size[np.isfinite(size)]
    if not size.size:
        return None
    quantile = gamma99(size) if size.min() > 0.0 else np.nan
    return size.size, size.mean(), size.max(), np.sqrt(np.mean(size**2)), quantile


def _difference(reference: Pose, model: Pose, bases: Pose) -> np.ndarray:
    known = np.isfinite(reference.rotation[:, 0, 0])
    off = np.full((len(known), 2, 3), np.nan)
    off[:, 0] = reference.position_mm - model.position_mm
    turned = reference.rotation[known] @ np.swapaxes(model.rotation[known], 1, 2)
    off[known, 1] = 1e3 * log_so3(turned)
    return (off @ bases.rotation).reshape(-1, 6)


STANDARD_ERRORS = 2.0  # by which a gain must exceed zero
REGIONS = 6  # of equal width in every joint's measured range
WORST = 20
_POSITION = ["ex_mm", "ey_mm", "ez_mm"]


def select(
    held_out: Mapping[str, np.ndarray], configuration: np.ndarray, fold: np.ndarray
) -> pd.DataFrame:
    """Choose among models by their errors on rows held out of them, the plainest model first.

    Another model is selected where its mean gain exceeds STANDARD_ERRORS standard errors (a
    one-sided paired test over configurations) and its rms over all rows and mean over folds are
    lower as well; of several the one of the lowest rms. The plainest is selected where nothing was
    held out.

    Parameters
    ----------
    held_out
        Errors (n, 6) by kind of model, see ``errors``; rows that a model was not tried on are NaN.
    configuration, fold
        Numbers of the rows, shape (n,).

    Returns
    -------
    pandas.DataFrame
        Table ``model_selection``.
    """
    squared = pd.DataFrame({kind: np.sum(e[:, :3] ** 2, axis=1) for kind, e in held_out.items()})
    plainest, tried = squared.columns[0], squared.dropna()
    configuration, fold = configuration[tried.index], fold[tried.index]
    rms, folds = np.sqrt(tried.mean()), np.sqrt(tried.groupby(fold).mean()).mean()
    less = tried.rsub(tried[plainest], axis=0).groupby(configuration).mean()
    gain, error = less.mean(), less.std() / np.sqrt(len(less))
    if len(less):
        error[plainest] = 0.0
    worth = (gain > STANDARD_ERRORS * error) & (rms < rms[plainest]) & (folds < folds[plainest])
    table = pd.DataFrame(
        {
            "model": squared.columns.astype(object),
            "selected": squared.columns == (rms[worth].idxmin() if worth.any() else plainest),
            "held_out_rms_mm": rms.to_numpy(),
            "mean_of_folds_mm": folds.to_numpy(),
            "gain_mm2": gain.to_numpy(),
            "gain_std_error_mm2": error.to_numpy(),
            "configurations": len(less),
        }
    )
    return table.astype({"selected": int})


def bias(pose_errors: pd.DataFrame, q_rad: np.ndarray) -> Iterator[tuple[Any, ...]]:
    """Yield rows of ``joint_bias``: errors by region of every joint.

    Regions without a row are left out. The standard errors take rows as independent.

    Parameters
    ----------
    pose_errors
        Table ``pose_errors``.
    q_rad
        DH joints of all measured rows, shape (n, k).
    """
    for names, group in pose_errors.groupby(["comparison", "estimate"], sort=False):
        angle = q_rad[group["row"]]
        edges = np.linspace(angle.min(axis=0), angle.max(axis=0), REGIONS + 1)
        region = np.sum(angle[:, None] >= edges[1:-1], axis=1)
        joint = np.broadcast_to(np.arange(angle.shape[1]), angle.shape)
        errors = group[_POSITION].assign(square=np.square(group[_POSITION]).sum(axis=1))
        errors = errors.loc[errors.index.repeat(angle.shape[1])]
        parts = errors.groupby([joint.ravel(), region.ravel()])
        mean, rms = parts[_POSITION].mean(), np.sqrt(parts["square"].mean())
        table = pd.concat([parts.size(), mean, parts[_POSITION].sem(), rms], axis=1)
        for (j, number), *figures in table.itertuples(name=None):
            yield (*names, j + 1, edges[number, j], edges[number + 1, j], *figures)


def worst(pose_errors: pd.DataFrame, line: np.ndarray) -> pd.DataFrame:
    """Table ``worst_rows``: the largest position errors against measurements, ties in file order.

    Parameters
    ----------
    pose_errors
        Table ``pose_errors``.
    line
        Line in the measured file of every row, shape (n,), NaN for none.
    """
    errors = pose_errors[pose_errors["comparison"].str.endswith("_vs_measured")]
    errors = errors.assign(
        error_mm=np.linalg.norm(errors[_POSITION], axis=1), line=line[errors["row"]]
    )
    largest = [
        group.nlargest(WORST, "error_mm").assign(rank=np.arange(1, min(len(group), WORST) + 1))
        for _, group in errors.groupby(["comparison", "estimate"], sort=False)
    ]
    names = ("comparison", "estimate", "rank", "row", "line", "pose", "target", *_POSITION)
    return pd.concat(largest)[[*names, "error_mm"]]
