"""Compare models and measurements: statistics and error vectors, in sample and cross-validated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from kinacc.calibration import model_comparison_columns
from kinacc.calibration.delivered import delivered_fits, observed
from kinacc.calibration.models import Fit, estimators, fit_all
from kinacc.calibration.observations import Observations
from kinacc.calibration.residuals import Errors, cross_validated, errors, statistics
from kinacc.kinematics import robot
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of

_QUANTITIES = (("position", "mm", 1.0), ("orientation", "mrad", 1e3))


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, Columns]:
    """``residuals``, ``pose_errors`` and what follows from them of every comparison.

    Train rows are of the delivered models at the rows they were fitted to. Validation rows are of
    rows held out: pooled over all folds, each fold refitted without its rows, and fold by fold.
    """
    arm = robot.load(settings["robot"])
    every, train = observed(inputs, arm)
    delivered = delivered_fits(inputs, arm, every)
    fitted_by = {
        kind: each
        for kind, each in estimators(settings["calibration"], arm, every).items()
        if kind in delivered
    }

    def refit(observations: Observations, fold: int) -> dict[str, Fit]:
        if np.array_equal(every.fold != fold, train):
            return delivered
        own = [each.chosen(inputs, fold) for each in fitted_by.values()]
        return fit_all(observations, own)

    folds = [int(fold) for fold in np.unique(every.fold) if fold >= 0]
    counted = progress(folds, "shares of the poses held out") if progress else folds
    held_out, trained = cross_validated(every, refit, counted, delivered)
    seen = errors(delivered, every.select(train))
    return {
        "residuals": _residuals(every.fold, folds, seen, held_out, trained),
        "pose_errors": _pose_errors(inputs["measurements"], train, seen, held_out, bool(folds)),
        **model_comparison_columns.columns(inputs["measurements"], every, train, seen, held_out),
    }


def _residuals(
    fold: np.ndarray,
    folds: list[int],
    seen: dict[str, Errors],
    held_out: dict[str, Errors],
    trained: dict[int, dict[str, Errors]],
) -> Columns:
    rows: list[tuple] = []
    for name in seen:
        rows += _statistics_rows(name, "train", np.nan, seen[name])
        for number in folds:
            rows += _statistics_rows(name, "train", number, trained[number][name])
        rows += _statistics_rows(name, "validation", np.nan, held_out[name])
        for number in folds:
            part = held_out[name].select(fold == number)
            rows += _statistics_rows(name, "validation", number, part)
    return columns_of("residuals", rows)


def _statistics_rows(name: str, subset: str, fold: float, found: Errors) -> Iterator[tuple]:
    vectors = {"position": found.position_mm, "orientation": found.rotation_rad}
    for quantity, unit, factor in _QUANTITIES:
        figures = statistics(factor * vectors[quantity])
        if figures is not None:
            values = figures.n, figures.mean, figures.max, figures.rms, figures.gamma99
            yield (name, subset, fold, quantity, unit, *values)


def _pose_errors(
    measurements: Mapping,
    train: np.ndarray,
    seen: dict[str, Errors],
    held_out: dict[str, Errors],
    any_folds: bool,
) -> Columns:
    parts = []
    for name in seen:
        parts.append(_error_rows(measurements, name, "train", np.flatnonzero(train), seen[name]))
        if any_folds:
            rows = np.flatnonzero(np.isfinite(held_out[name].position_mm[:, 0]))
            found = held_out[name].select(rows)
            parts.append(_error_rows(measurements, name, "cross_validated", rows, found))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _error_rows(
    measurements: Mapping, comparison: str, estimate: str, rows: np.ndarray, found: Errors
) -> Columns:
    copied = {
        name: np.asarray(measurements[name])[rows]
        for name in ("pose", "target", "repeat", "subset", "fold")
    }
    return {
        "comparison": np.full(len(rows), comparison, dtype=object),
        "estimate": np.full(len(rows), estimate, dtype=object),
        "row": rows,
        **copied,
        **{f"e{axis}_mm": found.position_mm[:, i] for i, axis in enumerate("xyz")},
        **{f"r{axis}_mrad": 1e3 * found.rotation_rad[:, i] for i, axis in enumerate("xyz")},
    }
