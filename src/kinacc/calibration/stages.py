"""Stages of a calibration: fit a model, compare models with measurements, excluded rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from kinacc.calibration import identifiability, residuals, tables, uncertainty
from kinacc.calibration.fitting import Fit
from kinacc.calibration.models import estimators, fit_all
from kinacc.calibration.observations import Observations, from_columns
from kinacc.calibration.residuals import errors, statistics
from kinacc.config.error_models import (
    ERROR_MODELS,
    MEASURED,
    NOMINAL,
    PLAINEST,
    Comparison,
    comparisons,
)
from kinacc.config.records import Settings
from kinacc.kinematics import robot
from kinacc.kinematics import tables as models
from kinacc.kinematics.robot import Robot
from kinacc.measurements import folds
from kinacc.measurements.reader import excluded_lines, read_excluded
from kinacc.measurements.row_names import RowNames
from kinacc.progress import with_progress
from kinacc.tables.columns import Columns, Tables
from kinacc.tables.contract import columns_of

_OFF = ("ex_mm", "ey_mm", "ez_mm", "rx_mrad", "ry_mrad", "rz_mrad")


def fit_model(
    inputs: Tables,
    settings: Settings,
    kind: str,
) -> Tables:
    """Fit the model of one kind to the training rows.

    The plainest kind, which is fitted last, gathers the ``frames`` of all models.

    Parameters
    ----------
    inputs : mapping
        Tables ``measurements`` and those of models fitted before.
    settings : mapping
        Sections ``robot`` and ``calibration`` of the configuration.
    kind : str
        ``vec``, ``dh``, ``compliance`` or a registered one.

    Returns
    -------
    dict
        ``<kind>_model``, its covariance, its frames and the further tables of its estimator.

    Raises
    ------
    FitError
        The fit does not converge.
    InputError
        There are fewer residuals than parameters, or a rule is about a frame that is not there.
    """
    arm = robot.load(settings["robot"])
    every, train = observed(inputs, arm)
    estimator = estimators(settings["calibration"], arm, every)[kind]
    choices = estimator.choices(every)
    held_out = sorted({*every.fold[~train].tolist()})
    estimator = estimator.chosen(choices, next(iter(held_out), None))
    observations = every.select(train)
    fitted = estimator.fit(observations, delivered_fits(inputs, arm, every))
    names, known = (every.target_names, every.session_names), uncertainty.of_fit(fitted)
    written = {
        f"{kind}_model": fitted.model.to_columns(fitted.std.ravel()),
        f"{kind}_covariance": tables.covariance_columns(known),
        f"{kind}_fit": tables.fit_columns(f"{kind}_fit", fitted, known),
        **choices,
    }
    frames = {kind: fitted.frames}
    if kind != PLAINEST:
        return written | {f"{kind}_frames": tables.frames_columns(frames, *names)}
    frames[NOMINAL] = estimator.common.nominal_frames(observations)
    kinds = [f"{other}_frames" for other in reversed(ERROR_MODELS)]
    parts = [inputs[name] for name in kinds if name in inputs]
    parts.append(tables.frames_columns(frames, *names))
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[-1]}
    identified = identifiability.identified(fitted, known, observations)
    return written | {"frames": columns, "dh_identified": identified}


def compare_models(
    inputs: Tables,
    settings: Settings,
) -> Tables:
    """Errors of every comparison, in sample and held out, and the model selected by them.

    Train rows are of the delivered models at the rows they were fitted to. Validation rows are of
    rows held out: pooled over all folds, each fold refitted without its rows, and fold by fold.

    Parameters
    ----------
    inputs : mapping
        Tables ``measurements``, of models and of frames, and ``vec_orders``.
    settings : mapping
        Sections ``robot`` and ``calibration`` of the configuration.

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
    folds = with_progress(numbers, "shares of the poses held out")
    held_out, trained = residuals.cross_validated(every, refit, folds, delivered)
    rows: list[tuple[Any, ...]] = []
    parts = []
    for name, fitted in errors(delivered, every.select(train)).items():
        out = held_out[name]
        rows += _statistics(name, "train", np.nan, fitted)
        for fold in numbers:
            rows += _statistics(name, "train", fold, trained[fold][name])
        rows += _statistics(name, "validation", np.nan, out)
        for fold in numbers:
            rows += _statistics(name, "validation", fold, out[every.fold == fold])
        parts.append(_error_rows(measurements, name, "train", np.flatnonzero(train), fitted))
        there = np.flatnonzero(np.isfinite(out[:, 0]))
        parts.append(_error_rows(measurements, name, "cross_validated", there, out[there]))
    pose_errors = pd.concat(parts, ignore_index=True)
    frames = {
        "pose_errors": pose_errors,
        "model_selection": selection(every, held_out),
        "worst_rows": residuals.worst(pose_errors, np.asarray(measurements["row"], float)),
    }
    return {
        "residuals": columns_of("residuals", rows),
        "joint_bias": columns_of("joint_bias", residuals.bias(pose_errors, every.q_rad)),
        **{name: {c: table[c].to_numpy() for c in table} for name, table in frames.items()},
    }


