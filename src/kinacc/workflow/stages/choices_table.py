"""Stage: gather the claims over the paper's open choices."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.artifacts.columns import Columns


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict]:
    """Return ``choices`` and ``choices_factors``: by run, then as they were judged."""
    return {name: _by_run(inputs[f"{name}_chunk"]) for name in ("choices", "choices_factors")}


def _by_run(rows: Columns) -> Columns:
    order = np.argsort(rows["run"], kind="stable")
    return {name: np.asarray(column)[order] for name, column in rows.items()}
