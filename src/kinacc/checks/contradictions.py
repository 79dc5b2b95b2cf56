"""Settings of one data set that are each fine and cannot be together.

Every rule yields problems; ``place(*keys)`` words where a setting of the data set comes from.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any

from kinacc.config import load as configuration
from kinacc.config.error_models import ALWAYS, ESTIMATORS, asked_for, loaded
from kinacc.config.parameter_rules import JOINTS, rules, strangers
from kinacc.config.validate import ROBOTS
from kinacc.config.values import shown
from kinacc.errors import InputError, Problem

Place = Callable[..., str]
Found = Iterator[tuple]  # keys of the setting, what is wrong, what is allowed, and a remedy
_SYNTHESISED = "mh180"
# A few gigabytes, or a day of work, each.
_MOST_CELLS, _MOST_TERMS = 2_000_000, 1_000_000
_MOST_SIMULATIONS, _MOST_READINGS, _MOST_HELD = 200_000, 10**9, 10**8
_FILE = ("measurements", "file")


def load(
    paths: Sequence[Path | str],
    overrides: Mapping[str, Any] | None = None,
    folder: Path | str = ".",
) -> dict[str, dict[str, Any]]:
    """Full settings of every data set, by name, held to each other and to the robots they name.

    As :func:`kinacc.config.load.load`. Raises InputError listing every problem in all files.
    """
    return configuration.load(paths, overrides, folder, contradictions)


def contradictions(
    name: str, robot: str | None, full: Mapping[str, Any], place: Place, folder: Path
) -> Iterator[Problem]:
    """All contradictions in the full settings of data set ``name``.

    Paths are relative to ``folder``; ``robot`` is None where it is itself in question.
    """
    is_file = full["measurements"]["source"] == "file"
    for keys, *words in (
        *_fits(full),
        *(
            _file(name, full["measurements"]["file"], folder)
            if is_file
            else _synthetic(robot, full)
        ),
        *_space(full),
        *_study(full),
        *(() if robot is None else _arm(robot, full, folder)),
    ):
        yield Problem(place(*keys), *words)


def _fits(full: Mapping[str, Any]) -> Found:
    """Folds and frames."""
    measurements, calibration = full["measurements"], full["calibration"]
    folds, held_out = measurements["folds"], measurements["validation_fold"]
    if held_out is not None and held_out >= (folds or 0):
        what = f"there is no fold {held_out} where measurements.folds is {shown(folds)}"
        allowed = f"0 to {folds - 1}, or null" if folds else "null where there are no folds"
        yield ("measurements", "validation_fold"), what, allowed
    if calibration["frames"] and calibration["base_and_tool"] == "fixed":
        what = f"{', '.join(calibration['frames'])}, but base and tool are not estimated"
        allowed = "{} where calibration.base_and_tool is fixed"
        yield ("calibration", "frames"), what, allowed


def _synthetic(robot: str | None, full: Mapping[str, Any]) -> Found:
    if full["calibration"]["base_and_tool"] == "estimated":
        what = "estimated, but the synthetic arm is measured in its own base frame"
        allowed = "fixed where measurements.source is synthetic"
        yield ("calibration", "base_and_tool"), what, allowed
    if robot != _SYNTHESISED and robot in [item.stem for item in ROBOTS.glob("*.yaml")]:
        allowed = f"robot: {_SYNTHESISED}, or measurements of this robot in a file"
        yield ("measurements", "source"), f"synthetic, but there is no synthetic {robot}", allowed
    poses, volumetric = full["measurements"]["synthetic"]["poses"], full["calibration"]["vec"]
    order = volumetric["order"]
    order = volumetric["order_highest"] if order == "auto" else order
    if poses * (order + 1) > _MOST_TERMS:
        what = f"{poses} poses to fit polynomials of order {order} to"
        allowed = f"at most {_MOST_TERMS}, poses times order + 1 (calibration.vec)"
        yield ("measurements", "synthetic", "poses"), what, allowed


def _space(full: Mapping[str, Any]) -> Found:
    evaluation, cut = full["evaluation"], full["map"]
    if evaluation["space"] != "cylinder":
        return
    cylinder = evaluation["cylinder"]

    def cells(apart_mm: float) -> int:
        sides = [math.ceil(cylinder[key] / apart_mm) + 1 for key in ("radial_span_mm", "height_mm")]
        return len(cut["slices_deg"]) * sides[0] * sides[1]

    grid_mm = cut["grid_mm"]
    if cells(grid_mm) > _MOST_CELLS:
        least_mm = next(mm for mm in count(math.ceil(grid_mm)) if cells(mm) <= _MOST_CELLS)
        what = f"{grid_mm:g} mm makes {cells(grid_mm)} cells over all slices"
        allowed = f"at most {_MOST_CELLS}: {least_mm} mm or more, or fewer map.slices_deg"
        yield ("map", "grid_mm"), what, allowed
    low, high = cylinder["angle_deg"]
    outside = [f"{each:g}" for each in cut["slices_deg"] if not low <= each <= high]
    if outside:
        what = f"slices at {', '.join(outside)} deg lie outside the space"
        allowed = f"angles from {low:g} to {high:g} deg (evaluation.cylinder.angle_deg)"
        yield ("map", "slices_deg"), what, allowed


def _study(full: Mapping[str, Any]) -> Found:
    """Orders of values, and numbers that multiply to what no machine holds or finishes."""
    study, points, histories = full["study"], full["evaluation"]["points"], full["histories"]
    for section, key in (("study", "noise_mm"), ("map", "slices_deg")):
        values = [round(value, 6) for value in full[section][key]]  # a noise is addressed in nm
        if sorted(set(values)) != values:
            yield (section, key), f"{shown(full[section][key])} is not rising", "each once, rising"
    if histories["eta_ratio_larger"] <= histories["eta_ratio_rejected"]:
        what = f"{histories['eta_ratio_larger']:g} is not larger than eta_ratio_rejected"
        allowed = f"above {histories['eta_ratio_rejected']:g}"
        yield ("histories", "eta_ratio_larger"), what, allowed
    noises, readings = len(study["noise_mm"]), study["measurements"]
    most = min(_MOST_SIMULATIONS // noises, _MOST_READINGS // (noises * readings))
    if study["repetitions"] > most:
        what = f"{study['repetitions']} at {noises} noises of {readings} measurements each"
        allowed = f"at most {most}, or fewer of study.noise_mm or study.measurements"
        yield ("study", "repetitions"), what, allowed
    if min(points, readings) * readings > _MOST_HELD:
        what = f"{readings} measurements, of which any of {points} points may take all"
        allowed = f"at most {_MOST_HELD:.0e}, points times measurements (evaluation.points)"
        yield ("study", "measurements"), what, allowed


def _arm(robot: str, full: Mapping[str, Any], folder: Path) -> Found:
    """Settings of joints the robot does not have; faults of a robot file are its reader's."""
    from kinacc.kinematics.robot import load, shipped

    section = full["calibration"]["dh"]
    hayati = [] if section["hayati_joints"] == "auto" else section["hayati_joints"]
    told = rules(section["parameters"], JOINTS)[0]
    ranges = (("calibration", "vec", "joint_range"), ("evaluation", "joint_box", "joints_deg"))
    boxes = [(keys, full[keys[0]][keys[1]][keys[2]]) for keys in ranges]
    boxes = [(keys, pairs) for keys, pairs in boxes if isinstance(pairs, list)]
    further = [kind for kind in asked_for(full["calibration"]) if kind not in ALWAYS]
    if not (hayati or told or boxes or further):
        return
    try:
        arm = load(robot if robot in shipped() else folder / robot)
    except InputError:
        return
    joints = arm.dh.joints
    if beyond := [each for each in hayati if each > joints]:
        what = f"{robot} has no joint {', '.join(map(str, beyond))}"
        yield ("calibration", "dh", "hayati_joints"), what, f"1 to {joints}"
    for kind in further:
        for keys, *words in loaded(ESTIMATORS[kind]).contradictions(full["calibration"], arm):
            yield ("calibration", kind, *keys), *words
    for rule, *words in strangers(told, joints):
        yield ("calibration", "dh", "parameters", rule.name), *words
    for keys, pairs in boxes:
        if len(pairs) != joints:
            what = f"{len(pairs)} pairs for the {joints} joints of {robot}"
            yield keys, what, "one pair per joint"
    box = dict(boxes).get(ranges[1], ())
    limits = zip(box, arm.q_min_rad, arm.q_max_rad, arm.dh.prismatic, strict=False)
    for number, (pair, *ends, slides) in enumerate(limits, 1):
        low, high = (round(math.degrees(limit), 9) for limit in ends)
        if not slides and not low <= pair[0] < pair[1] <= high:
            what = f"{shown(pair)} reaches beyond the limits of joint {number} of {robot}"
            yield ranges[1], what, f"{low:g} to {high:g} deg"


