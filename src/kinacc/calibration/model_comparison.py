"""What a model is worth: which one to use, where it is biased, the rows it fits worst."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd

from kinacc.calibration.residuals import Errors

STANDARD_ERRORS = 2.0  # by which a gain must exceed zero
REGIONS = 6  # of equal width in every joint's measured range
WORST = 20
_POSITION = ["ex_mm", "ey_mm", "ez_mm"]


def select(
    held_out: Mapping[str, Errors], configuration: np.ndarray, fold: np.ndarray
) -> pd.DataFrame:
    """Choose among models by their errors on rows held out of them, the plainest model first.

    Another model is selected where its mean gain exceeds STANDARD_ERRORS standard errors (a
    one-sided paired test over configurations) and its rms over all rows and mean over folds are
    lower as well; of several the one of the lowest rms. The plainest is selected where nothing was
    held out.

    Parameters
    ----------
    held_out
        Errors by kind of model; rows that a model was not tried on are NaN.
    configuration, fold
        Numbers of the rows, shape (n,).

    Returns
    -------
    pandas.DataFrame
        Table ``model_selection``.
    """
    squared = pd.DataFrame({kind: np.sum(e.position_mm**2, axis=1) for kind, e in held_out.items()})
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


def bias(pose_errors: pd.DataFrame, q_rad: np.ndarray) -> Iterator[tuple]:
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
        vectors = group[_POSITION].to_numpy()
        for joint, angle in enumerate(q_rad[group["row"]].T, 1):
            edges = np.linspace(angle.min(), angle.max(), REGIONS + 1)
            region = np.clip(np.searchsorted(edges, angle, side="right") - 1, 0, REGIONS - 1)
            for number in np.unique(region):
                part = vectors[region == number]
                error = np.full(3, np.nan)
                if len(part) > 1:
                    error = part.std(axis=0, ddof=1) / np.sqrt(len(part))
                rms = float(np.sqrt(np.mean(np.sum(part**2, axis=1))))
                span = edges[number], edges[number + 1]
                yield (*names, joint, *span, len(part), *part.mean(axis=0), *error, rms)


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
