"""Stages one after another on tables in memory: the same functions the workflow's rules call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from kinacc.artifacts.error_models import ALWAYS
from kinacc.workflow.stages import (
    accuracy_map,
    assessment_points,
    error_model,
    histories,
    measurements,
    residuals,
    study,
    study_chunk,
)

RUNS = {
    "measurements": measurements.run,
    **{kind: partial(error_model.run, kind=kind) for kind in ALWAYS},
    "residuals": residuals.run,
    "accuracy_map": accuracy_map.run,
    "assessment_points": assessment_points.run,
    "study_chunk": study_chunk.run,
    "study": study.run,
    "histories": histories.run,
}


def run(
    names: Sequence[str],
    config: Mapping,
    tables: Mapping,
    extra: Mapping[str, Mapping] | None = None,
) -> dict[str, Mapping]:
    """``tables`` and all that the stages ``names``, in this order, make of them.

    ``config`` is the complete configuration of one data set; ``extra`` are settings by stage that
    no configuration has.
    """
    found = dict(tables)
    for name in names:
        found |= RUNS[name](found, {**config, **(extra or {}).get(name, {})})
    return found


def without_folds(measurements: Mapping) -> dict[str, np.ndarray]:
    """Columns of ``measurements`` with no fold named, so that nothing is cross-validated.

    Rows that train stay those that train: the delivered fits and their tables are the same.
    """
    return {**measurements, "fold": np.full(len(measurements["pose"]), np.nan)}


def lean(name: str, config: Mapping, tables: Mapping) -> dict[str, Mapping]:
    """What a stage makes where only claims are wanted: without folds and further readings.

    No claim is about held-out poses or other readings than the configured one.
    """
    made = RUNS[name](tables, {**config, "all_readings": False})
    if name == "measurements":
        made = {**made, name: without_folds(made[name])}
    return made
