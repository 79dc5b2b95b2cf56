"""Stages one after another on tables in memory: the same functions the workflow's rules call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kinacc.stages import (
    accuracy_map,
    assessment_points,
    dh,
    histories,
    measurements,
    residuals,
    study,
    study_chunk,
    vec,
)
from kinacc.stages.plan import Plan

_DATASET = "draw"

# Named one by one, so that whatever runs stages in memory depends on their code.
RUNS = {
    "measurements": measurements.run,
    "vec": vec.run,
    "dh": dh.run,
    "residuals": residuals.run,
    "accuracy_map": accuracy_map.run,
    "assessment_points": assessment_points.run,
    "study_chunk": study_chunk.run,
    "study": study.run,
    "histories": histories.run,
}


def run(names: Sequence[str], config: Mapping, tables: Mapping) -> dict[str, Mapping]:
    """``tables`` and all that the stages ``names``, in this order, make of them.

    ``config`` is the complete configuration of one data set.
    """
    plan = Plan({_DATASET: config}, {_DATASET: 1}, ())
    found = dict(tables)
    for name in names:
        found |= RUNS[name](found, plan.settings(name, _DATASET))
    return found
