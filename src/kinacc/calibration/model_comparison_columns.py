"""What models are worth as columns of ``model_selection``, ``joint_bias`` and ``worst_rows``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from kinacc.artifacts.allowed import SELECTABLE
from kinacc.calibration import model_comparison
from kinacc.calibration.models import COMPARISONS, MEASURED, Comparison
from kinacc.calibration.observations import Observations
from kinacc.calibration.residuals import Errors
from kinacc.measurements import folds

Columns = dict[str, np.ndarray]
_SAME_CONFIGURATION_RAD = np.deg2rad(0.1)
_TEXTS = {"comparison", "estimate", "target"}
_BIAS = ("comparison", "estimate", "joint", "from_rad", "to_rad", "n", "ex_mm", "ey_mm", "ez_mm")
_BIAS += ("std_error_x_mm", "std_error_y_mm", "std_error_z_mm", "rms_mm")
_WORST = ("comparison", "estimate", "rank", "row", "line", "pose", "target")
_WORST += ("ex_mm", "ey_mm", "ez_mm", "error_mm")


def columns(
    measurements: Mapping,
    every: Observations,
    train: np.ndarray,
    seen: Mapping[str, Errors],
    held_out: Mapping[str, Errors],
) -> dict[str, Columns]:
    """The three tables from errors ``seen`` at the rows that ``train`` and ``held_out`` (n,)."""
    bias, worst = [], []
    for name, reference in ((each.name, each.reference) for each in COMPARISONS):
        for estimate, errors, rows in (
            ("train", seen[name], np.flatnonzero(train)),
            ("cross_validated", held_out[name], np.arange(len(train))),
        ):
            bias += [(name, estimate, *each) for each in _bias_rows(errors, every.q_rad[rows])]
            if reference == MEASURED:
                found = _worst_rows(errors, rows, measurements)
                worst += [(name, estimate, *each) for each in found]
    return {
        "model_selection": selection_columns(every, held_out),
        "joint_bias": _table(_BIAS, bias),
        "worst_rows": _table(_WORST, worst),
    }


def selection_columns(every: Observations, held_out: Mapping[str, Errors]) -> Columns:
    """``model_selection`` from errors ``held_out`` of every row."""
    same = folds.configurations(every.pose, every.q_rad, _SAME_CONFIGURATION_RAD)
    errors = {name: held_out[Comparison(MEASURED, name).name] for name in SELECTABLE}
    found = model_comparison.select(errors, same, every.fold)
    standings = found.standings.values()
    gain_error = np.array([each.std_error_mm2 for each in standings])
    return {
        "model": np.array(SELECTABLE, dtype=object),
        "selected": np.array([int(name == found.selected) for name in SELECTABLE]),
        "held_out_rms_mm": np.array([each.rms_mm for each in standings]),
        "mean_of_folds_mm": np.array([each.folds_mm for each in standings]),
        "gain_mm2": np.array([each.gain_mm2 for each in standings]),
        "gain_std_error_mm2": np.where(np.isfinite(gain_error), gain_error, np.nan),
        "configurations": np.full(len(standings), found.configurations),
    }


def _bias_rows(errors: Errors, q_rad: np.ndarray) -> Iterator[tuple]:
    for each in model_comparison.bias(errors, q_rad):
        span = each.joint + 1, each.low_rad, each.high_rad, each.n
        yield (*span, *each.mean_mm, *each.std_error_mm, each.rms_mm)


def _worst_rows(errors: Errors, rows: np.ndarray, measurements: Mapping) -> Iterator[tuple]:
    for rank, index in enumerate(model_comparison.worst(errors), 1):
        row, vector = int(rows[index]), errors.position_mm[index]
        line = float(np.asarray(measurements["row"], dtype=float)[row])
        place = row, line, measurements["pose"][row], measurements["target"][row]
        yield (rank, *place, *vector, float(np.linalg.norm(vector)))


def _table(names: tuple[str, ...], rows: list[tuple]) -> Columns:
    return {
        name: np.array([row[i] for row in rows], dtype=object if name in _TEXTS else float)
        for i, name in enumerate(names)
    }
