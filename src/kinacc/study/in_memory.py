"""Stages one after another on tables in memory: the same functions the workflow's rules call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from kinacc.calibration import stages
from kinacc.config.error_models import ALWAYS
from kinacc.config.records import Settings
from kinacc.study import evaluation, histories, monte_carlo
from kinacc.synthetic import source
from kinacc.tables.columns import Columns, Tables

RUNS: dict[str, Callable[..., Tables]] = {
    "measurements": source.run,
    **{kind: partial(stages.fit_model, kind=kind) for kind in ALWAYS},
    "residuals": stages.compare_models,
    "accuracy_map": evaluation.mapped,
    "assessment_points": evaluation.points,
    "study_chunk": monte_carlo.simulated,
    "study": monte_carlo.summed_up,
    "histories": histories.run,
}


def run(names: Sequence[str], config: Settings, tables: Tables) -> Tables:
    """``tables`` and all that the stages ``names``, in this order, make of them.

    ``config`` is the complete configuration of one data set.
    """
    results = dict(tables)
    for name in names:
        results |= RUNS[name](results, config)
    return results


def without_folds(measurements: Columns) -> dict[str, np.ndarray]:
    """Columns of ``measurements`` with no fold named, so that nothing is cross-validated.

    Rows that train stay those that train: the delivered fits and their tables are the same.
    """
    return {**measurements, "fold": np.full(len(measurements["pose"]), np.nan)}


def lean(name: str, config: Settings, tables: Tables) -> Tables:
    """What a stage makes where only claims are wanted: without folds and further readings.

    No claim is about held-out poses or other readings than the configured one.
    """
    results = RUNS[name](tables, {**config, "all_readings": False})
    if name == "measurements":
        results = {**results, name: without_folds(results[name])}
    return results
