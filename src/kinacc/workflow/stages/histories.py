"""Stage: follow single runs of model invalidation measurement by measurement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.assess.model_invalidation import Invalidation
from kinacc.config.records import of_section
from kinacc.study.histories import HistorySettings, histories
from kinacc.study.monte_carlo import Visits


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, dict]:
    """Return ``histories``."""
    points = inputs["assessment_points"]
    error_mm = np.stack([points["ex_mm"], points["ey_mm"], points["ez_mm"]], axis=1)
    rows = histories(
        error_mm,
        of_section(HistorySettings, settings["histories"]),
        of_section(Visits, settings["study"]),
        of_section(Invalidation, settings["study"]),
        settings["seed"],
        points["point"],
        progress,
    )
    return {"histories": rows}
