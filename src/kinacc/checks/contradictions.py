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
_SYNTHESISED = "mh180"
# A few gigabytes, or a day of work, each.
_MOST_CELLS, _MOST_TERMS = 2_000_000, 1_000_000
_MOST_SIMULATIONS, _MOST_READINGS, _MOST_HELD = 200_000, 10**9, 10**8


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
    measurements = full["measurements"]
    yield from _folds(measurements, place)
    yield from _frames(full["calibration"], place)
    if measurements["source"] == "file":
        yield from _file(name, measurements["file"], place, folder)
    else:
        yield from _synthetic(robot, full["calibration"], place)
    yield from _space(full, place)
    yield from _study(full, place)
    if robot is not None:
        yield from _arm(robot, full, place, folder)


def _synthetic(robot: str | None, calibration: Mapping[str, Any], place: Place):
    if calibration["base_and_tool"] == "estimated":
        yield Problem(
            place("calibration", "base_and_tool"),
            "estimated, but the synthetic arm is measured in its own base frame",
            "fixed where measurements.source is synthetic",
        )
    shipped = [item.stem for item in ROBOTS.glob("*.yaml")]
    if robot in shipped and robot != _SYNTHESISED:
        yield Problem(
            place("measurements", "source"),
            f"synthetic, but there is no synthetic {robot}",
            f"robot: {_SYNTHESISED}, or measurements of this robot in a file",
        )


def _space(full: Mapping[str, Any], place: Place) -> Iterator[Problem]:
    evaluation = full["evaluation"]
    if evaluation["space"] != "cylinder":
        return
    cylinder, grid_mm = evaluation["cylinder"], full["map"]["grid_mm"]
    sides_mm = [cylinder[key] for key in ("radial_span_mm", "height_mm")]

    def cells(apart_mm: float) -> int:
        sides = [math.ceil(each / apart_mm) + 1 for each in sides_mm]
        return len(full["map"]["slices_deg"]) * sides[0] * sides[1]

    if cells(grid_mm) > _MOST_CELLS:
        least_mm = next(mm for mm in count(math.ceil(grid_mm)) if cells(mm) <= _MOST_CELLS)
        what = f"{grid_mm:g} mm makes {cells(grid_mm)} cells over all slices"
        allowed = f"at most {_MOST_CELLS}: {least_mm} mm or more, or fewer map.slices_deg"
        yield Problem(place("map", "grid_mm"), what, allowed)
    low, high = cylinder["angle_deg"]
    outside = [f"{each:g}" for each in full["map"]["slices_deg"] if not low <= each <= high]
    if outside:
        yield Problem(
            place("map", "slices_deg"),
            f"slices at {', '.join(outside)} deg lie outside the space",
            f"angles from {low:g} to {high:g} deg (evaluation.cylinder.angle_deg)",
        )


def _study(full: Mapping[str, Any], place: Place) -> Iterator[Problem]:
    yield from _work(full, place)
    for section, key in (("study", "noise_mm"), ("map", "slices_deg")):
        values = full[section][key]
        told_apart = [round(value, 6) for value in values]  # a noise is addressed in nm
        if sorted(set(told_apart)) != told_apart:
            what = f"{shown(values)} is not rising"
            yield Problem(place(section, key), what, "each value once, rising")
    histories = full["histories"]
    if histories["eta_ratio_larger"] <= histories["eta_ratio_rejected"]:
        yield Problem(
            place("histories", "eta_ratio_larger"),
            f"{histories['eta_ratio_larger']:g} is not larger than eta_ratio_rejected",
            f"above {histories['eta_ratio_rejected']:g}",
        )


