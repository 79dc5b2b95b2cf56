"""Draw Fig. 2, the arm over its evaluation space."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from kinacc import robot
from kinacc.figures import fig2
from kinacc.figures.columns import floats
from kinacc.geometry import IDENTITY
from kinacc.models import tables


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``dh_model`` among the ``assessment_points``."""
    model = tables.dh_model(inputs["dh_model"])
    points = inputs["assessment_points"]
    reported = np.stack([floats(points, f"q{i + 1}") for i in range(model.joints)], axis=-1)
    evaluation = settings["evaluation"]
    return fig2.draw(
        model,
        robot.dh_angles(robot.load(settings["robot"]), reported),
        tool_mm=_tool_mm(inputs.get("frames"), evaluation),
        cylinder=evaluation["cylinder"] if evaluation["space"] == "cylinder" else None,
        dataset=settings.get("dataset"),
    )


def _tool_mm(frames: Mapping | None, evaluation: Mapping) -> np.ndarray:
    """Return the tool centre point in the flange frame: the fitted one, or the configured one."""
    if frames is not None and (np.asarray(frames["frame"]) == "tool").any():
        fitted = tables.frame(frames, "dh", "tool")
        if any(np.abs(a - b).max() > 0.0 for a, b in zip(fitted, IDENTITY, strict=True)):
            return fitted.position_mm
    return np.asarray(evaluation.get("tool_mm", (0.0, 0.0, 0.0)), dtype=float)
