"""Everything a calibration says of an arm: parameters, deviations, frames, residuals."""

from __future__ import annotations

import json

import pandas as pd

from kinacc.deployment.export.source import CONVENTION, Source, kind, number
from kinacc.geometry import Pose, quaternion_from_rotation
from kinacc.kinematics.dh import PARAMETERS

ENDING, ANY_MODEL = ".json", True
_SLIDING = "T = Rz(theta_offset) Tz(q + d) Tx(a) Rx(alpha) Ry(beta) where a joint slides"


def text(source: Source) -> str:
    """The file; of a model that is no DH table, its own table beside the arm that it acts on."""
    arm, dh, robot = source.calibration, source.calibration.model.dh, source.calibration.robot
    joints = []
    for joint in range(dh.joints):
        row: dict[str, object] = {"joint": joint + 1, "type": kind(dh, joint)}
        for column, name in enumerate(PARAMETERS):
            row[name] = float(getattr(dh, name)[joint])
            row[f"nominal_{name}"] = float(getattr(robot.dh, name)[joint])
            row[f"std_{name}"] = number(source.std[joint, column])
        joints.append(row)
    remaining = arm.residual
    content = {
        "name": source.name,
        "robot": robot.name,
        "calibration": arm.name,
        "convention": CONVENTION + (f"; {_SLIDING}" if dh.prismatic.any() else ""),
        "units": {"length": "mm", "angle": "rad", "quaternion": "w, x, y, z"},
        "joints": joints,
        "joint_map": robot.joint_map.tolist(),
        "first_dh_frame_in_base": _frame(robot.base),
        "flange_in_last_dh_frame": _frame(robot.flange),
        "base_in_instrument": _frame(arm.base),
        "targets_in_last_dh_frame": {name: _frame(pose) for name, pose in arm.targets.items()},
        "orientation_of_targets": {name: arm.orientation_source(name) for name in arm.targets},
        "residual": remaining
        and {
            "subset": remaining.subset,
            "position_rms_mm": number(remaining.position_mm),
            "orientation_rms_mrad": number(1e3 * remaining.orientation_rad),
        },
        "standard_deviations": source.misfit.as_facts(),
        "undetermined": arm.left_open,
        "provenance": source.provenance,
    }
    if arm.model.table is None:
        table = pd.DataFrame(dict(source.tables[f"{arm.choice}_model"]))
        rows = table.astype(object).where(table.notna(), None).to_dict("list")
        content |= {"error_model": arm.choice, "error_model_table": rows}
    return json.dumps(content, indent=1) + "\n"


def _frame(pose: Pose) -> dict[str, list[float]]:
    quaternion = quaternion_from_rotation(pose.rotation)
    return {
        "position_mm": [*map(float, pose.position_mm)],
        "quaternion_wxyz": [*map(float, quaternion)],
    }
