"""Map the largest error over the slices of the evaluation space (Fig. 3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.config.records import of_section
from kinacc.kinematics import region, robot
from kinacc.kinematics.inverse import limits
from kinacc.study.accuracy_map import accuracy_map
from kinacc.workflow import evaluation as shared


@dataclass(frozen=True)
class MapSettings:
    """The ``map`` section of the configuration: angles of the slices, spacing of their grid."""

    slices_deg: tuple[float, ...]
    grid_mm: float


def run(inputs: Mapping, settings: Mapping) -> dict[str, dict[str, np.ndarray]]:
    """``accuracy_map`` from ``vec_model`` and ``dh_model`` (and ``frames``, if given).

    ``settings["cells"]``: numbers of the only cells mapped (default: all).
    """
    layout = of_section(MapSettings, settings["map"])
    wanted = shared.poses_wanted(settings["evaluation"])
    equipment = of_section(shared.Equipment, settings["evaluation"])
    cells = region.grid(wanted.cylinder, np.deg2rad(layout.slices_deg), layout.grid_mm)
    # The slice as configured: degrees that went through radians and back are not the same number.
    per_slice = len(cells.radius_mm) // len(layout.slices_deg)
    slice_deg = np.repeat(np.array(layout.slices_deg), per_slice)
    if "cells" in settings:
        slice_deg = slice_deg[settings["cells"]]
        cells = region.Cells(*(axis[settings["cells"]] for axis in cells))
    arm = robot.load(settings["robot"])
    models = shared.models(inputs, equipment, arm)
    result = accuracy_map(arm, models, cells, wanted)._asdict()
    joints = limits.reported_joints(arm, result.pop("worst_q_rad"))
    columns = {
        "slice_deg": slice_deg,
        "radius_mm": cells.radius_mm,
        "height_mm": cells.height_mm,
    }
    columns |= result | {f"q{n + 1}": joints[:, n] for n in range(joints.shape[1])}
    return {"accuracy_map": columns}
