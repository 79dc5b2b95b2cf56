"""Every claim under one run over the choices that the paper leaves open."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from kinacc.config.error_models import ALWAYS
from kinacc.errors import InputError
from kinacc.study.claims.evaluate import evaluate
from kinacc.workflow.code import config_hash
from research.design import Run
from research.memory import Memory, settings_of
from research.open_choices import FIG_5

_POINTS = ("measurements", *ALWAYS, "assessment_points")
_FOLLOWED = (*_POINTS, "histories")
_STAGES = (*_POINTS, "residuals", "accuracy_map", "study_chunk", "study", "histories")
# Properties of the operating points and of the map that a claim may hang on.
ABOUT = {
    "largest_mm": "the largest true error of the operating points",
    "largest_over_second": "the largest true error over the second largest",
    "largest_over_mean": "the largest true error over the mean",
    "place_of_largest": "how late in the sequence the point of the largest error stands",
    "reached": "the share of the map's poses that the arm reaches",
}


def of_tables(tables: Mapping[str, Mapping]) -> dict[str, float]:
    """The numbers of ``ABOUT`` that ``assessment_points`` and ``accuracy_map`` tell, if there."""
    found = {}
    if "assessment_points" in tables:
        error_mm = np.asarray(tables["assessment_points"]["true_error_mm"], dtype=float)
        largest, second = np.sort(error_mm)[::-1][[0, min(1, error_mm.size - 1)]]
        found["largest_mm"] = float(largest)
        found["largest_over_second"] = float(largest / second)
        found["largest_over_mean"] = float(largest / error_mm.mean())
        found["place_of_largest"] = float((error_mm.argmax() + 1) / error_mm.size)
    if "accuracy_map" in tables:
        cells = tables["accuracy_map"]
        found["reached"] = float(np.sum(cells["solutions"]) / np.sum(cells["wanted"]))
    return found


def alike(runs: Iterable[Run], config: Mapping) -> list[Run]:
    """The runs in an order in which those that share settings stand side by side."""

    def shared(run: Run) -> list[str]:
        own = run.configured(config)
        return [config_hash(settings_of(name, own)) for name in _STAGES]

    return sorted(runs, key=shared)


def judged(runs: Iterable[Run], config: Mapping) -> tuple[pd.DataFrame, pd.DataFrame]:
    """``choices`` and ``choices_factors`` of some runs: verdicts, and what was chosen.

    Runs that share settings should stand side by side, so that what these make is made once.
    """
    memory, rows, factors = Memory(), [], []
    for run in runs:
        tables, why = {}, None
        followed_only = run.varied == FIG_5
        try:
            memory.fill(tables, _FOLLOWED if followed_only else _STAGES, run.configured(config))
        except InputError as error:
            why = str(error)
        claims = pd.DataFrame(evaluate(tables, paper_arm=True))
        if followed_only:
            claims = claims[claims["evidence"] == "histories.parquet"]
        found = claims[["claim", "verdict"]].assign(statistic=claims["reproduced"], why=why)
        rows.append(found.assign(run=run.number, choice=run.varied, value=run.value))
        factors += [
            {"run": run.number, "factor": name, "kind": "choice", "value": word}
            for name, word in sorted(run.chosen.items())
        ]
        factors += [
            {"run": run.number, "factor": name, "kind": "property", "number": number}
            for name, number in of_tables(tables).items()
        ]
    return pd.concat(rows, ignore_index=True), pd.DataFrame(factors)
