"""Stage: gather the simulations and sum them up."""

from __future__ import annotations

from collections.abc import Mapping

from kinacc.study.monte_carlo import (
    default_reading,
    ordered,
    readings,
    summary,
    true_accuracy_mm,
)


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict]:
    """Return ``study``, ``study_summary`` and ``readings``."""
    true_mm = true_accuracy_mm(inputs["assessment_points"]["true_error_mm"])
    rows = ordered(inputs["study_chunk"])
    default = default_reading(rows, settings["study"])
    return {
        "study": default,
        "study_summary": summary(default, true_mm),
        "readings": readings(rows, true_mm),
    }
