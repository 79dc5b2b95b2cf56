"""Every claim on further accepted draws of the synthetic arm."""

from __future__ import annotations

import pandas as pd

from kinacc.config.error_models import ALWAYS
from kinacc.config.records import Settings
from kinacc.progress import with_progress
from kinacc.study import in_memory
from kinacc.study.claims.evaluate import evaluate
from kinacc.synthetic.accepted import further_draws
from kinacc.tables.columns import Columns, Tables
from kinacc.tables.contract import columns_from, columns_of

STAGES = (
    *ALWAYS,
    "residuals",
    "accuracy_map",
    "assessment_points",
    "study_chunk",
    "study",
    "histories",
)


def run(inputs: Tables, settings: Settings) -> Tables:
    """Return ``robustness_chunk`` for ``settings["part"]`` (default: all further draws).

    Raises InputError where fewer draws were accepted than are wanted.
    """
    own = int(settings["measurements"]["synthetic"]["draw"])
    draws = further_draws(own, int(settings["robustness"]["draws"]))
    part = settings.get("part") or {"number": 1, "of": 1}
    chosen = draws[part["number"] - 1 :: part["of"]]
    config = {name: value for name, value in settings.items() if name != "part"}
    rows = []
    for draw in with_progress(chosen, "further synthetic arms studied"):
        rows += claims_on(draw, config).to_dict("records")
    return {"robustness_chunk": columns_of("robustness_chunk", rows)}


def claims_on(draw: int, config: Settings) -> pd.DataFrame:
    """Rows of ``robustness`` of one accepted draw under the configuration of a data set."""
    measurements = config["measurements"]
    synthetic = {**measurements["synthetic"], "draw": draw}
    settings = {**config, "measurements": {**measurements, "synthetic": synthetic}}
    tables: dict[str, Columns] = {}
    for name in ("measurements", *STAGES):
        tables |= in_memory.lean(name, settings, tables)
    claims = pd.DataFrame(evaluate(tables, paper_arm=True)).assign(draw=draw)
    return claims[["draw", "claim", "reproduced", "verdict"]]


def gathered(inputs: Tables, settings: Settings) -> Tables:
    """Return ``robustness``: by draw, then in the order of the claims."""
    rows = pd.DataFrame(dict(inputs["robustness_chunk"])).sort_values("draw", kind="stable")
    return {"robustness": columns_from("robustness", rows)}
