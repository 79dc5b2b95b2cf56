"""Fits as columns of ``frames``, ``vec_fit``, ``dh_fit`` and what else is known of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kinacc.calibration.fitting import ModelFit
from kinacc.calibration.frames import Frames, stacked
from kinacc.calibration.uncertainty import Uncertainty, scaled_unit
from kinacc.geometry import quaternion_from_rotation
from kinacc.kinematics.tables import frame
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of


def frames_columns(
    frames: Mapping[str, Frames],
    target_names: tuple[str, ...],
    session_names: tuple[str | None, ...] = (None,),
) -> Columns:
    """``frames`` of models by name: the base of every session, then every target."""
    names = [*(("base", session) for session in session_names), *((t, None) for t in target_names)]
    rows = []
    for model, item in frames.items():
        rotation, place = item.poses
        quaternions = quaternion_from_rotation(rotation)
        rows += [
            (model, *name, *at, *quaternion)
            for name, at, quaternion in zip(names, place, quaternions, strict=True)
        ]
    return columns_of("frames", rows)


def frames_of(
    columns: Columns,
    model: str,
    target_names: tuple[str, ...],
    session_names: tuple[str | None, ...] = (None,),
) -> Frames:
    """Base and targets of one model from a table.

    Parameters
    ----------
    columns : Columns
        The table ``frames``.
    model : str
        Kind of the model.
    target_names, session_names : tuple
        Those wanted, in this order.

    Returns
    -------
    Frames
        Base in the instrument's frame, targets in the flange frame, mm.

    Raises
    ------
    InputError
        The table lacks one.
    """
    poses = [frame(columns, model, "base", name) for name in session_names]
    poses += [frame(columns, model, name) for name in target_names]
    return Frames(stacked(poses), len(session_names))


def fit_columns(name: str, fit: ModelFit, uncertainty: Uncertainty) -> Columns:
    """``dh_fit`` or its like: figures, singular values, directions the data do not determine."""
    solution, spectrum, weights = fit.solution, fit.solution.spectrum, fit.weights
    figures = [
        ("parameters", len(solution.x), "1"),
        ("residual_components", solution.count, "1"),
        ("degrees_of_freedom", solution.degrees_of_freedom, "1"),
        ("cost", solution.cost, "mm^2"),
        ("residual_std", np.sqrt(solution.variance), "mm"),
        ("iterations", solution.iterations, "1"),
        ("last_step", solution.last_step, "mm or mrad"),
        ("converged", float(solution.converged), "1"),
    ]
    if spectrum is not None:
        figures += [("rank", spectrum.rank, "1"), ("rank_threshold", spectrum.threshold, "1")]
    if weights is not None:
        figures += [
            ("loss_scale", weights.scale_mm, "mm"),
            ("rows_below_half_weight", int(np.sum(weights.row < 0.5)), "1"),
            ("rows_without_weight", int(np.sum(weights.row == 0.0)), "1"),
        ]
    rows: list[tuple[Any, ...]] = [(name, None, None, value, unit) for name, value, unit in figures]
    if spectrum is not None:
        values = enumerate(spectrum.values, 1)
        rows += [("singular_value", i, None, value, "mm per mm or mrad") for i, value in values]
    rows += [
        ("undetermined_direction", i, parameter, value, scaled_unit(parameter))
        for i, direction in enumerate(uncertainty.undetermined, 1)
        for parameter, value in zip(uncertainty.names, direction, strict=True)
    ]
    return columns_of(name, rows)


def covariance_columns(uncertainty: Uncertainty) -> Columns:
    """``dh_covariance`` or ``vec_covariance``: every pair of parameters once, row by row."""
    first, second = np.tril_indices(len(uncertainty.names))
    names = np.array(uncertainty.names, dtype=object)
    variance = np.maximum(np.diag(uncertainty.covariance), 0.0)
    std = np.where(uncertainty.determined, np.sqrt(variance), np.nan)
    covariance = uncertainty.covariance[first, second]
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.clip(covariance / (std[first] * std[second]), -1.0, 1.0)
    return {
        "parameter": names[first],
        "other": names[second],
        "covariance": covariance,
        "correlation": correlation,
    }
