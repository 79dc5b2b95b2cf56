"""Fits as columns of ``frames``, ``vec_fit``, ``dh_fit`` and what else is known of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from kinacc.calibration.fitting import ModelFit
from kinacc.calibration.frames import Frames, stacked
from kinacc.calibration.solve import Solution
from kinacc.calibration.split import Spectrum
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
    rows = []
    for model, each in frames.items():
        for session, at, turned in zip(
            session_names, each.bases.position_mm, each.bases.rotation, strict=True
        ):
            rows.append((model, "base", session, *at, *quaternion_from_rotation(turned)))
        for name, at, turned in zip(
            target_names, each.targets.position_mm, each.targets.rotation, strict=True
        ):
            rows.append((model, name, None, *at, *quaternion_from_rotation(turned)))
    return columns_of("frames", rows)


def frames_of(
    columns: Mapping,
    model: str,
    target_names: tuple[str, ...],
    session_names: tuple[str | None, ...] = (None,),
) -> Frames:
    """The ``Frames`` of one model in a ``frames`` table. Raises InputError for a missing one."""
    bases = [frame(columns, model, "base", name) for name in session_names]
    targets = [frame(columns, model, name) for name in target_names]
    return Frames(stacked(bases), stacked(targets))


def vec_fit_columns(fit: ModelFit, gauge: Spectrum, uncertainty: Uncertainty) -> Columns:
    """``vec_fit``: figures of the fit, the prior of every coefficient, singular values.

    And the directions of base and targets that the data do not determine.
    """
    rows = [*_solution_rows(fit.solution), *_spectrum_rows(gauge)]
    names = fit.model.names
    units = ["mm" if "delta" in name else "rad" for name in names]
    rows += [
        ("prior_std", number, name, value, unit)
        for number, (name, value, unit) in enumerate(
            zip(names, fit.prior_std, units, strict=True), 1
        )
    ]
    return columns_of("vec_fit", [*rows, *_undetermined_rows(uncertainty)])


def fit_columns(name: str, fit: ModelFit, uncertainty: Uncertainty) -> Columns:
    """``dh_fit`` or its like: figures, singular values, directions the data do not determine."""
    rows = [*_solution_rows(fit.solution), *_spectrum_rows(fit.solution.spectrum)]
    if fit.weights is not None:
        rows += [
            ("loss_scale", None, None, fit.weights.scale_mm, "mm"),
            ("rows_below_half_weight", None, None, int(np.sum(fit.weights.row < 0.5)), "1"),
            ("rows_without_weight", None, None, int(np.sum(fit.weights.row == 0.0)), "1"),
        ]
    return columns_of(name, [*rows, *_undetermined_rows(uncertainty)])


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
        "correlation": np.where(np.isfinite(correlation), correlation, np.nan),
    }


def _solution_rows(solution: Solution) -> Iterable[tuple]:
    yield ("parameters", None, None, len(solution.x), "1")
    yield ("residual_components", None, None, solution.count, "1")
    yield ("degrees_of_freedom", None, None, solution.degrees_of_freedom, "1")
    yield ("cost", None, None, solution.cost, "mm^2")
    yield ("residual_std", None, None, np.sqrt(solution.variance), "mm")
    yield ("iterations", None, None, solution.iterations, "1")
    yield ("last_step", None, None, solution.last_step, "mm or mrad")
    yield ("converged", None, None, float(solution.converged), "1")


def _undetermined_rows(uncertainty: Uncertainty) -> Iterable[tuple]:
    for number, direction in enumerate(uncertainty.undetermined, 1):
        for name, value in zip(uncertainty.names, direction, strict=True):
            yield ("undetermined_direction", number, name, value, scaled_unit(name))


def _spectrum_rows(spectrum: Spectrum | None) -> Iterable[tuple]:
    if spectrum is None:
        return
    yield ("rank", None, None, spectrum.rank, "1")
    yield ("rank_threshold", None, None, spectrum.threshold, "1")
    yield ("gap", None, None, spectrum.gap if np.isfinite(spectrum.gap) else np.nan, "1")
    for number, value in enumerate(spectrum.values, 1):
        yield ("singular_value", number, None, value, "mm per mm or mrad")