def _work(full: Mapping[str, Any], place: Place) -> Iterator[Problem]:
    """Numbers that are each fine and multiply to what no machine holds or finishes."""
    study, points = full["study"], full["evaluation"]["points"]
    noises, repetitions = len(study["noise_mm"]), study["repetitions"]
    measurements = study["measurements"]
    if noises * repetitions > _MOST_SIMULATIONS:
        what = f"{repetitions} simulations at each of {noises} noises"
        most = f"{_MOST_SIMULATIONS // noises} repetitions, or fewer of study.noise_mm"
        allowed = f"at most {_MOST_SIMULATIONS} in all: {most}"
        yield Problem(place("study", "repetitions"), what, allowed)
    elif noises * repetitions * measurements > _MOST_READINGS:
        what = f"{repetitions} repetitions at {noises} noises of {measurements} measurements"
        most = f"{_MOST_READINGS // (noises * measurements)} repetitions"
        allowed = f"at most {_MOST_READINGS} in all: {most}, or fewer study.measurements"
        yield Problem(place("study", "repetitions"), what, allowed)
    if min(points, measurements) * measurements > _MOST_HELD:
        what = f"{measurements} measurements, of which any of {points} points may take all"
        allowed = f"at most {_MOST_HELD:.0e}, points times measurements (evaluation.points)"
        yield Problem(place("study", "measurements"), what, allowed)
    if full["measurements"]["source"] == "synthetic":
        poses, volumetric = full["measurements"]["synthetic"]["poses"], full["calibration"]["vec"]
        order = volumetric["order"]
        order = volumetric["order_highest"] if order == "auto" else order
        if poses * (order + 1) > _MOST_TERMS:
            what = f"{poses} poses to fit polynomials of order {order} to"
            allowed = f"at most {_MOST_TERMS}, poses times order + 1 (calibration.vec)"
            yield Problem(place("measurements", "synthetic", "poses"), what, allowed)


def _arm(robot: str, full: Mapping[str, Any], place: Place, folder: Path) -> Iterator[Problem]:
    """Settings that speak of joints the robot has not; faults of a robot file are its reader's."""
    section = full["calibration"]["dh"]
    hayati = [] if section["hayati_joints"] == "auto" else section["hayati_joints"]
    told = rules(section["parameters"], JOINTS)[0]
    ranges = (("calibration", "vec", "joint_range"), ("evaluation", "joint_box", "joints_deg"))
    given = {keys: full[keys[0]][keys[1]][keys[2]] for keys in ranges}
    further = [kind for kind in asked_for(full["calibration"]) if kind not in ALWAYS]
    boxes = any(isinstance(pairs, list) for pairs in given.values())
    if not hayati and not told and not boxes and not further:
        return
    from kinacc.kinematics.robot import load, shipped

    try:
        arm = load(robot if robot in shipped() else folder / robot)
    except InputError:
        return
    joints = arm.dh.joints
    beyond = [each for each in hayati if each > joints]
    if beyond:
        what = f"{robot} has no joint {', '.join(map(str, beyond))}"
        yield Problem(place("calibration", "dh", "hayati_joints"), what, f"1 to {joints}")
    for kind in further:
        estimator = loaded(ESTIMATORS[kind])
        for keys, what, allowed in estimator.contradictions(full["calibration"], arm):
            yield Problem(place("calibration", kind, *keys), what, allowed)
    for rule, what, allowed in strangers(told, joints):
        yield Problem(place("calibration", "dh", "parameters", rule.name), what, allowed)
    for keys, pairs in given.items():
        if isinstance(pairs, list) and len(pairs) != joints:
            what = f"{len(pairs)} pairs for the {joints} joints of {robot}"
            yield Problem(place(*keys), what, "one pair per joint")
    box = given["evaluation", "joint_box", "joints_deg"] or ()
    limits = zip(arm.q_min_rad, arm.q_max_rad, arm.dh.prismatic, strict=True)
    for number, (pair, (low, high, slides)) in enumerate(zip(box, limits, strict=False), 1):
        if slides:
            continue
        low, high = (round(math.degrees(limit), 9) for limit in (low, high))
        if not low <= pair[0] < pair[1] <= high:
            what = f"{shown(pair)} reaches beyond the limits of joint {number} of {robot}"
            allowed = f"{low:g} to {high:g} deg"
            yield Problem(place("evaluation", "joint_box", "joints_deg"), what, allowed)


