"""Map and points of the evaluation space: its settings as records, the fitted models on the arm."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.assess.world import error_vectors
from kinacc.config.error_models import PLAINEST
from kinacc.config.records import of_section
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import region, robot, tables
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.region import Cylinder
from kinacc.kinematics.robot import Robot
from kinacc.study import operating_points
from kinacc.study.accuracy_map import Equipped, Models, PosesWanted, accuracy_map
from kinacc.study.operating_points import OperatingPoints
from kinacc.tables.columns import Columns


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


def equipped(inputs: Mapping, equipment: Equipment, arm: Robot) -> Models:
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


@dataclass(frozen=True)
class MapSettings:
    """The ``map`` section of the configuration: angles of the slices, spacing of their grid."""

    slices_deg: tuple[float, ...]
    grid_mm: float


def mapped(inputs: Mapping, settings: Mapping) -> dict[str, dict[str, np.ndarray]]:
    """``accuracy_map`` from ``vec_model`` and ``dh_model`` (and ``frames``, if given).

    ``settings["cells"]``: numbers of the only cells mapped (default: all).
    """
    layout = of_section(MapSettings, settings["map"])
    wanted = poses_wanted(settings["evaluation"])
    equipment = of_section(Equipment, settings["evaluation"])
    cells = region.grid(wanted.cylinder, np.deg2rad(layout.slices_deg), layout.grid_mm)
    # The slice as configured: degrees that went through radians and back are not the same number.
    per_slice = len(cells.radius_mm) // len(layout.slices_deg)
    slice_deg = np.repeat(np.array(layout.slices_deg), per_slice)
    if "cells" in settings:
        slice_deg = slice_deg[settings["cells"]]
        cells = region.Cells(*(axis[settings["cells"]] for axis in cells))
    arm = robot.load(settings["robot"])
    models = equipped(inputs, equipment, arm)
    result = accuracy_map(arm, models, cells, wanted)._asdict()
    joints = limits.reported_joints(arm, result.pop("worst_q_rad"))
    columns = {
        "slice_deg": slice_deg,
        "radius_mm": cells.radius_mm,
        "height_mm": cells.height_mm,
    }
    columns |= result | {f"q{n + 1}": joints[:, n] for n in range(joints.shape[1])}
    return {"accuracy_map": columns}


@dataclass(frozen=True)
class PointSettings:
    """How many points are drawn, by which sequence, in which space, as poses or as joints.

    ``wrist``: the wrist configurations of poses.
    """

    space: str
    sequence: str
    points: int
    points_in: str
    wrist: str | None = None


def points(inputs: Mapping, settings: Mapping) -> dict[str, Columns]:
    """``assessment_points`` of a modelled space, or chosen from what was measured."""
    section = settings["evaluation"]
    wanted = of_section(PointSettings, section)
    arm = robot.load(settings["robot"])
    if wanted.space == "measured":
        return {"assessment_points": _measured(inputs, wanted.points)}
    models = equipped(inputs, of_section(Equipment, section), arm)
    return {"assessment_points": _columns(arm, _drawn(arm, models, wanted, section))}


def _drawn(arm: Robot, models: Models, wanted: PointSettings, section: Mapping) -> OperatingPoints:
    limited = arm.q_min_rad, arm.q_max_rad
    drawn = wanted.sequence, wanted.points
    if wanted.space == "joint_box":
        box = joint_box(section, arm) or limited
        q_rad = operating_points.in_joints(arm, models, box, *drawn)
    elif wanted.points_in == "joints":
        space = cylinder(section)
        q_rad = operating_points.in_joints(arm, models, limited, *drawn, space)
    else:
        poses = poses_wanted(section)
        q_rad = operating_points.in_space(arm, models, poses, *drawn, wanted.wrist)
    return operating_points.with_errors(models, q_rad)


def _columns(arm: Robot, points: OperatingPoints) -> Columns:
    reported = limits.reported_joints(arm, points.q_rad)
    columns: Columns = {"point": np.arange(len(reported))}
    for joint in range(reported.shape[1]):
        columns[f"q{joint + 1}"] = reported[:, joint]
    for joint in range(reported.shape[1]):
        columns[f"s{joint + 1}"] = points.travel[:, joint]
    return {**columns, **_error_columns(points.error_mm)}


def _error_columns(error_mm: np.ndarray) -> Columns:
    components = {f"e{axis}_mm": error_mm[:, i] for i, axis in enumerate("xyz")}
    return {**components, "true_error_mm": np.linalg.norm(error_mm, axis=1)}


def _measured(inputs: Mapping, count: int) -> Columns:
    """Configurations spread over the measured ones, errors averaged over repeated readings."""
    errors, measurements = inputs["pose_errors"], inputs["measurements"]
    wanted = np.asarray(errors["comparison"]) == "dh_vs_measured"
    held_out = wanted & (np.asarray(errors["estimate"]) == "cross_validated")
    if not held_out.any():
        warnings.warn("no held-out errors: the points use training errors", stacklevel=2)
        held_out = wanted
    rows = np.flatnonzero(held_out)
    groups = operating_points.readings_of(
        np.asarray(errors["pose"])[rows], np.asarray(errors["target"])[rows]
    )
    chosen = [rows[groups[i]] for i in operating_points.spread_rows(len(groups), count)]
    vectors = error_vectors(errors)
    first = np.array([np.asarray(errors["row"])[group[0]] for group in chosen]).astype(int)
    names = [name for name in measurements if name[:1] in "qs" and name[1:].isdigit()]
    columns: Columns = {"point": np.arange(len(chosen))}
    columns |= {name: np.asarray(measurements[name])[first] for name in names}
    return {
        **columns,
        **_error_columns(np.array([vectors[group].mean(axis=0) for group in chosen])),
    }