def _file(name: str, file: Mapping[str, Any], folder: Path) -> Found:
    path, joints, columns = file["path"], file["joints"], list(file["columns"].values())
    if path is None:
        what = f"data set {name} reads a file, but measurements.file.path is not given"
        yield ("measurements", "source"), what, "path of a CSV, text, Excel or Parquet file"
    elif not os.path.isfile(folder / path):
        is_folder, origin = os.path.isdir(folder / path), file["source"]
        yield (
            (*_FILE, "path"),
            f"{path!r} {'is a folder' if is_folder else 'does not exist'}",
            "an existing CSV, text, Excel or Parquet file, relative to the folder of the "
            "configuration file",
            f"the data comes from: {' '.join(origin.split())}"
            if origin
            else "say where the data comes from with measurements.file.source",
        )
    decimal, thousands, parts = file["decimal"], file["thousands"], file["delimiter"]
    if parts in (decimal, thousands) and _quoted(folder, file):
        parts = None
    if parts == decimal:
        allowed = "a decimal mark that differs from the delimiter, or numbers in quotes"
        yield (*_FILE, "decimal"), f"{shown(decimal)} is also the delimiter", allowed
    if thousands is not None and thousands in (decimal, parts):
        what = f"{shown(thousands)} is also the decimal mark or the delimiter"
        yield (*_FILE, "thousands"), what, "a mark that differs from both"
    if joints["path"] is not None:
        if not os.path.isfile(folder / joints["path"]):
            allowed = "an existing CSV or Parquet file, relative to the folder of this file"
            yield (*_FILE, "joints", "path"), f"{joints['path']!r} does not exist", allowed
        for key in ("key", "key_of_points"):
            if joints["by"] != "order" and joints[key] is None:
                what = f"is not given, and joints are joined to points by {joints['by']}"
                yield (*_FILE, "joints", key), what, "the name of a column"
    if taken := sorted({each for each in columns if columns.count(each) > 1}):
        what = f"column {', '.join(taken)} stands for more than one name"
        yield (*_FILE, "columns"), what, "every column once"


def _quoted(folder: Path, file: Mapping[str, Any]) -> bool:
    """Whether the delimiter may stand within numbers: in quotes, or in cells of a workbook."""
    from kinacc.measurements.files import quotes_numbers
    from kinacc.measurements.layout import Layout

    path = file["path"] and folder / file["path"]
    return bool(path) and os.path.isfile(path) and quotes_numbers(path, Layout.of(file))
