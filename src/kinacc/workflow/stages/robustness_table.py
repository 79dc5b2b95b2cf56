"""Stage: gather the claims on further accepted draws of the synthetic arm."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict]:
    """Return ``robustness``: by draw, then in the order of the claims."""
    rows = inputs["robustness_chunk"]
    order = np.argsort(rows["draw"], kind="stable")
    return {"robustness": {name: np.asarray(column)[order] for name, column in rows.items()}}
