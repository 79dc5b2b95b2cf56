"""Draw Fig. 2, the arm over its evaluation space."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from kinacc.figures import fig2
from kinacc.figures.columns import floats
from kinacc.kinematics import robot, tables
from kinacc.kinematics.dh import DHModel


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``dh_model`` among the ``assessment_points``."""
    arm = robot.load(settings["robot"])
    model = DHModel.from_columns(inputs["dh_model"], arm.dh.prismatic)
    points = inputs["assessment_points"]
    reported = np.stack([floats(points, f"q{i + 1}") for i in range(model.joints)], axis=-1)
    evaluation = settings["evaluation"]
    return fig2.draw(
        model,
        arm.dh_joints(reported),
        tool_mm=_tool_mm(inputs.get("frames"), evaluation, arm),
        cylinder=evaluation["cylinder"] if evaluation["space"] == "cylinder" else None,
        dataset=settings.get("dataset"),
    )


def _tool_mm(frames: Mapping | None, evaluation: Mapping, arm: robot.Robot) -> np.ndarray:
    """Return the tool centre point in the last DH frame: the fitted one, or the configured one."""
    own = robot.carried(arm)
    fitted = tables.fitted_tool(frames, "dh", own)
    if fitted is not None:
        return fitted.position_mm
    offset = np.asarray(evaluation["tool_mm"], dtype=float)
    return own.position_mm + own.rotation @ offset