def excluded_rows(inputs: Tables, settings: Settings) -> Tables:
    """Errors of the delivered models at the rows left out, which no fit has used.

    Parameters
    ----------
    inputs : mapping
        Tables ``measurements``, of models and of frames.
    settings : mapping
        Sections ``robot`` and ``measurements`` of the configuration.

    Returns
    -------
    dict
        ``excluded_rows``: the reason of every row and its errors in mm and mrad in the robot base,
        null where a row cannot be read or where no other row has its target and session.
    """
    arm, section = robot.load(settings["robot"]), settings["measurements"]["file"]
    reasons, used = excluded_lines(section), inputs["measurements"]
    reading = read_excluded(section, arm)
    rows = pd.DataFrame(dict(reading.columns)) if reading else pd.DataFrame(columns=list(used))
    rows = rows.assign(session=rows.get("session"))  # a file may have none
    for name in ("target", "session"):  # only those of other rows have frames
        rows = rows[rows[name].map(str).isin({*map(str, used[name])})]  # None as well
    off: dict[str, np.ndarray] = {}
    if len(rows):
        observations = from_columns({name: rows[name].to_numpy() for name in rows}, arm)
        off = errors(delivered_fits(inputs, arm, observations), observations)
    known = rows[["target", "session"]].assign(line=rows["row"].astype(int))
    stated = pd.DataFrame(sorted(reasons.items()), columns=["line", "reason"])
    parts = []
    for comparison in comparisons(models.models(inputs, arm.dh)):
        known[list(_OFF)] = off[comparison.name] if off else np.nan
        parts.append(stated.merge(known, "left", on="line").assign(comparison=comparison.name))
    table = pd.concat(parts).astype(object)
    table = table.where(table.notna(), None)
    columns = columns_of("excluded_rows", table.to_dict("records"))
    row_names = RowNames() if reading is None else reading.row_names
    return {"excluded_rows": columns | row_names.columns(columns["line"])}


def observed(inputs: Tables, robot: Robot) -> tuple[Observations, np.ndarray]:
    """All observations of ``measurements`` and the mask (n,) of the rows that train."""
    columns = inputs["measurements"]
    return from_columns(columns, robot), np.asarray(columns["subset"]) == "train"


def delivered_fits(inputs: Tables, robot: Robot, every: Observations) -> dict[str, Fit]:
    """The models ``inputs`` have with their frames, for targets and sessions of ``every``."""
    names, fits = (every.target_names, every.session_names), {}
    for kind, model in models.models(inputs, robot.dh).items():
        frames = inputs.get("frames", inputs.get(f"{kind}_frames"))
        if frames is not None:
            fits[kind] = Fit(model, tables.frames_of(frames, kind, *names))
    return fits


def selection(every: Observations, held_out: Mapping[str, np.ndarray]) -> pd.DataFrame:
    """``model_selection`` from errors ``held_out`` of every row, by name of the comparison."""
    names = {kind: Comparison(MEASURED, kind).name for kind in ERROR_MODELS}
    of_kinds = {kind: held_out[name] for kind, name in names.items() if name in held_out}
    configuration = folds.configurations(every.pose, every.q_rad)
    return residuals.select(of_kinds, configuration, every.fold)


def _statistics(name: str, subset: str, fold: float, off: np.ndarray) -> Iterator[tuple[Any, ...]]:
    """Rows of ``residuals``."""
    parts = zip(("position", "orientation"), ("mm", "mrad"), np.hsplit(off, 2), strict=True)
    for quantity, unit, vectors in parts:
        figures = statistics(vectors)
        if figures is not None:
            yield (name, subset, fold, quantity, unit, *figures)


def _error_rows(
    measurements: Columns, comparison: str, estimate: str, rows: np.ndarray, off: np.ndarray
) -> pd.DataFrame:
    """``pose_errors`` of the ``rows`` of measurements that the errors are of."""
    table = pd.DataFrame({"comparison": comparison, "estimate": estimate, "row": rows})
    for name in ("pose", "target", "repeat", "subset", "fold"):
        table[name] = np.asarray(measurements[name])[rows]
    table[list(_OFF)] = off
    return table
