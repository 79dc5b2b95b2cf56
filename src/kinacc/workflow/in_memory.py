"""Stages one after another on tables in memory: the same functions the workflow's rules call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from importlib import import_module

import numpy as np

from kinacc.artifacts.error_models import ALWAYS
from kinacc.artifacts.provenance import config_hash
from kinacc.config.records import value_at
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

# Named one by one, so that whatever runs stages in memory depends on their code.
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


class Memory:
    """Stages of many configurations, one after another: what two of them share is made once.

    A stage is made anew where a setting it depends on differs, or where what it reads was made
    anew, as in the workflow. No claim is about held-out poses or other readings than the
    configured one: both are left out to save their time.
    """

    def __init__(self, kept: int = 32) -> None:
        """``kept``: how many results of a stage are held at a time."""
        self.kept = kept
        self.made: dict[str, dict[tuple, dict]] = {}

    def fill(self, tables: dict, names: Sequence[str], config: Mapping) -> None:
        """Add to ``tables``, empty at first, what the stages ``names`` make under ``config``.

        Where a stage raises InputError, ``tables`` holds what those before it made.
        """
        origin: dict[str, tuple] = {}
        for name in names:
            stage = _stages()[name]
            read = [each for each in (*stage.inputs, *stage.optional) if each in origin]
            key = (config_hash(settings_of(name, config)), *(origin[each] for each in read))
            known = self.made.setdefault(name, {})
            known[key] = known.pop(key) if key in known else _lean(name, config, tables)
            for old in list(known)[: -self.kept]:
                del known[old]
            tables |= known[key]
            origin |= dict.fromkeys(stage.outputs, (name, key))


def settings_of(name: str, config: Mapping) -> dict[str, object]:
    """What a stage of :class:`Memory` depends on, by the key paths that the catalogue names."""
    stage = _stages()[name]
    synthetic = config["measurements"]["source"] == "synthetic"
    paths = (*stage.settings, *(stage.synthetic_settings if synthetic else ()))
    if name == "study_chunk":  # the only reading simulated is the one that the study is about
        paths += _stages()["study"].settings
    return {path: value_at(config, path) for path in paths}


def _stages() -> Mapping:
    # By name: the catalogue says what can be kept, and no table depends on that.
    return import_module("kinacc.workflow.catalogue").STAGES


def _lean(name: str, config: Mapping, tables: Mapping) -> dict[str, Mapping]:
    made = RUNS[name](tables, {**config, "all_readings": False})
    if name == "measurements":
        made = {**made, name: without_folds(made[name])}
    return made
