"""Stage: simulate the assessors under noise, one part of the repetitions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.config.records import of_section
from kinacc.study.monte_carlo import StudySettings, assessors, part_of, simulate


def run(inputs: Mapping, settings: Mapping, progress=None) -> dict[str, dict]:
    """Return ``study_chunk`` for ``settings["part"]`` (default: all repetitions).

    ``settings["all_readings"]`` false: the reading that ``study`` names alone;
    ``settings["only"]``: the repetitions simulated.
    """
    points = inputs["assessment_points"]
    study = of_section(StudySettings, settings["study"])
    part = settings.get("part") or {"number": 1, "of": 1}
    error_mm = np.stack([points["ex_mm"], points["ey_mm"], points["ez_mm"]], axis=1)
    repetitions = settings.get("only") or part_of(study.repetitions, part["number"], part["of"])
    rows = simulate(
        error_mm,
        study.noise_mm,
        repetitions,
        study,
        settings["seed"],
        assessors(settings["study"], settings.get("all_readings", True)),
        progress,
    )
    return {"study_chunk": rows}
