"""Choose the operating points of the study and state their true errors."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.config.records import of_section
from kinacc.kinematics import robot
from kinacc.kinematics.inverse import limits
from kinacc.kinematics.robot import Robot
from kinacc.study import operating_points
from kinacc.study.accuracy_map import Models
from kinacc.study.operating_points import OperatingPoints
from kinacc.workflow import evaluation as shared


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


def run(inputs: Mapping, settings: Mapping) -> dict[str, Columns]:
    """``assessment_points`` of a modelled space, or chosen from what was measured."""
    section = settings["evaluation"]
    wanted = of_section(PointSettings, section)
    arm = robot.load(settings["robot"])
    if wanted.space == "measured":
        return {"assessment_points": _measured(inputs, wanted.points)}
    models = shared.models(inputs, of_section(shared.Equipment, section), arm)
    return {"assessment_points": _columns(arm, _drawn(arm, models, wanted, section))}


def _drawn(arm: Robot, models: Models, wanted: PointSettings, section: Mapping) -> OperatingPoints:
    limited = arm.q_min_rad, arm.q_max_rad
    drawn = wanted.sequence, wanted.points
    if wanted.space == "joint_box":
        box = shared.joint_box(section, arm) or limited
        q_rad = operating_points.in_joints(arm, models, box, *drawn)
    elif wanted.points_in == "joints":
        space = shared.cylinder(section)
        q_rad = operating_points.in_joints(arm, models, limited, *drawn, space)
    else:
        poses = shared.poses_wanted(section)
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
    vectors = np.stack([np.asarray(errors[f"e{axis}_mm"], dtype=float) for axis in "xyz"], axis=1)
    first = np.array([np.asarray(errors["row"])[group[0]] for group in chosen]).astype(int)
    names = [name for name in measurements if name[:1] in "qs" and name[1:].isdigit()]
    columns: Columns = {"point": np.arange(len(chosen))}
    columns |= {name: np.asarray(measurements[name])[first] for name in names}
    return {
        **columns,
        **_error_columns(np.array([vectors[group].mean(axis=0) for group in chosen])),
    }
