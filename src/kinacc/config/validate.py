"""Check a merged configuration: structure, values, and settings that contradict each other."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from kinacc.config.reading import KeyPath
from kinacc.config.schema import DATASET_NAME, Key, Section, defaults, settings
from kinacc.config.values import INVALID, Place, check, nearest, shown, unknown_key
from kinacc.errors import Problem

ROBOTS = Path(__file__).parents[1] / "robots"
ROBOT = Key("robot", "text", None, "name of a shipped robot, or path of a robot file")


def check_section(
    section: Section, content: Any, path: KeyPath, place: Place
) -> tuple[dict[str, Any], list[Problem]]:
    """The usable values of a section as given, and everything wrong with the others."""
    if content is None:
        content = {}
    if not isinstance(content, Mapping):
        what = f"{shown(content)} is not a section"
        return {}, [Problem(place(path), what, f"keys: {', '.join(section.names)}")]
    usable: dict[str, Any] = {}
    problems: list[Problem] = []
    for name, value in content.items():
        here, entry = (*path, name), section.entry(name)
        if entry is None:
            what, fix = unknown_key(name, section, settings())
            problems.append(Problem(place(here), what, ", ".join(section.names), fix))
        elif isinstance(entry, Section):
            usable[name], found = check_section(entry, value, here, place)
            problems += found
        else:
            cleaned, found = check(entry, value, here, place)
            problems += found
            if cleaned is not INVALID:
                usable[name] = cleaned
    return usable, problems


def check_dataset_name(name: Any, place: Place) -> list[Problem]:
    """A name becomes a folder below results/, so it may not lead anywhere else."""
    allowed = "letters, digits, _ and -"
    where = place(("datasets", name))
    if not isinstance(name, str):
        fix = "put the name in quotes"
        return [Problem(where, f"the data set's name {shown(name)} is not text", allowed, fix)]
    if not re.fullmatch(DATASET_NAME, name):
        return [Problem(where, f"{shown(name)} cannot be the name of a data set", allowed)]
    return []


def check_robot(robot: str, path: KeyPath, place: Place, folder: Path) -> list[Problem]:
    """A robot is one that is shipped, or a file that exists."""
    shipped = tuple(sorted(item.stem for item in ROBOTS.glob("*.yaml")))
    if robot in shipped or (folder / robot).is_file():
        return []
    allowed = f"{', '.join(shipped)}, or the path of a robot file"
    if robot.endswith((".yaml", ".yml")) or "/" in robot:
        return [Problem(place(path), f"there is no robot file {shown(robot)}", allowed)]
    close = nearest(robot, shipped)
    fix = f"did you mean {close}?" if close else ""
    return [Problem(place(path), f"there is no robot {shown(robot)}", allowed, fix)]


def overlay(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """``below`` with the values of ``above`` laid over it, section by section."""
    merged = dict(below)
    for name, value in above.items():
        old = merged.get(name)
        both = isinstance(old, Mapping) and isinstance(value, Mapping)
        merged[name] = overlay(old, value) if both else value
    return merged


def complete(shared: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Full settings of a data set: defaults, then the top level, then its own."""
    full = overlay(overlay(defaults(), shared), own)
    columns = own.get("measurements", {}).get("file", {}).get("columns")
    if columns is not None:  # a mapping of names is one value, not a section
        full["measurements"]["file"]["columns"] = dict(columns)
    return full


def contradictions(name: str, full: Mapping[str, Any], place, folder: Path) -> Iterator[Problem]:
    """Settings of one data set that are each fine and cannot be together.

    ``place(*keys)`` words where a setting of this data set comes from.
    """
    measurements, evaluation = full["measurements"], full["evaluation"]
    calibration, histories = full["calibration"], full["histories"]
    yield from _folds(measurements, place)
    if measurements["source"] == "file":
        yield from _file(name, measurements["file"], place, folder)
    if calibration["base_and_tool"] == "estimated" and measurements["source"] == "synthetic":
        yield Problem(
            place("calibration", "base_and_tool"),
            "estimated, but the synthetic arm is measured in its own base frame",
            "fixed where measurements.source is synthetic",
        )
    if evaluation["space"] == "cylinder" and calibration["base_and_tool"] == "estimated":
        yield Problem(
            place("evaluation", "space"),
            "cylinder, but base and tool are estimated",
            "measured or joint_box where calibration.base_and_tool is estimated",
        )
    span = evaluation["cylinder"]["angle_deg"]
    if evaluation["space"] == "cylinder":
        outside = [each for each in full["map"]["slices_deg"] if not span[0] <= each <= span[1]]
        if outside:
            yield Problem(
                place("map", "slices_deg"),
                f"slices at {', '.join(f'{each:g}' for each in outside)} deg lie outside the space",
                f"angles from {span[0]:g} to {span[1]:g} deg (evaluation.cylinder.angle_deg)",
            )
    noise = full["study"]["noise_mm"]
    if sorted(set(noise)) != list(noise):
        yield Problem(
            place("study", "noise_mm"), f"{shown(noise)} is not rising", "each value once, rising"
        )
    if histories["eta_ratio_larger"] <= histories["eta_ratio_rejected"]:
        yield Problem(
            place("histories", "eta_ratio_larger"),
            f"{histories['eta_ratio_larger']:g} is not larger than eta_ratio_rejected",
            f"above {histories['eta_ratio_rejected']:g}",
        )


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


def _file(name: str, file: Mapping[str, Any], place, folder: Path) -> Iterator[Problem]:
    if file["path"] is None:
        yield Problem(
            place("measurements", "source"),
            f"data set {name} reads a file, but measurements.file.path is not given",
            "path of a CSV or Parquet file",
        )
    elif not (folder / file["path"]).is_file():
        is_folder = (folder / file["path"]).is_dir()
        origin = file["source"]
        yield Problem(
            place("measurements", "file", "path"),
            f"{shown(file['path'])} {'is a folder' if is_folder else 'does not exist'}",
            "an existing CSV or Parquet file, relative to the folder the run starts in",
            f"the data comes from: {' '.join(origin.split())}"
            if origin
            else "say where the data comes from with measurements.file.source",
        )
    if file["delimiter"] == file["decimal"]:
        yield Problem(
            place("measurements", "file", "decimal"),
            f"{shown(file['decimal'])} is also the delimiter",
            "a decimal mark that differs from the delimiter",
        )
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
