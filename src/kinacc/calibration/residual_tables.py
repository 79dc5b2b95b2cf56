"""Compare models and measurements: statistics and error vectors, in sample and cross-validated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import astuple

import numpy as np
import pandas as pd

from kinacc.calibration import model_comparison
from kinacc.calibration.delivered import delivered_fits, observed
from kinacc.calibration.models import Fit, estimators, fit_all
from kinacc.calibration.observations import Observations
from kinacc.calibration.residuals import Errors, cross_validated, errors, statistics
from kinacc.config.error_models import ERROR_MODELS, MEASURED, Comparison
from kinacc.kinematics import robot
from kinacc.measurements import folds
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, Columns]:
    """Errors of every comparison, in sample and held out, and what follows from them.

    Train rows are of the delivered models at the rows they were fitted to. Validation rows are of
    rows held out: pooled over all folds, each fold refitted without its rows, and fold by fold.

    Parameters
    ----------
    inputs : mapping
        Tables ``measurements``, of models and of frames, and ``vec_orders``.
    settings : mapping
        Sections ``robot`` and ``calibration`` of the configuration.
    progress : callable, optional
        Wraps an iterable to show how far the folds are, with a label.

    Returns
    -------
    dict
        ``residuals``, ``pose_errors``, ``joint_bias``, ``model_selection``, ``worst_rows``; mm,
        mrad.

    Raises
    ------
    FitError
        A fit without a fold does not converge.
    """
    arm, measurements = robot.load(settings["robot"]), inputs["measurements"]
    every, train = observed(inputs, arm)
    delivered = delivered_fits(inputs, arm, every)
    kinds = estimators(settings["calibration"], arm, every)

    def refit(observations: Observations, fold: int) -> dict[str, Fit]:
        if np.array_equal(every.fold != fold, train):
            return delivered
        chosen = [e.chosen(inputs, fold) for kind, e in kinds.items() if kind in delivered]
        return fit_all(observations, chosen)

    numbers = [int(fold) for fold in np.unique(every.fold) if fold >= 0]
    counted = progress(numbers, "shares of the poses held out") if progress else numbers
    held_out, trained = cross_validated(every, refit, counted, delivered)
    fitted = errors(delivered, every.select(train))
    rows, parts = [], []
    for name in fitted:
        rows += _statistics(name, "train", np.nan, fitted[name])
        for fold in numbers:
            rows += _statistics(name, "train", fold, trained[fold][name])
        rows += _statistics(name, "validation", np.nan, held_out[name])
        for fold in numbers:
            out = held_out[name].select(every.fold == fold)
            rows += _statistics(name, "validation", fold, out)
        parts.append(error_rows(measurements, name, "train", np.flatnonzero(train), fitted[name]))
        there = np.flatnonzero(np.isfinite(held_out[name].position_mm[:, 0]))
        out = held_out[name].select(there)
        parts.append(error_rows(measurements, name, "cross_validated", there, out))
    pose_errors = pd.concat(parts, ignore_index=True)
    tables = {
        "pose_errors": pose_errors,
        "model_selection": selection(every, held_out),
        "worst_rows": model_comparison.worst(pose_errors, np.asarray(measurements["row"], float)),
    }
    return {
        "residuals": columns_of("residuals", rows),
        "joint_bias": columns_of("joint_bias", model_comparison.bias(pose_errors, every.q_rad)),
        **{name: {c: table[c].to_numpy() for c in table} for name, table in tables.items()},
    }


def selection(every: Observations, held_out: Mapping[str, Errors]) -> pd.DataFrame:
    """``model_selection`` from errors ``held_out`` of every row, by name of the comparison."""
    names = {kind: Comparison(MEASURED, kind).name for kind in ERROR_MODELS}
    of_kinds = {kind: held_out[name] for kind, name in names.items() if name in held_out}
    configuration = folds.configurations(every.pose, every.q_rad)
    return model_comparison.select(of_kinds, configuration, every.fold)


def _statistics(name: str, subset: str, fold: float, off: Errors) -> Iterator[tuple]:
    """Rows of ``residuals``."""
    for quantity, unit, vectors in (
        ("position", "mm", off.position_mm),
        ("orientation", "mrad", 1e3 * off.rotation_rad),
    ):
        figures = statistics(vectors)
        if figures is not None:
            yield (name, subset, fold, quantity, unit, *astuple(figures))


def error_rows(
    measurements: Mapping, comparison: str, estimate: str, rows: np.ndarray, off: Errors
) -> pd.DataFrame:
    """``pose_errors`` of the ``rows`` of measurements that the errors are of."""
    table = pd.DataFrame({"comparison": comparison, "estimate": estimate, "row": rows})
    for name in ("pose", "target", "repeat", "subset", "fold"):
        table[name] = np.asarray(measurements[name])[rows]
    table[["ex_mm", "ey_mm", "ez_mm"]] = off.position_mm
    table[["rx_mrad", "ry_mrad", "rz_mrad"]] = 1e3 * off.rotation_rad
    return table
