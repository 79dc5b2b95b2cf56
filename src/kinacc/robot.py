"""Nominal description of an arm: DH table, joint limits, how reported joints turn the axes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.models.dh import DHModel

_DH_KEYS = {
    "theta_offset_deg": True,
    "d_mm": False,
    "a_mm": False,
    "alpha_deg": True,
    "beta_deg": True,
}
_KEYS = {"name", "source", "dh", "limits_deg", "joint_map"}


@dataclass(frozen=True)
class Robot:
    """An arm as its maker describes it.

    ``dh`` is the nominal model; ``q_min_rad`` and ``q_max_rad`` (k,) limit the reported joints;
    ``joint_map`` (k, k) turns reported joints into DH angles (signs and couplings);
    ``source`` says where the figures come from.
    """

    name: str
    dh: DHModel
    q_min_rad: np.ndarray
    q_max_rad: np.ndarray
    joint_map: np.ndarray
    source: str


def shipped() -> list[str]:
    """Names of the robots that come with kinacc."""
    folder = resources.files("kinacc") / "robots"
    return sorted(item.name[:-5] for item in folder.iterdir() if item.name.endswith(".yaml"))


def load(name_or_path: str | Path) -> Robot:
    """Robot of a shipped name or of a YAML file (lengths in mm, angles in degrees).

    Raises InputError listing everything that is wrong with the description.
    """
    text, place = _text(name_or_path)
    import yaml

    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise InputError(Problem(place, f"is not readable YAML: {error}")) from None
    problems = _problems(content, place)
    if problems:
        raise InputError(problems, f"The robot description {place} cannot be used")
    return _robot(content)


def dh_angles(robot: Robot, q_rad: np.ndarray) -> np.ndarray:
    """DH joint angles (n, k) of reported joints (n, k)."""
    return np.asarray(q_rad, dtype=float) @ robot.joint_map.T


def _text(name_or_path: str | Path) -> tuple[str, str]:
    name = str(name_or_path)
    if name in shipped():
        return (resources.files("kinacc") / "robots" / f"{name}.yaml").read_text(), f"{name}.yaml"
    path = Path(name)
    if not path.is_file():
        raise InputError(
            Problem(
                name,
                "is neither a shipped robot nor a file",
                f"one of {', '.join(shipped())}, or the path of a robot YAML",
            )
        )
    return path.read_text(), name


def _problems(content: object, place: str) -> list[Problem]:
    if not isinstance(content, dict):
        return [Problem(place, "is not a table of keys", ", ".join(sorted(_KEYS)))]
    found = [
        Problem(f"{place}: {key}", "unknown key", ", ".join(sorted(_KEYS)))
        for key in content
        if key not in _KEYS
    ]
    rows, limits = content.get("dh"), content.get("limits_deg")
    if not isinstance(rows, list) or not rows:
        return [*found, Problem(f"{place}: dh", "missing", "a list with one row per joint")]
    for number, row in enumerate(rows, 1):
        found += _row_problems(row, f"{place}: dh, joint {number}")
    if not isinstance(limits, list) or len(limits) != len(rows):
        found.append(Problem(f"{place}: limits_deg", "wrong length", f"{len(rows)} pairs"))
    else:
        for number, pair in enumerate(limits, 1):
            good = isinstance(pair, list) and len(pair) == 2 and all(map(_is_number, pair))
            if not good or pair[0] >= pair[1]:
                where = f"{place}: limits_deg, joint {number}"
                found.append(Problem(where, f"{pair!r}", "[lower, upper] in degrees"))
    if "joint_map" in content:
        found += _map_problems(content["joint_map"], len(rows), place)
    return found


def _row_problems(row: object, where: str) -> list[Problem]:
    allowed = ", ".join(_DH_KEYS)
    if not isinstance(row, dict):
        return [Problem(where, f"{row!r} is not a row of DH values", allowed)]
    found = [Problem(where, f"unknown key {key!r}", allowed) for key in row if key not in _DH_KEYS]
    for key in _DH_KEYS:
        if key not in row and key != "beta_deg":
            found.append(Problem(where, f"{key} is missing", "a number"))
        elif key in row and not _is_number(row[key]):
            found.append(Problem(where, f"{key} is {row[key]!r}", "a finite number"))
    return found


def _map_problems(matrix: object, joints: int, place: str) -> list[Problem]:
    where, allowed = f"{place}: joint_map", f"an invertible {joints} x {joints} matrix of numbers"
    square = (
        isinstance(matrix, list)
        and len(matrix) == joints
        and all(isinstance(row, list) and len(row) == joints for row in matrix)
        and all(_is_number(value) for row in matrix for value in row)
    )
    if not square:
        return [Problem(where, "wrong shape or values", allowed)]
    if abs(np.linalg.det(np.array(matrix, dtype=float))) < 1e-9:
        return [Problem(where, "is singular", allowed)]
    return []


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _robot(content: dict) -> Robot:
    columns = {
        key: np.array([float(row.get(key, 0.0)) for row in content["dh"]]) for key in _DH_KEYS
    }
    in_rad = [np.deg2rad(values) if _DH_KEYS[key] else values for key, values in columns.items()]
    limits = np.deg2rad(np.array(content["limits_deg"], dtype=float))
    joints = len(content["dh"])
    return Robot(
        name=str(content.get("name", "robot")),
        dh=DHModel(*in_rad),
        q_min_rad=limits[:, 0],
        q_max_rad=limits[:, 1],
        joint_map=np.array(content.get("joint_map", np.eye(joints)), dtype=float),
        source=str(content.get("source", "")),
    )
