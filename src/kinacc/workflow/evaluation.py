"""What the map and the assessment points share: settings and tables as records."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from kinacc.artifacts.error_models import PLAINEST
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import region, robot, tables
from kinacc.kinematics.region import Cylinder
from kinacc.kinematics.robot import Robot
from kinacc.study.accuracy_map import Equipped, Models


def joint_box(evaluation: Mapping, arm: Robot) -> tuple[np.ndarray, np.ndarray] | None:
    """Ends (k,), (k,) of the reported joints in the ``evaluation`` settings; None: the limits."""
    ranges = evaluation["joint_box"]["joints_deg"]
    if ranges is None:
        return None
    low, high = robot.in_own_units(arm, np.array(ranges, dtype=float).T)
    return low, high


def cylinder(evaluation: Mapping) -> Cylinder:
    """The cylinder of the ``evaluation`` settings."""
    section = evaluation["cylinder"]
    first, last = np.deg2rad(section["angle_deg"])
    return Cylinder(
        float(section["inner_radius_mm"]),
        float(section["radial_span_mm"]),
        float(section["bottom_mm"]),
        float(section["height_mm"]),
        float(first),
        float(last),
    )


def reference(evaluation: Mapping) -> np.ndarray:
    """Reference flange orientation (3, 3) in the slice's frame."""
    return region.reference_rotation(np.deg2rad(evaluation["reference_orientation_deg"]))


def orientations(evaluation: Mapping) -> region.Orientations:
    """Flange rotations about the reference orientation."""
    return region.orientations(np.deg2rad(evaluation["rotation_deg"]), evaluation["rotations"])


def models(inputs: Mapping, evaluation: Mapping, arm: Robot) -> Models:
    """The arm's models with their bases and tools, joints travelling as the settings say.

    The nominal model carries the tool of the DH model.
    """
    direction = int(evaluation["travel_direction"])
    by_name = {
        name: Equipped(
            model,
            _tool(inputs, evaluation, arm, model.kind),
            _base(inputs, name) if model.table is None else None,
        )
        for name, model in tables.models(inputs, arm.dh).items()
    }
    return Models(by_name, np.full(arm.dh.joints, direction) if direction else None)


def _base(inputs: Mapping, model: str) -> Pose | None:
    """A model's base in that of the DH model; None where both were fitted to one."""
    if "frames" not in inputs:
        return None
    own, dh = (tables.frame(inputs["frames"], name, "base") for name in (model, PLAINEST))
    same = all(np.array_equal(a, b) for a, b in zip(own, dh, strict=True))
    return None if same else compose(invert(dh), own)


def _tool(inputs: Mapping, evaluation: Mapping, arm: Robot, model: str) -> Pose:
    """The tool fitted with a model; the configured one, on the arm's flange, where none was."""
    own = robot.carried(arm)
    fitted = tables.fitted_tool(inputs.get("frames"), model, own)
    offset = np.array(evaluation["tool_mm"], dtype=float)
    return compose(own, Pose(np.eye(3), offset)) if fitted is None else fitted
