"""Draw Fig. 2, the arm over its evaluation space."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from kinacc import robot
from kinacc.figures import fig2
from kinacc.figures.columns import floats
from kinacc.models.dh import PARAMETERS, DHModel


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``dh_model`` among the ``assessment_points``."""
    table = inputs["dh_model"]
    order = np.argsort(floats(table, "joint"))
    model = DHModel(*(np.nan_to_num(floats(table, name))[order] for name in PARAMETERS))
    points = inputs["assessment_points"]
    reported = np.stack([floats(points, f"q{i + 1}") for i in range(model.joints)], axis=-1)
    evaluation = settings.get("evaluation", {})
    return fig2.draw(
        model,
        robot.dh_angles(robot.load(settings["robot"]), reported),
        tool_mm=_tool_mm(inputs.get("frames")),
        cylinder=evaluation["cylinder"] if evaluation.get("space") == "cylinder" else None,
        dataset=settings.get("dataset"),
    )


def _tool_mm(frames: Mapping | None) -> np.ndarray | None:
    """Return the tool centre point in the flange frame, None without one."""
    if frames is None:
        return None
    mine = (np.asarray(frames["model"]) == "dh") & (np.asarray(frames["frame"]) == "tool")
    if not mine.any():
        return None
    return np.array([floats(frames, f"{axis}_mm")[mine][0] for axis in "xyz"])
