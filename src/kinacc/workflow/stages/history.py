"""Hold the calibrations of a series to one another: what became of the arm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import reduce
from pathlib import Path

import numpy as np

from kinacc.artifacts import store
from kinacc.artifacts.columns import Columns
from kinacc.artifacts.error_models import MEASURED, Comparison
from kinacc.calibration.observations import from_columns
from kinacc.campaign import of_calibration
from kinacc.deployment import drift, folder
from kinacc.kinematics import robot


def run(inputs: Mapping, settings: Mapping) -> dict[str, Columns]:
    """``history``: a row for each line, by ``<line>/<table>`` of its calibration, by date."""
    weight = settings["calibration"]["rotation_weight_mm_per_rad"]
    return {"history": drift.history([*_sessions(inputs, settings)], weight, settings["seed"])}


def _sessions(inputs: Mapping, settings: Mapping) -> Iterator[drift.Session]:
    tolerance_mm = settings.get("tolerance", {}).get("mm", np.nan)  # left out where none is set
    campaigns = [each.parent for role, each in sorted(inputs.items()) if "/campaign_" in role]
    for line in settings["series"]:
        tables = {
            role.removeprefix(f"{line['name']}/"): each
            for role, each in inputs.items()
            if role.startswith(f"{line['name']}/") and not isinstance(each, Path)
        }
        arm = robot.of_text(str(tables["robot"]["description"][0]), "robot.parquet")
        calibration = folder.calibration(tables, arm, name=line["name"])
        measured = tables["measurements"]
        yield drift.Session(
            name=line["name"],
            date=line["date"],
            digest=store.digest_of("measurements", measured),
            base=line["base"],
            tool=line["tool"],
            calibration=calibration,
            observations=from_columns(measured, arm),
            held_out_mm=_held_out_mm(tables["pose_errors"], calibration.choice),
            temperature_c=_mean(measured.get("temperature_c", ())),
            bound_mm=of_calibration.finished(tables, calibration.choice, campaigns),
            tolerance_mm=tolerance_mm,
        )


def _held_out_mm(errors: Mapping, model: str) -> np.ndarray:
    """Position errors (m,) of a model where every one was tried, as ``kinacc fitted`` has them."""
    held = np.asarray(errors["estimate"]) == "cross_validated"
    kind, row = np.asarray(errors["comparison"])[held], np.asarray(errors["row"])[held]
    tried = [row[kind == each] for each in dict.fromkeys(kind)]
    common = reduce(np.intersect1d, tried) if tried else row
    ours = (kind == Comparison(MEASURED, model).name) & np.isin(row, common)
    return np.linalg.norm([np.asarray(errors[f"e{axis}_mm"])[held][ours] for axis in "xyz"], axis=0)


def _mean(values: np.ndarray) -> float:
    stated = np.asarray(values, dtype=float)
    stated = stated[np.isfinite(stated)]
    return float(stated.mean()) if len(stated) else np.nan
