"""Read or synthesise the measured poses, deal them into folds, and write down the robot."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.contract import columns_of
from kinacc.kinematics import region, robot
from kinacc.measurements import folds
from kinacc.measurements.reader import UNCERTAINTY

TIME_BLOCK = "time_block"


def run(inputs: Mapping, settings: Mapping) -> dict[str, Columns]:
    """``measurements`` of the configured source, with fold and subset, and ``robot``."""
    arm, section = robot.load(settings["robot"]), settings["measurements"]
    if section["source"] == "synthetic":
        from kinacc import synthetic

        seen = synthetic.measure(arm, section["synthetic"], attitude(settings["evaluation"]))
    else:
        from kinacc.measurements.reader import read

        reading = read(section["file"], arm)
        for words in reading.left_out():
            warnings.warn(words, stacklevel=1)
        seen = reading.columns
    return {"measurements": split(seen, settings), "robot": _robot(arm)}


def attitude(evaluation: Mapping) -> region.Attitude:
    """The flange's attitude in the ``evaluation`` settings, which a calibration has to cover."""
    euler_rad = np.deg2rad(evaluation["reference_orientation_deg"])
    return region.Attitude(region.reference_rotation(euler_rad), evaluation["reference_frame"])


def split(columns: Mapping, settings: Mapping) -> Columns:
    """The columns with ``fold`` and ``subset``: whole configurations held out together.

    ``settings``: seed and the ``measurements`` section. Fold null without folds, and for the
    configurations of a session or target that could not be placed without them (with a warning
    that names these); the rows of the validation fold are the validation subset.
    """
    section = settings["measurements"]
    count = len(columns["pose"])
    fold = np.full(count, np.nan)
    if section["folds"] is not None:
        same = folds.configurations_of(columns)
        if section["fold_by"] == TIME_BLOCK:
            fold = folds.blocks(same, int(section["folds"])).astype(float)
        else:
            fold = folds.assign(same, int(section["folds"]), int(settings["seed"])).astype(float)
        labels = {kind: columns[kind] for kind in ("session", "target") if kind in columns}
        for kind, value, rows in folds.always_trained(fold, labels, same):
            fold[rows] = np.nan
            warnings.warn(
                f"{kind} {value} has fewer than {folds.LEAST_ROWS} rows outside one of its folds: "
                f"its {int(rows.sum())} rows always train and have no held-out error",
                stacklevel=2,
            )
    held_out = fold == (-1 if section["validation_fold"] is None else section["validation_fold"])
    subset = np.where(held_out, "validation", "train").astype(object)
    return {**_not_stated(count), **columns, "subset": subset, "fold": fold}


def _not_stated(count: int) -> Columns:
    """Null columns of all that a source of measurements need not state."""
    null = {name: np.full(count, np.nan) for name in ("row", "temperature_c", *UNCERTAINTY)}
    return null | {"session": np.full(count, None, dtype=object)}


def _robot(arm: robot.Robot) -> Columns:
    row = (arm.name, arm.source or None, arm.date or None, robot.as_yaml(arm))
    return columns_of("robot", [row])
