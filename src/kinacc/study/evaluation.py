"""Map and points of the evaluation space: its settings as records, the fitted models on the arm."""

from __future__ import annotations

import warnings

import numpy as np

from kinacc.config.error_models import PLAINEST
from kinacc.config.records import Settings
from kinacc.geometry import Pose, compose, invert
from kinacc.kinematics import region, robot, tables
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.region import Cylinder
from kinacc.kinematics.robot import Robot
from kinacc.study import operating_points
from kinacc.study.accuracy_map import Equipped, Models, PosesWanted, accuracy_map, errors_at
from kinacc.tables.columns import Columns, Tables


def cylinder(evaluation: Settings) -> Cylinder:
    """The cylinder of the ``evaluation`` settings."""
    section = evaluation["cylinder"]
    lengths = ("inner_radius_mm", "radial_span_mm", "bottom_mm", "height_mm")
    angles_rad = np.deg2rad(section["angle_deg"]).tolist()
    return Cylinder(*(float(section[name]) for name in lengths), *angles_rad)


def poses_wanted(evaluation: Settings) -> PosesWanted:
    """The tool poses of the ``evaluation`` settings and the model they are inverted with."""
    return PosesWanted(
        cylinder(evaluation),
        region.reference_rotation(np.deg2rad(evaluation["reference_orientation_deg"])),
        region.orientations(np.deg2rad(evaluation["rotation_deg"]), evaluation["rotations"]),
        evaluation["invert_with"],
        evaluation["reference_frame"],
    )


def equipped(inputs: Tables, evaluation: Settings, arm: Robot) -> Models:
    """The arm's models with their bases and tools, joints travelling as the settings say.

    A tool is the one fitted with the model, else the configured one on the arm's flange; the
    nominal model carries that of the DH model.
    """
    direction, carried = evaluation["travel_direction"], robot.carried(arm)
    offset = compose(carried, Pose(np.eye(3), np.array(evaluation["tool_mm"], dtype=float)))
    frames = inputs.get("frames")
    travel = np.full(arm.dh.joints, direction) if direction else None
    equipped_models = {}
    for name, model in tables.models(inputs, arm.dh).items():
        tool, base = tables.fitted_tool(frames, model.kind, carried), None
        if model.table is None and frames is not None:  # its base in that of the DH model
            fitted, plain = (tables.frame(frames, kind, "base") for kind in (name, PLAINEST))
            if not all(np.array_equal(a, b) for a, b in zip(fitted, plain, strict=True)):
                base = compose(invert(plain), fitted)
        equipped_models[name] = Equipped(model, offset if tool is None else tool, base, travel)
    return equipped_models


def mapped(inputs: Tables, settings: Settings) -> Tables:
    """``accuracy_map`` from ``vec_model`` and ``dh_model`` (and ``frames``, if given)."""
    slices_deg = np.array(settings["map"]["slices_deg"], dtype=float)
    wanted = poses_wanted(settings["evaluation"])
    cells = region.grid(wanted.cylinder, np.deg2rad(slices_deg), settings["map"]["grid_mm"])
    # The slice as configured: degrees that went through radians and back are not the same number.
    slice_deg = np.repeat(slices_deg, len(cells.radius_mm) // len(slices_deg))
    arm = robot.load(settings["robot"])
    models = equipped(inputs, settings["evaluation"], arm)
    table = accuracy_map(arm, models, cells, wanted).assign(
        slice_deg=slice_deg, radius_mm=cells.radius_mm, height_mm=cells.height_mm
    )
    return {"accuracy_map": {name: column.to_numpy() for name, column in table.items()}}


def points(inputs: Tables, settings: Settings) -> Tables:
    """``assessment_points`` of a modelled space, or chosen from what was measured."""
    section, arm = settings["evaluation"], robot.load(settings["robot"])
    if section["space"] == "measured":
        return {"assessment_points": _measured(inputs, section["points"])}
    models, drawn = equipped(inputs, section, arm), (section["sequence"], section["points"])
    if section["points_in"] == "joints":
        q_rad = operating_points.in_joints(arm, models, *drawn, cylinder(section))
    else:
        wanted, wrist = poses_wanted(section), section["wrist"]
        q_rad = operating_points.in_space(arm, models, wanted, *drawn, wrist)
    travel = np.full(q_rad.shape, section["travel_direction"], np.int8)
    columns: Columns = {"point": np.arange(len(q_rad))}
    columns |= _numbered("q", limits.reported_joints(arm, q_rad))
    columns |= _numbered("s", travel)
    return {"assessment_points": columns | _error_columns(errors_at(models, q_rad)[:, :3])}


def _numbered(letter: str, values: np.ndarray) -> Columns:
    """Columns of values (n, k): q1, q2, .."""
    return {f"{letter}{number}": column for number, column in enumerate(values.T, 1)}


def _error_columns(error_mm: np.ndarray) -> Columns:
    components = {f"e{axis}_mm": error_mm[:, i] for i, axis in enumerate("xyz")}
    return {**components, "true_error_mm": np.linalg.norm(error_mm, axis=1)}


def _measured(inputs: Tables, count: int) -> Columns:
    """Configurations spread over the measured ones, errors averaged over repeated readings."""
    errors, measurements = inputs["pose_errors"], inputs["measurements"]
    of_model, held_out = operating_points.rows_of(errors, PLAINEST)
    if not held_out.any():
        warnings.warn("no held-out errors: the points use training errors", stacklevel=2)
        held_out = of_model
    rows, error_mm = operating_points.measured_errors(errors, held_out)
    chosen = operating_points.spread_rows(len(rows), count)
    names = [name for name in measurements if name[:1] in "qs" and name[1:].isdigit()]
    columns = {name: np.asarray(measurements[name])[rows[chosen]] for name in names}
    return {"point": np.arange(len(chosen)), **columns, **_error_columns(error_mm[chosen])}
