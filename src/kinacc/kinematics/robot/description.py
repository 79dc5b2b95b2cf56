"""Robots by name or file: YAML with every fault listed, or URDF."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.config.names import not_in_a_line
from kinacc.config.reading import Document, parsed, read
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import (
    IDENTITY,
    Pose,
    compose,
    exp_so3,
    rotation_from_quaternion,
    rotation_x,
    rotation_y,
    rotation_z,
)
from kinacc.kinematics.dh import DHModel
from kinacc.kinematics.robot.forms import from_modified
from kinacc.kinematics.robot.reader import ANGLE, LENGTH, Reader
from kinacc.kinematics.robot.record import FEWEST_JOINTS, MOST_JOINTS, Robot

_SHIPPED = Path(__file__).parents[1] / "robots"
_ANGLES, _LENGTHS = ("theta_offset", "alpha", "beta"), ("d", "a")
_LIMITS = ("limits_deg", "limits_rad", "limits_mm", "limits_m")
_ROW_KEYS = (
    "joint",
    "name",
    "theta_offset_deg",
    "theta_offset_rad",
    "d_mm",
    "d_m",
    "a_mm",
    "a_m",
    "alpha_deg",
    "alpha_rad",
    "beta_deg",
    "beta_rad",
    "sign",
    *_LIMITS,
)
_ABOUT_KEYS = ("name", "source", "date")
_DH_KEYS = (*_ABOUT_KEYS, "convention", "dh", *_LIMITS[:2], "joint_map", "base", "flange", "tool")
_URDF_KEYS = (*_ABOUT_KEYS, "urdf", "base_link", "tip_link", "joint_map", "tool")
_FRAME_KEYS = (
    "position_mm",
    "position_m",
    "quaternion_wxyz",
    "rotation_vector_deg",
    "rotation_vector_rad",
    "rpy_deg",
    "rpy_rad",
)


def shipped() -> list[str]:
    """Names of the robots that come with kinacc."""
    return sorted(path.stem for path in _SHIPPED.glob("*.yaml"))


def load(name_or_path: str | Path) -> Robot:
    """Robot of a shipped name, of a YAML file or of a URDF file.

    Raises InputError listing everything that is wrong with the description.
    """
    path = _path(name_or_path)
    if path.suffix.lower() in (".urdf", ".xacro", ".xml"):
        from kinacc.kinematics.robot import urdf

        return urdf.load(path)
    document, problems = read(path)
    if path.parent == _SHIPPED:
        document = replace(document, name=path.name)
    return _described(document, problems, path)


def of_text(text: str, name: str) -> Robot:
    """Robot of the text of a robot YAML, as ``as_yaml`` writes it; ``name`` is for messages.

    Raises InputError as ``load`` does.
    """
    return _described(*parsed(text, name), Path(name))


def _described(document: Document, problems: list[Problem], path: Path) -> Robot:
    title = f"The robot description {document.name} cannot be used"
    refuse(problems, title)
    reader = Reader(document)
    robot = _from_urdf(reader, path) if "urdf" in document.data else _from_table(reader)
    if reader.problems or robot is None:
        raise InputError(reader.in_order(), title)
    return robot


def files(name_or_path: str | Path) -> list[Path]:
    """Files outside the package that a description is read from; none for a shipped robot."""
    path = _path(name_or_path)
    if path.parent == _SHIPPED:
        return []
    if path.suffix.lower() not in (".yaml", ".yml"):
        return [path]
    inner = read(path)[0].data.get("urdf")
    named = [path.parent / inner] if isinstance(inner, str) else []
    return [path, *(file for file in named if os.path.isfile(file))]


def _path(name_or_path: str | Path) -> Path:
    name = str(name_or_path)
    if name in shipped():
        return _SHIPPED / f"{name}.yaml"
    path = Path(name)
    if not os.path.isfile(path):  # false, too, for a name no file can have
        allowed = f"one of {', '.join(shipped())}, or the path of a robot YAML or URDF"
        raise InputError(Problem(name, "is neither a shipped robot nor a file", allowed))
    return path


# --- a table of DH rows ---------------------------------------------------------------------------


def _from_table(reader: Reader) -> Robot | None:
    content = reader.document.data
    reader.known_keys(content, _DH_KEYS)
    rows = content.get("dh")
    if not isinstance(rows, list) or not rows:
        reader.fault(("dh",), "missing", "a list with one row per joint, or urdf with a file")
        return None
    if not FEWEST_JOINTS <= len(rows) <= MOST_JOINTS:
        reader.fault(("dh",), f"has {len(rows)} joints", f"{FEWEST_JOINTS} to {MOST_JOINTS}")
        if len(rows) > MOST_JOINTS:
            return None
    table = _rows(reader, rows)
    limits = _limits(reader, content, rows, table.prismatic)
    joint_map = _joint_map(reader, content, rows)
    convention = content.get("convention", "standard")
    if convention not in ("standard", "modified"):
        reader.fault(("convention",), "unknown", "standard, modified (Craig)", value=convention)
    base, flange, tool = (_frame(reader, content, key) for key in ("base", "flange", "tool"))
    if reader.problems:
        return None
    if convention == "modified":
        table, before = from_modified(table)
        base = compose(base, before)
    return Robot(
        **_about(reader, "robot"),
        dh=table,
        q_min_rad=limits[:, 0],
        q_max_rad=limits[:, 1],
        joint_map=joint_map,
        base=base,
        flange=flange,
        tool=tool,
        joint_names=tuple(str(row.get("name", f"joint {i}")) for i, row in enumerate(rows, 1)),
    )


def _rows(reader: Reader, rows: list) -> DHModel:
    """The table as it is given; NaN where something is missing, with a problem for each."""
    columns: dict[str, list[float]] = {name: [] for name in (*_ANGLES, *_LENGTHS)}
    prismatic = []
    for number, row in enumerate(rows):
        path = ("dh", number)
        if not isinstance(row, Mapping):
            reader.fault(path, "is not a row of DH values", ", ".join(_ROW_KEYS), value=row)
            row = dict.fromkeys(("theta_offset_rad", "d_mm", "a_mm", "alpha_rad"), 0.0)
        reader.known_keys(row, _ROW_KEYS, path)
        for name in _ANGLES:
            default = 0.0 if name == "beta" else None
            columns[name].append(reader.quantity(row, name, ANGLE, path, default))
        for name in _LENGTHS:
            columns[name].append(reader.quantity(row, name, LENGTH, path))
        kind = row.get("joint", "revolute")
        if kind not in ("revolute", "prismatic"):
            reader.fault((*path, "joint"), "unknown", "revolute, prismatic", value=kind)
        if row.get("sign", 1) not in (1, -1) or isinstance(row.get("sign"), bool):
            reader.fault((*path, "sign"), "is no sign", "1, -1", value=row["sign"])
        prismatic.append(kind == "prismatic")
    total = np.nansum(np.abs(columns["d"])) + np.nansum(np.abs(columns["a"]))
    if 0.0 < total < 20.0:
        fix = "if they were meant in metres, write d_m and a_m"
        reader.fault(("dh",), f"all lengths together are {total:g} mm", "an arm's lengths", fix)
    return DHModel(
        columns["theta_offset"],
        columns["d"],
        columns["a"],
        columns["alpha"],
        columns["beta"],
        prismatic,
    )


def _limits(reader: Reader, content: Mapping, rows: list, prismatic: np.ndarray) -> np.ndarray:
    """Limits (k, 2) of the reported joints, from the rows or from one list for all."""
    shared = reader.unit_key(content, "limits", ANGLE, ())
    listed = content.get(shared) if shared else None
    if shared and (not isinstance(listed, list) or len(listed) != len(rows)):
        reader.fault((shared,), "wrong length", f"{len(rows)} pairs, one per joint")
        return np.full((len(rows), 2), np.nan)
    limits = np.full((len(rows), 2), np.nan)
    in_degrees = []
    for number, row in enumerate(rows):
        row = row if isinstance(row, Mapping) else {}
        units = LENGTH if prismatic[number] else ANGLE
        given = [key for key in _LIMITS if key in row]
        path, value = ("dh", number, *given[:1]), row.get(given[0]) if given else None
        if listed is not None and not prismatic[number]:
            if given:
                reader.fault(path, f"given twice, also in {shared}", "in one of the two places")
            path, value, given = (shared, number), listed[number], [shared]
        unit = given[0].rpartition("_")[2] if given else ""
        if not given:
            names = " or ".join(f"limits_{unit}" for unit in units)
            reader.fault(path, "its limits are missing", f"[lower, upper] as {names}")
        elif unit not in units:
            kind = "slides" if prismatic[number] else "turns"
            fix = " or ".join(f"limits_{unit}" for unit in units)
            reader.fault(path, f"the joint {kind}", f"limits in {' or '.join(units)}", fix)
        elif len(given) > 1:
            reader.fault(path, "given twice", f"one of {', '.join(given)}")
        else:
            limits[number] = reader.pair(value, unit, path, units[unit])
            if unit == "deg":
                in_degrees += list(np.rad2deg(limits[number]))
    if in_degrees and np.nanmax(np.abs(in_degrees)) < 6.3:
        fix = "if they were meant in rad, write limits_rad"
        reader.fault((shared or "dh",), "no joint turns more than 6.3 deg", "degrees", fix)
    return limits


def _joint_map(reader: Reader, content: Mapping, rows: list) -> np.ndarray:
    """Matrix (k, k) from reported to DH joints: the rows' signs, or given as a whole."""
    signs = [row.get("sign", 1) if isinstance(row, Mapping) else 1 for row in rows]
    if "joint_map" not in content:
        return np.diag([float(sign) if sign in (1, -1) else 1.0 for sign in signs])
    if any(isinstance(row, Mapping) and "sign" in row for row in rows):
        allowed = "signs in the rows, or joint_map with the signs in it"
        reader.fault(("joint_map",), "given beside a joint's sign", allowed)
    return _square(reader, content["joint_map"], len(rows))


