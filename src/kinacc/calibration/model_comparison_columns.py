"""What models are worth as columns of ``model_selection``, ``joint_bias`` and ``worst_rows``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from kinacc.calibration import model_comparison
from kinacc.calibration.observations import Observations
from kinacc.calibration.residuals import Errors
from kinacc.config.error_models import ERROR_MODELS, MEASURED, NOMINAL, Comparison, comparisons
from kinacc.measurements import folds
from kinacc.tables.columns import Columns
from kinacc.tables.contract import columns_of


def columns(
    measurements: Mapping,
    every: Observations,
    train: np.ndarray,
    seen: Mapping[str, Errors],
    held_out: Mapping[str, Errors],
) -> dict[str, Columns]:
    """The three tables from errors ``seen`` at the rows that ``train`` and ``held_out`` (n,)."""
    bias, worst = [], []
    for reference, name in (
        (each.reference, each.name) for each in comparisons((*ERROR_MODELS, NOMINAL))
    ):
        if name not in seen:
            continue
        for estimate, errors, rows in (
            ("train", seen[name], np.flatnonzero(train)),
            ("cross_validated", held_out[name], np.arange(len(train))),
        ):
            regions = model_comparison.bias(errors, every.q_rad[rows])
            bias += [(name, estimate, *each) for each in regions]
            if reference == MEASURED:
                found = _worst_rows(errors, rows, measurements)
                worst += [(name, estimate, *each) for each in found]
    return {
        "model_selection": selection_columns(every, held_out),
        "joint_bias": columns_of("joint_bias", bias),
        "worst_rows": columns_of("worst_rows", worst),
    }


def selection_columns(every: Observations, held_out: Mapping[str, Errors]) -> Columns:
    """``model_selection`` from errors ``held_out`` of every row."""
    same = folds.configurations(every.pose, every.q_rad)
    names = {kind: Comparison(MEASURED, kind).name for kind in ERROR_MODELS}
    errors = {kind: held_out[name] for kind, name in names.items() if name in held_out}
    found = model_comparison.select(errors, same, every.fold)
    rows = [
        (
            name,
            name == found.selected,
            each.rms_mm,
            each.folds_mm,
            each.gain_mm2,
            each.std_error_mm2 if np.isfinite(each.std_error_mm2) else np.nan,
            found.configurations,
        )
        for name, each in found.standings.items()
    ]
    return columns_of("model_selection", rows)


def _worst_rows(errors: Errors, rows: np.ndarray, measurements: Mapping) -> Iterator[tuple]:
    for rank, index in enumerate(model_comparison.worst(errors), 1):
        row, vector = int(rows[index]), errors.position_mm[index]
        line = float(np.asarray(measurements["row"], dtype=float)[row])
        place = row, line, measurements["pose"][row], measurements["target"][row]
        yield (rank, *place, *vector, float(np.linalg.norm(vector)))
