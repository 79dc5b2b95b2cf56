"""Settings of one data set that cannot be together with the files and the robot they name."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from kinacc.config import load as configuration
from kinacc.config.error_models import ALWAYS, ERROR_MODELS, asked_for, loaded
from kinacc.config.parameter_rules import rules
from kinacc.config.records import Settings
from kinacc.config.settings import ROBOTS
from kinacc.errors import InputError, Problem

Place = Callable[[tuple[Any, ...]], str]
Found = Iterator[
    tuple[Any, ...]
]  # keys of the setting, what is wrong, what is allowed, and a remedy
_FILE = ("measurements", "file")


def load(
    paths: Sequence[Path | str],
    overrides: Mapping[str, Any] | None = None,
    folder: Path | str = ".",
    source: str = configuration.COMMAND_LINE,
) -> dict[str, dict[str, Any]]:
    """Read full settings of every data set, held to each other and to the robots they name.

    Parameters
    ----------
    paths, overrides, folder, source
        As of :func:`kinacc.config.load.load`.

    Returns
    -------
    dict
        ``{name: settings}``.

    Raises
    ------
    InputError
        Listing every problem in all files.
    """
    return configuration.load(paths, overrides, folder, contradictions, source)


def contradictions(full: Settings, place: Place, folder: Path) -> Iterator[Problem]:
    """Contradictions in the full settings of a data set; paths are relative to ``folder``."""
    is_file = full["measurements"]["source"] == "file"
    results = _file(full["measurements"]["file"], folder) if is_file else _synthetic(full)
    for keys, *text in (*results, *_arm(full, folder)):
        yield Problem(place(keys), *text)


def _synthetic(full: Settings) -> Found:
    robot = full["robot"]
    if robot != "mh180" and (ROBOTS / f"{robot}.yaml").is_file():
        message = f"synthetic, but there is no synthetic {robot}"
        yield ("measurements", "source"), message, "robot: mh180, or a measured file"
    if full["calibration"]["base_and_tool"] == "estimated":
        message = "estimated, but the synthetic arm is measured in its own base frame"
        yield ("calibration", "base_and_tool"), message, "fixed"


def _file(file: Mapping[str, Any], folder: Path) -> Found:
    """Files that are not there, and marks of numbers that are equal."""
    if file["path"] is None:
        message = "file, but measurements.file.path is not given"
        yield ("measurements", "source"), message, "path of a CSV, text, Excel or Parquet file"
    for keys, path in ((("path",), file["path"]), (("joints", "path"), file["joints"]["path"])):
        if path is not None and not os.path.isfile(folder / path):
            source = file["source"] and f"the data comes from: {' '.join(file['source'].split())}"
            fix = source or "write where the data comes from into measurements.file.source"
            yield (*_FILE, *keys), f"{path!r} does not exist", "an existing file", fix
    # A delimiter within numbers may be quoted; elsewhere it makes rows of too many cells.
    if (mark := file["thousands"]) == file["decimal"]:
        yield (*_FILE, "thousands"), f"{mark!r} is also the decimal mark", "another mark"


def _arm(full: Settings, folder: Path) -> Found:
    """Settings of joints the robot does not have; faults of a robot file are its reader's."""
    from kinacc.kinematics.robot import load, shipped

    robot, calibration = full["robot"], full["calibration"]
    try:
        arm = load(robot if robot in shipped() else folder / robot)
    except InputError:
        return
    joints = arm.dh.joints
    hayati = calibration["dh"]["hayati_joints"]
    if hayati != "auto" and max(hayati, default=0) > joints:
        message = f"{robot} has no joint {max(hayati)}"
        yield ("calibration", "dh", "hayati_joints"), message, f"1 to {joints}"
    for kind in asked_for(calibration):
        if kind not in ALWAYS:
            for keys, *text in loaded(ERROR_MODELS[kind].estimator).contradictions(
                calibration, arm
            ):
                yield ("calibration", kind, *keys), *text
    for rule in rules(calibration["dh"]["parameters"]):
        if rule.joint is not None and not 1 <= rule.joint <= joints:
            message = f"there is no joint {rule.joint}"
            yield ("calibration", "dh", "parameters", rule.name), message, f"1 to {joints}"
    pairs = calibration["vec"]["joint_range"]
    if isinstance(pairs, list) and len(pairs) != joints:
        message = f"{len(pairs)} pairs for the {joints} joints of {robot}"
        yield ("calibration", "vec", "joint_range"), message, "one per joint"
