"""A calibrated arm as a robot file of kinacc, as JSON and as a CSV table."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kinacc.calibration.misfit import Misfit, in_words
from kinacc.config.names import csv_text, in_csv
from kinacc.deployment.record import STATED, TOOL, Calibration
from kinacc.geometry import Pose, compose, invert, quaternion_from_rotation
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot import as_yaml

CONVENTION = "T = Rz(q + theta_offset) Tz(d) Tx(a) Rx(alpha) Ry(beta) per joint"
SLIDING = "T = Rz(theta_offset) Tz(q + d) Tx(a) Rx(alpha) Ry(beta) where a joint slides"


def robot_name(calibration: Calibration) -> str:
    """Name of the calibrated arm."""
    own = (
        calibration.name
        if calibration.name.startswith(calibration.robot.name)
        else f"{calibration.robot.name}_{calibration.name}"
    )
    return f"{own}_calibrated"


def robot_yaml(calibration: Calibration) -> str:
    """A robot file that ``kinacc.kinematics.robot.load`` reads back to the same arm, bit by bit."""
    robot = calibration.robot
    tool = robot.tool
    if TOOL in calibration.targets:
        tool = compose(invert(robot.flange), calibration.targets[TOOL])
    calibrated = replace(
        robot,
        name=robot_name(calibration),
        source=f"calibrated from {robot.name} with data set {calibration.name}",
        date="",
        dh=_dh_of(calibration),
        tool=tool,
    )
    heading = (
        f"{robot.name} as calibrated by data set {calibration.name} ({calibration.choice} model).",
        f"{CONVENTION}; angles in rad, lengths in mm.",
        *orientation_lines(calibration),
        *left_open_lines(calibration),
    )
    return as_yaml(calibrated, heading)


def orientation_lines(calibration: Calibration) -> list[str]:
    """Targets whose orientation no reading has, for a comment; nothing where there are none."""
    names = [each for each in calibration.targets if calibration.orientation_source(each) == STATED]
    if not names:
        return []
    return [f"Orientation as stated in the robot file, not measured: {', '.join(names)}."]


def left_open_lines(calibration: Calibration) -> list[str]:
    """What the poses leave open, under a heading, for a comment; nothing where they do not."""
    told = calibration.left_open
    return ["Left open by the poses:", *(f"  {text}" for text in told)] if told else []


def robot_json(
    calibration: Calibration,
    std: np.ndarray,
    nominal: DHModel,
    provenance: Mapping[str, str],
    fits: Misfit,
    table: Mapping[str, np.ndarray] | None = None,
) -> str:
    """Everything the calibration says of the arm: parameters, deviations, frames, residuals.

    ``std`` (k, 5) as ``dh.PARAMETERS``, NaN where undetermined; ``fits``: what they are worth.
    ``table``: the columns of a model
    that says more than DH parameters, which then are those of the arm its errors act on.
    """
    dh = calibration.model.dh
    joints = []
    for joint in range(dh.joints):
        row: dict[str, object] = {
            "joint": joint + 1,
            "type": _kind(dh, joint),
        }
        for column, name in enumerate(PARAMETERS):
            value = float(getattr(dh, name)[joint])
            row[name] = value
            row[f"nominal_{name}"] = float(getattr(nominal, name)[joint])
            row[f"std_{name}"] = _number(std[joint, column])
        joints.append(row)
    left = calibration.residual
    content = {
        "name": robot_name(calibration),
        "robot": calibration.robot.name,
        "calibration": calibration.name,
        "convention": CONVENTION + (f"; {SLIDING}" if dh.prismatic.any() else ""),
        "units": {"length": "mm", "angle": "rad", "quaternion": "w, x, y, z"},
        "joints": joints,
        "joint_map": calibration.robot.joint_map.tolist(),
        "first_dh_frame_in_base": _frame_record(calibration.robot.base),
        "flange_in_last_dh_frame": _frame_record(calibration.robot.flange),
        "base_in_instrument": _frame_record(calibration.base),
        "targets_in_last_dh_frame": {
            name: _frame_record(pose) for name, pose in calibration.targets.items()
        },
        "orientation_of_targets": {
            name: calibration.orientation_source(name) for name in calibration.targets
        },
        "residual": left
        and {
            "subset": left.subset,
            "position_rms_mm": _number(left.position_mm),
            "orientation_rms_mrad": _number(1e3 * left.orientation_rad),
        },
        "standard_deviations": fits.as_facts(),
        "undetermined": calibration.left_open,
        "provenance": dict(provenance),
    }
    if table is not None:
        rows = {name: [_cell(each) for each in values] for name, values in table.items()}
        content |= {"error_model": calibration.choice, "error_model_table": rows}
    return json.dumps(content, indent=1) + "\n"


def robot_csv(calibration: Calibration, std: np.ndarray, nominal: DHModel, fits: Misfit) -> str:
    """One row per joint: fitted values, their standard deviations and the nominal values.

    Then what the poses leave open of the joint, of base and tool in the row of the last one, and
    what the standard deviations are worth.
    """
    dh = _dh_of(calibration)
    names = [name.replace("_rad", "_deg") for name in PARAMETERS]
    stds, nominals = ([f"{which}_{name}" for name in names] for which in ("std", "nominal"))
    rows: list[list[object]] = [
        ["joint", "type", *names, *stds, *nominals, "undetermined", "std_note"]
    ]
    factor = np.array([180.0 / np.pi if name.endswith("_rad") else 1.0 for name in PARAMETERS])
    fitted, given = (
        np.stack([getattr(model, name) for name in PARAMETERS], axis=1) * factor
        for model in (dh, nominal)
    )
    for joint in range(dh.joints):
        cells = np.concatenate([fitted[joint], std[joint] * factor, given[joint]])
        kind = _kind(dh, joint)
        numbers = ("" if np.isnan(x) else f"{x:.12g}" for x in cells)
        told = _of_joint(calibration, joint)
        told += orientation_lines(calibration) if joint + 1 == dh.joints else []
        left_open = in_csv("; ".join(told))
        rows.append([joint + 1, kind, *numbers, left_open, in_csv(in_words([fits]))])
    return csv_text(rows)


def _of_joint(calibration: Calibration, joint: int) -> list[str]:
    """What the poses leave open of a joint; in the last one's also what is of no joint."""
    told = calibration.left_open or ()
    named = [set(map(int, re.findall(r"joint (\d+)", text))) for text in told]
    last = joint + 1 == calibration.robot.dh.joints
    return [
        text
        for text, joints in zip(told, named, strict=True)
        if joint + 1 in joints or (last and not joints)
    ]


def _dh_of(calibration: Calibration) -> DHModel:
    if calibration.model.table is None:
        raise TypeError(f"a {calibration.choice} model has no DH table: choose dh")
    return calibration.model.table


def _cell(value: object) -> object:
    if isinstance(value, str) or value is None:
        return value
    return int(value) if isinstance(value, np.integer) else _number(float(value))


def _kind(dh: DHModel, joint: int) -> str:
    return "prismatic" if dh.prismatic[joint] else "revolute"


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _frame_record(pose: Pose) -> dict[str, list[float]]:
    return {
        "position_mm": [float(value) for value in pose.position_mm],
        "quaternion_wxyz": [float(value) for value in quaternion_from_rotation(pose.rotation)],
    }