def _folds(measurements: Mapping[str, Any], place) -> Iterator[Problem]:
    folds, held_out = measurements["folds"], measurements["validation_fold"]
    if held_out is None:
        return
    if folds is None:
        yield Problem(
            place("measurements", "validation_fold"),
            f"fold {held_out} is held out, but there are no folds",
            "null where measurements.folds is null",
        )
    elif held_out >= folds:
        yield Problem(
            place("measurements", "validation_fold"),
            f"there is no fold {held_out} among {folds}, counted from 0",
            f"0 to {folds - 1}, or null",
        )


def _frames(calibration: Mapping[str, Any], place) -> Iterator[Problem]:
    if calibration["frames"] and calibration["base_and_tool"] == "fixed":
        yield Problem(
            place("calibration", "frames"),
            f"{', '.join(calibration['frames'])}, but base and tool are not estimated",
            "{} where calibration.base_and_tool is fixed",
        )


def _joints(name: str, joints: Mapping[str, Any], place, folder: Path) -> Iterator[Problem]:
    """What is wrong with joints in a file of their own."""
    if joints["path"] is None:
        return
    if not os.path.isfile(folder / joints["path"]):
        yield Problem(
            place("measurements", "file", "joints", "path"),
            f"{joints['path']!r} does not exist",
            "an existing CSV or Parquet file, relative to the folder of the configuration file",
        )
    for key in ("key", "key_of_points"):
        if joints["by"] != "order" and joints[key] is None:
            yield Problem(
                place("measurements", "file", "joints", key),
                f"data set {name} joins joints to points by {joints['by']}, and {key} is not given",
                "the name of a column",
            )


def _quoted(folder: Path, file: Mapping[str, Any]) -> bool:
    """Whether the delimiter may stand within numbers: in quotes, or in cells of a workbook."""
    from kinacc.measurements.files import quotes_numbers
    from kinacc.measurements.layout import Layout

    path = file["path"] and folder / file["path"]
    return bool(path) and os.path.isfile(path) and quotes_numbers(path, Layout.of(file))


def _file(name: str, file: Mapping[str, Any], place, folder: Path) -> Iterator[Problem]:
    if file["path"] is None:
        yield Problem(
            place("measurements", "source"),
            f"data set {name} reads a file, but measurements.file.path is not given",
            "path of a CSV, text, Excel or Parquet file",
        )
    elif not os.path.isfile(folder / file["path"]):
        is_folder = os.path.isdir(folder / file["path"])
        origin = file["source"]
        yield Problem(
            place("measurements", "file", "path"),
            f"{file['path']!r} {'is a folder' if is_folder else 'does not exist'}",
            "an existing CSV, text, Excel or Parquet file, relative to the folder of the "
            "configuration file",
            f"the data comes from: {' '.join(origin.split())}"
            if origin
            else "say where the data comes from with measurements.file.source",
        )
    marks = {file["decimal"], file["thousands"]}
    parts = file["delimiter"] if file["delimiter"] in marks and not _quoted(folder, file) else None
    if parts == file["decimal"]:
        yield Problem(
            place("measurements", "file", "decimal"),
            f"{shown(file['decimal'])} is also the delimiter",
            "a decimal mark that differs from the delimiter, or numbers in quotes",
        )
    if file["thousands"] is not None and file["thousands"] in (file["decimal"], parts):
        yield Problem(
            place("measurements", "file", "thousands"),
            f"{shown(file['thousands'])} is also the decimal mark or the delimiter",
            "a mark that differs from both",
        )
    yield from _joints(name, file["joints"], place, folder)
    taken = sorted(
        {
            each
            for each in file["columns"].values()
            if list(file["columns"].values()).count(each) > 1
        }
    )
    if taken:
        yield Problem(
            place("measurements", "file", "columns"),
            f"column {', '.join(taken)} stands for more than one name",
            "every column once",
        )