def _square(reader: Reader, matrix: object, count: int) -> np.ndarray:
    allowed = f"an invertible {count} x {count} matrix: DH joints = joint_map times reported joints"
    square = isinstance(matrix, list) and len(matrix) == count
    if not square or any(not isinstance(row, list) or len(row) != count for row in matrix):
        reader.fault(("joint_map",), "has the wrong shape", allowed)
        return np.eye(count)
    before = len(reader.problems)
    values = np.array(
        [[reader.number(each, ("joint_map", i)) for each in row] for i, row in enumerate(matrix)]
    )
    if len(reader.problems) == before and abs(np.linalg.det(values)) < 1e-9:
        reader.fault(("joint_map",), "is singular", allowed)
    return values


# --- frames, text and URDF ------------------------------------------------------------------------


def _frame(reader: Reader, content: Mapping, name: str) -> Pose:
    """A frame given by a position and one form of orientation; identity where it is not given."""
    frame = content.get(name)
    if frame is None:
        return IDENTITY
    if not isinstance(frame, Mapping):
        reader.fault((name,), "is not a frame", ", ".join(_FRAME_KEYS), value=frame)
        return IDENTITY
    reader.known_keys(frame, _FRAME_KEYS, (name,))
    position = np.zeros(3)
    key = reader.unit_key(frame, "position", LENGTH, (name,))
    if key:
        position = np.array(reader.numbers(frame[key], 3, (name, key)))
        position *= LENGTH[key.rpartition("_")[2]]
    turns = [key for key in _FRAME_KEYS[2:] if key in frame]
    if len(turns) > 1:
        reader.fault((name, turns[1]), "a second orientation", f"one of {', '.join(turns)}")
    return Pose(_rotation(reader, frame, name, turns[0]) if turns else np.eye(3), position)


