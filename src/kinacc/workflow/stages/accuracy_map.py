"""Map the largest error over the slices of the evaluation space (Fig. 3)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.kinematics import region, robot
from kinacc.study.accuracy_map import accuracy_map
from kinacc.workflow import evaluation as shared


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict[str, np.ndarray]]:
    """``accuracy_map`` from ``vec_model`` and ``dh_model`` (and ``frames``, if given)."""
    evaluation, layout = settings["evaluation"], settings["map"]
    cells = region.grid(
        shared.cylinder(evaluation), np.deg2rad(layout["slices_deg"]), layout["grid_mm"]
    )
    arm = robot.load(settings["robot"])
    result = accuracy_map(
        arm,
        shared.models(inputs, evaluation, arm),
        cells,
        shared.reference(evaluation),
        shared.orientations(evaluation),
        invert_with=evaluation["invert_with"],
    )
    # The slice as configured: degrees that went through radians and back are not the same number.
    per_slice = len(cells.radius_mm) // len(layout["slices_deg"])
    columns = {
        "slice_deg": np.repeat(np.array(layout["slices_deg"], dtype=float), per_slice),
        "radius_mm": cells.radius_mm,
        "height_mm": cells.height_mm,
    }
    return {"accuracy_map": {**columns, **result._asdict()}}
