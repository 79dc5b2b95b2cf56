"""The files of ``kinacc export``, made in memory first and written all or none."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from kinacc.config.error_models import PLAINEST
from kinacc.deployment.export import paper_tables, urdf
from kinacc.deployment.export.source import CONVENTION, Source
from kinacc.deployment.record import TOOL
from kinacc.errors import Problem, refuse
from kinacc.geometry import Pose, compose, invert, quaternion_from_rotation
from kinacc.kinematics.dh import PARAMETERS
from kinacc.kinematics.robot import as_yaml
from kinacc.tables.atomic import write_new

_SLIDING = "T = Rz(theta_offset) Tz(q + d) Tx(a) Rx(alpha) Ry(beta) where a joint slides"


def csv_text(source: Source) -> str:
    """One row per joint, in degrees and mm."""
    columns = [f"{group}{name}" for group in ("", "std_", "nominal_") for name in PARAMETERS]
    table = source.joints[["joint", "type", *columns]]
    angles = table.filter(like="_rad").columns
    table[angles] = np.rad2deg(table[angles])
    table = table.rename(columns=lambda name: name.replace("_rad", "_deg"))
    return table.to_csv(index=False, float_format="%.12g", lineterminator="\n")


def json_text(source: Source) -> str:
    """Everything a calibration says of an arm: parameters, deviations, frames, residuals.

    Of a model that is no DH table, its own table beside the arm that it acts on.
    """
    arm, robot = source.calibration, source.calibration.robot
    dh, remaining = arm.model.dh, arm.residual
    turn_mrad = 1e3 * remaining.orientation_rad if remaining else np.nan
    content: dict[str, object] = {
        "name": source.name,
        "robot": robot.name,
        "calibration": arm.name,
        "convention": CONVENTION + (f"; {_SLIDING}" if dh.prismatic.any() else ""),
        "units": {"length": "mm", "angle": "rad", "quaternion": "w, x, y, z"},
        "joints": _with_null(source.joints).to_dict("records"),
        "joint_map": robot.joint_map.tolist(),
        "first_dh_frame_in_base": _frame(robot.base),
        "flange_in_last_dh_frame": _frame(robot.flange),
        "base_in_instrument": _frame(arm.base),
        "targets_in_last_dh_frame": {name: _frame(pose) for name, pose in arm.targets.items()},
        "orientation_of_targets": {name: arm.orientation_source(name) for name in arm.targets},
        "residual": remaining
        and {
            "subset": remaining.subset,
            "position_rms_mm": remaining.position_mm,
            "orientation_rms_mrad": None if np.isnan(turn_mrad) else turn_mrad,
        },
        "standard_deviations": arm.misfit.as_facts(),
        "undetermined": arm.left_open,
        "provenance": source.provenance,
    }
    if arm.model.table is None:
        table = pd.DataFrame(source.tables[f"{arm.choice}_model"])
        content |= {
            "error_model": arm.choice,
            "error_model_table": _with_null(table).to_dict("list"),
        }
    return json.dumps(content, indent=1) + "\n"


def _with_null(table: pd.DataFrame) -> pd.DataFrame:
    return table.astype(object).where(table.notna(), None)


def _frame(pose: Pose) -> dict[str, list[float]]:
    quaternion = quaternion_from_rotation(pose.rotation)
    return {"position_mm": pose.position_mm.tolist(), "quaternion_wxyz": quaternion.tolist()}


def yaml_text(source: Source) -> str:
    """A robot file that ``kinacc.kinematics.robot.load`` reads back to the same arm, bit by bit.

    What the poses leave open stands in comments.
    """
    arm = source.calibration
    robot, tool = arm.robot, arm.robot.tool
    if TOOL in arm.targets:
        tool = compose(invert(robot.flange), arm.targets[TOOL])
    calibrated = replace(
        robot, name=source.name, source=source.about, date="", dh=source.dh, tool=tool
    )
    heading = (
        f"{robot.name} as calibrated by data set {arm.name} ({arm.choice} model).",
        f"{CONVENTION}; angles in rad, lengths in mm.",
        *source.orientation_lines,
        *source.left_open_lines,
    )
    return as_yaml(calibrated, heading)


class Format(NamedTuple):
    """A format: its text, and what its file names end in."""

    text: Callable[[Source], str]
    ending: str


FORMATS = {
    "csv": Format(csv_text, ".csv"),
    "json": Format(json_text, ".json"),
    "latex": Format(paper_tables.latex, "_tables.tex"),
    "markdown": Format(paper_tables.markdown, "_tables.md"),
    "urdf": Format(urdf.text, ".urdf"),
    "yaml": Format(yaml_text, ".yaml"),
}


def formats_of(model: str) -> tuple[str, ...]:
    """Formats that carry a model: one that is no DH table stands in JSON alone."""
    return tuple(FORMATS) if model == PLAINEST else ("json",)


def contents(source: Source, formats: Sequence[str] = ()) -> dict[str, str]:
    """File names and their text for a calibrated model; all formats that carry it by default.

    Raises InputError for what cannot be exported.
    """
    arm, able = source.calibration, formats_of(source.calibration.choice)
    # A name of its own, so that the DH files may stand beside it.
    stem = arm.name if arm.choice == PLAINEST else f"{arm.name}_{arm.choice}"
    unable = f"cannot carry a model of kind {arm.choice}; the {PLAINEST} model has all formats"
    refuse(
        Problem(f"format {item}", unable if item in FORMATS else "is unknown", ", ".join(able))
        for item in formats
        if item not in able
    )
    chosen = [FORMATS[item] for item in dict.fromkeys(formats or able)]
    return {f"{stem}{item.ending}": item.text(source) for item in chosen}


def write(files: Mapping[str, str], target: Path | str, force: bool = False) -> list[str]:
    """Write files into a folder, all or none; InputError for those already there."""
    return write_new({Path(target) / name: text.encode() for name, text in files.items()}, force)