def _rotation(reader: Reader, frame: Mapping, name: str, key: str) -> np.ndarray:
    path = (name, key)
    if key == "quaternion_wxyz":
        values = np.array(reader.numbers(frame[key], 4, path))
        length = np.linalg.norm(values)
        if abs(length - 1.0) > 1e-3:
            reader.fault(path, f"has length {length:.6g}", "a unit quaternion w, x, y, z")
        return rotation_from_quaternion(values / length)
    values = np.array(reader.numbers(frame[key], 3, path)) * ANGLE[key.rpartition("_")[2]]
    if key.startswith("rpy"):  # as in URDF: about fixed x, then y, then z
        return rotation_z(values[2]) @ rotation_y(values[1]) @ rotation_x(values[0])
    return exp_so3(values)


def _about(reader: Reader, name: str) -> dict[str, str]:
    content: dict[str, Any] = {key: reader.document.data.get(key) for key in _ABOUT_KEYS}
    if isinstance(content["date"], date):
        content["date"] = content["date"].isoformat()
    content["name"] = content["name"] or name
    for fault in not_in_a_line("name", str(content["name"])):
        reader.fault(("name",), fault.what, fault.allowed)
    return {key: "" if value is None else str(value) for key, value in content.items()}


def _from_urdf(reader: Reader, path: Path) -> Robot | None:
    """A YAML that names a URDF file, the links its chain runs between, and what a URDF lacks."""
    from kinacc.kinematics.robot import urdf

    content = reader.document.data
    reader.known_keys(content, _URDF_KEYS)
    if "dh" in content:
        reader.fault(("dh",), "given beside urdf", "one description of the joints")
    texts = {key: content.get(key) for key in ("urdf", "base_link", "tip_link")}
    for key, value in texts.items():
        may_be_absent = key != "urdf" and value is None
        if not may_be_absent and (not isinstance(value, str) or not value):
            reader.fault((key,), "is not text", "a name", value=value)
    tool = _frame(reader, content, "tool")
    if reader.problems:
        return None
    file = path.parent / texts["urdf"]
    if not os.path.isfile(file):
        reader.fault(("urdf",), "there is no such file", "a path from this file", value=str(file))
        return None
    robot = urdf.load(file, texts["base_link"], texts["tip_link"])
    about = _about(reader, robot.name)
    if not about["source"]:
        about["source"] = robot.source
    joint_map = robot.joint_map
    if "joint_map" in content:
        joint_map = _square(reader, content["joint_map"], len(robot.joint_map))
    return replace(robot, **about, joint_map=joint_map, tool=tool)
