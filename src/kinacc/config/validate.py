"""Check a merged configuration: structure, values, and settings that contradict each other."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from kinacc import removed
from kinacc.config.names import LONGEST
from kinacc.config.reading import KeyPath
from kinacc.config.schema import DATASET_NAME, Key, Section, defaults, settings
from kinacc.config.values import INVALID, Place, check, nearest, shown, unknown_key
from kinacc.errors import Problem, first_few

ROBOTS = Path(__file__).parents[1] / "kinematics" / "robots"
_MAPPINGS = (
    ("measurements", "file", "columns"),
    ("calibration", "dh", "parameters"),
    ("calibration", "frames"),
    ("data_check", "accept"),
)
_MOST_UNKNOWN = 100  # in one section: nobody misspells more, and each is held against all names
# Keys that a data set has and the top level has not.
ROBOT = Key("robot", "text", None, "name of a shipped robot, or path of a robot file")
SERIES = Key("series", "series", [], "measured files of one arm, a calibration each")


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
    unknown = [name for name in content if section.entry(name) is None]
    if len(unknown) > _MOST_UNKNOWN:
        what = f"has {len(unknown)} unknown keys, such as {first_few([*map(shown, unknown)], 3)}"
        return {}, [Problem(place(path), what, ", ".join(section.names))]
    for name, value in content.items():
        here, entry = (*path, name), section.entry(name)
        if entry is None and name in removed.KEYS:
            problems.append(Problem(place(here), f"{name} is gone", fix=removed.KEYS[name]))
        elif entry is None:
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
    allowed = f"at most {LONGEST} letters, digits, _ and -, the first not -"
    where = place(("datasets", name))
    if not isinstance(name, str):
        fix = "put the name in quotes"
        return [Problem(where, f"the data set's name {shown(name)} is not text", allowed, fix)]
    if not re.fullmatch(DATASET_NAME, name) or len(name) > LONGEST:
        return [Problem(where, f"{shown(name)} cannot be the name of a data set", allowed)]
    return []


def check_robot(robot: str, path: KeyPath, place: Place, folder: Path) -> list[Problem]:
    """A robot is one that is shipped, or a file that exists."""
    shipped = tuple(sorted(item.stem for item in ROBOTS.glob("*.yaml")))
    if robot in shipped or os.path.isfile(folder / robot):
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
        if isinstance(old, Mapping) and isinstance(value, Mapping):
            merged[name] = overlay(old, value)
        else:
            merged[name] = value
    return merged


def complete(shared: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Full settings of a data set: defaults, then the top level, then its own."""
    full = overlay(overlay(defaults(), shared), own)
    for keys in _MAPPINGS:  # one value each, not a section
        given, at = own, full
        for key in keys[:-1]:
            given, at = given.get(key, {}), at[key]
        if given.get(keys[-1]) is not None:
            at[keys[-1]] = dict(given[keys[-1]])
    return full
