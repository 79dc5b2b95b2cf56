"""Hold the calibrations of a series to one another: what became of the arm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinacc.campaign import of_calibration
from kinacc.deployment.history import Session, history, session_of
from kinacc.tables import store
from kinacc.tables.columns import Columns


def run(inputs: Mapping, settings: Mapping) -> dict[str, Columns]:
    """``history``: a row for each line, by ``<line>/<table>`` of its calibration, by date."""
    weight = settings["calibration"]["rotation_weight_mm_per_rad"]
    return {"history": history([*_sessions(inputs, settings)], weight, settings["seed"])}


def _sessions(inputs: Mapping, settings: Mapping) -> Iterator[Session]:
    tolerance_mm = settings["tolerance"]["mm"]
    tolerance_mm = np.nan if tolerance_mm is None else tolerance_mm
    campaigns = [value.parent for role, value in sorted(inputs.items()) if "/campaign_" in role]
    for line in settings["series"]:
        tables = {
            role.removeprefix(f"{line['name']}/"): value
            for role, value in inputs.items()
            if role.startswith(f"{line['name']}/") and not isinstance(value, Path)
        }
        session = session_of(tables, line["name"], line["date"], line["base"], line["tool"])
        yield replace(
            session,
            digest=store.digest_of("measurements", tables["measurements"]),
            bound_mm=of_calibration.finished(tables, session.calibration.choice, campaigns),
            tolerance_mm=tolerance_mm,
        )
