"""The section ``evaluation`` and the fitted models as records, for the map and the points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.artifacts.error_models import PLAINEST
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import region, robot, tables
from kinacc.kinematics.region import Cylinder
from kinacc.kinematics.robot import Robot
from kinacc.study.accuracy_map import Equipped, Models, PosesWanted


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


def poses_wanted(evaluation: Mapping) -> PosesWanted:
    """The tool poses of the ``evaluation`` settings and the model they are inverted with."""
    return PosesWanted(
        cylinder(evaluation),
        region.reference_rotation(np.deg2rad(evaluation["reference_orientation_deg"])),
        region.orientations(np.deg2rad(evaluation["rotation_deg"]), evaluation["rotations"]),
        evaluation["invert_with"],
        evaluation["reference_frame"],
    )


@dataclass(frozen=True)
class Equipment:
    """What the models carry, from the flange, and how all joints travel (0 for unknown)."""

    tool_mm: tuple[float, float, float]
    travel_direction: int


def models(inputs: Mapping, equipment: Equipment, arm: Robot) -> Models:
    """The arm's models with their bases and tools, joints travelling as the settings say.

    The nominal model carries the tool of the DH model.
    """
    direction = equipment.travel_direction
    by_name = {
        name: Equipped(
            model,
            _tool(inputs, equipment, arm, model.kind),
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


def _tool(inputs: Mapping, equipment: Equipment, arm: Robot, model: str) -> Pose:
    """The tool fitted with a model; the configured one, on the arm's flange, where none was."""
    own = robot.carried(arm)
    fitted = tables.fitted_tool(inputs.get("frames"), model, own)
    offset = np.array(equipment.tool_mm)
    return compose(own, Pose(np.eye(3), offset)) if fitted is None else fitted
