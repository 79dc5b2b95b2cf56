"""Robots by name or file: a table of DH rows in YAML, or URDF. Robot files written."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)
from scipy.spatial.transform import Rotation

from kinacc.config.fields import refused
from kinacc.config.names import not_in_a_line
from kinacc.config.problems import by_line, problems_of
from kinacc.config.reading import Document, KeyPath, mapping, read
from kinacc.config.settings import ROBOTS, SHIPPED
from kinacc.config.values import did_you_mean
from kinacc.errors import InputError, Problem, input_error, refuse
from kinacc.geometry import (
    IDENTITY,
    Pose,
    compose,
    quaternion_from_rotation,
    rotation_x,
    rotation_y,
)
from kinacc.kinematics.dh import PARAMETERS, DHModel
from kinacc.kinematics.robot import urdf as _urdf
from kinacc.kinematics.robot.record import FEWEST_JOINTS, MOST_JOINTS, Robot

_LARGEST = 1e9  # of any number: beyond, nothing about an arm is meant, and products overflow
_SHORTEST_MM = 20.0  # of all lengths together
_LEAST_TURN_RAD = 0.11  # some joint of every arm turns further
# Keys in another unit, with their fields and the factors.
_ANGLES = ("theta_offset", "alpha", "beta", "limits", "rotation_vector", "rpy")
_OTHER_UNITS = {f"{name}_deg": (f"{name}_rad", pi / 180.0) for name in _ANGLES}
_OTHER_UNITS |= {f"{name}_m": (f"{name}_mm", 1e3) for name in ("d", "a", "limits", "position")}

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-_LARGEST, le=_LARGEST)]
Turn = Annotated[Number, Field(ge=-2.0 * pi - 1e-3, le=2.0 * pi + 1e-3)]
Vector = tuple[Number, Number, Number]
Text = Annotated[str, BeforeValidator(lambda value: "" if value is None else str(value))]


def _times(value: Any, factor: float) -> Any:
    """Numbers, also those in lists, times a factor; anything else stays for pydantic."""
    if isinstance(value, list):
        return [_times(item, factor) for item in value]
    is_number = type(value) in (int, float) and abs(value) <= _LARGEST
    return value * factor if is_number else value


def _rising(limits: tuple[float, float]) -> tuple[float, float]:
    if not limits[0] < limits[1]:
        raise refused(f"limits {list(limits)} are reversed or empty")
    return limits


Limits = Annotated[tuple[Number, Number], AfterValidator(_rising)]
TurnLimits = Annotated[
    tuple[Annotated[Number, Field(ge=-4.0 * pi)], Annotated[Number, Field(le=4.0 * pi)]],
    AfterValidator(_rising),
]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")

    @model_validator(mode="before")
    @classmethod
    def _in_rad_and_mm(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        converted: dict[Any, Any] = {}
        for key, value in data.items():
            name = key
            if key in _OTHER_UNITS:
                name, factor = _OTHER_UNITS[key]
                value = _times(value, factor)
            if name in converted:
                raise refused(f"{name.rpartition('_')[0]} is given twice, in two units")
            converted[name] = value
        return converted


class Frame(_Strict):
    """A frame by a position and one form of orientation."""

    position_mm: Vector = (0.0, 0.0, 0.0)
    quaternion_wxyz: tuple[Number, Number, Number, Number] | None = None
    rotation_vector_rad: Vector | None = None
    rpy_rad: Vector | None = None

    @model_validator(mode="after")
    def _one_orientation(self) -> Self:
        if len(self.model_fields_set - {"position_mm"}) > 1:
            raise refused("has a second orientation", "give one")
        if self.quaternion_wxyz and abs(np.linalg.norm(self.quaternion_wxyz) - 1.0) > 1e-3:
            raise refused("quaternion_wxyz is no unit quaternion w, x, y, z")
        return self

    def pose(self) -> Pose:
        """The frame; identity where nothing is given."""
        turn = Rotation.from_rotvec(self.rotation_vector_rad or (0.0, 0.0, 0.0))
        if self.quaternion_wxyz is not None:
            turn = Rotation.from_quat(np.roll(self.quaternion_wxyz, -1))
        elif self.rpy_rad is not None:  # as in URDF: about fixed x, then y, then z
            turn = Rotation.from_euler("xyz", self.rpy_rad)
        return Pose(turn.as_matrix(), np.array(self.position_mm))


class Row(_Strict):
    """A row of a DH table and what belongs to its joint."""

    joint: Literal["revolute", "prismatic"] = "revolute"
    name: Text = ""
    theta_offset_rad: Turn
    d_mm: Number
    a_mm: Number
    alpha_rad: Turn
    beta_rad: Turn = 0.0
    sign: Literal[1, -1] = 1
    limits_rad: TurnLimits | None = None
    limits_mm: Limits | None = None


class _About(_Strict):
    name: Text = ""
    source: Text = ""
    date: Text = ""
    joint_map: list[list[Number]] | None = None
    tool: Frame = Frame()

    @field_validator("name")
    @classmethod
    def _in_a_line(cls, value: str) -> str:
        for fault in not_in_a_line("name", value) if value else ():
            raise refused(fault.what)
        return value

    def matrix(self, default: np.ndarray) -> np.ndarray:
        """Matrix (k, k) from reported to DH joints; ValueError where it is none."""
        if self.joint_map is None:
            return default
        if [len(row) for row in self.joint_map] != [len(default)] * len(default):
            raise ValueError(f"joint_map is no {len(default)} x {len(default)} matrix")
        if abs(np.linalg.det(self.joint_map)) < 1e-9:
            raise ValueError("joint_map is singular")
        return np.array(self.joint_map)


class Table(_About):
    """A robot file with a table of DH rows."""

    convention: Literal["standard", "modified"] = "standard"
    dh: list[Row] = Field(min_length=FEWEST_JOINTS, max_length=MOST_JOINTS)
    limits_rad: list[TurnLimits] | None = None
    base: Frame = Frame()
    flange: Frame = Frame()

    def robot(self) -> Robot:
        """The arm; ValueError where parts of the file contradict each other."""
        columns = {n: np.array([getattr(row, n) for row in self.dh]) for n in PARAMETERS}
        total = np.abs([columns["d_mm"], columns["a_mm"]]).sum()
        if 0.0 < total < _SHORTEST_MM:
            raise ValueError(f"all lengths together are {total:g} mm: write d_m and a_m")
        slides = np.array([row.joint == "prismatic" for row in self.dh])
        table, base = DHModel(**columns, prismatic=slides), self.base.pose()
        if self.convention == "modified":
            table, before = from_modified(table)
            base = compose(base, before)
        if self.joint_map is not None and any("sign" in row.model_fields_set for row in self.dh):
            raise ValueError("joint_map is given beside a joint's sign")
        limits = self._limits()
        if np.abs(limits[~slides]).max(initial=0.0) < _LEAST_TURN_RAD and not slides.all():
            raise ValueError("no joint turns more than 6.3 deg: write limits_rad")
        return Robot(
            name=self.name or "robot",
            source=self.source,
            date=self.date,
            dh=table,
            q_min_rad=limits[:, 0],
            q_max_rad=limits[:, 1],
            joint_map=self.matrix(np.diag([float(row.sign) for row in self.dh])),
            base=base,
            flange=self.flange.pose(),
            tool=self.tool.pose(),
            joint_names=tuple(row.name or f"joint {i}" for i, row in enumerate(self.dh, 1)),
        )

    def _limits(self) -> np.ndarray:
        """Limits (k, 2) of the reported joints, from the rows or from one list for all."""
        shared: Sequence[tuple[float, float] | None] = self.limits_rad or [None] * len(self.dh)
        if len(shared) != len(self.dh):
            raise ValueError(f"limits: {len(shared)} pairs for {len(self.dh)} joints")
        limits = []
        for number, (row, listed) in enumerate(zip(self.dh, shared, strict=True), 1):
            slides = row.joint == "prismatic"
            stated = [row.limits_mm] if slides else [row.limits_rad, listed]
            ends = [pair for pair in stated if pair is not None]
            if len(ends) != 1:
                units = "limits_mm or limits_m" if slides else "limits_deg or limits_rad"
                raise ValueError(f"joint {number}: its limits are to be given once: {units}")
            limits += ends
        return np.array(limits)


class ByUrdf(_About):
    """A robot file that names a URDF file, the links its chain runs between, and what it lacks."""

    urdf: str = Field(min_length=1)
    base_link: str | None = None
    tip_link: str | None = None


def shipped() -> list[str]:
    """Names of the robots that come with kinacc."""
    return [*SHIPPED]


def load(name_or_path: str | Path) -> Robot:
    """Robot of a shipped name, of a YAML file or of a URDF file.

    Parameters
    ----------
    name_or_path : str or pathlib.Path
        One of ``shipped()``, or the path of a file (docs/robots.md has its keys).

    Returns
    -------
    Robot
        The arm, in mm and rad.

    Raises
    ------
    InputError
        With the faults of the description, each with line and key.
    """
    path = _path(name_or_path)
    if path.suffix.lower() in (".urdf", ".xacro", ".xml"):
        return _urdf.load(path)
    return _described(read(path), path)


def of_text(text: str, name: str) -> Robot:
    """Robot of the text of a robot YAML, as ``as_yaml`` writes it.

    Parameters
    ----------
    text : str
        The YAML.
    name : str
        Name of the file, for messages.

    Returns
    -------
    Robot
        The arm, in mm and rad.

    Raises
    ------
    InputError
        As ``load``.
    """
    return _described(mapping(text, name), Path(name))


def files(name_or_path: str | Path) -> list[Path]:
    """Files outside the package that a description is read from.

    Parameters
    ----------
    name_or_path : str or pathlib.Path
        As for ``load``.

    Returns
    -------
    list of pathlib.Path
        The YAML and the URDF it names; empty for a shipped robot.

    Raises
    ------
    InputError
        For a name that is neither a shipped robot nor a file.
    """
    path = _path(name_or_path)
    if path.parent == ROBOTS:
        return []
    if path.suffix.lower() not in (".yaml", ".yml"):
        return [path]
    inner = read(path).data.get("urdf")
    named = [path.parent / inner] if isinstance(inner, str) else []
    return [path, *(file for file in named if os.path.isfile(file))]


def _path(name_or_path: str | Path) -> Path:
    name = str(name_or_path)
    if name in shipped():
        return ROBOTS / f"{name}.yaml"
    if os.path.isfile(name):  # false, too, for a name no file can have
        return Path(name)
    allowed = "a name listed in docs/robots.md, or the path of a robot YAML or URDF"
    fix = did_you_mean(name.lower(), shipped())
    raise input_error(name, "is neither a shipped robot nor a file", allowed, fix)


def _described(document: Document, path: Path) -> Robot:
    refuse(document.problems)
    try:
        if "urdf" not in document.data:
            return Table.model_validate(document.data).robot()
        described = ByUrdf.model_validate(document.data)
        file = path.parent / described.urdf
        robot = _urdf.load(file, described.base_link, described.tip_link)
        return replace(
            robot,
            name=described.name or robot.name,
            source=described.source or robot.source,
            date=described.date,
            joint_map=described.matrix(robot.joint_map),
            tool=described.tool.pose(),
        )
    except ValidationError as error:
        raise InputError(_problems(error, document)) from None
    except ValueError as error:
        raise input_error(document.name, str(error)) from None


def _problems(error: ValidationError, document: Document) -> list[Problem]:
    """The faults pydantic lists, as they stand in the file, line by line."""
    known = {name for model in (Row, Frame, Table, ByUrdf) for name in model.model_fields}

    def place(path: KeyPath) -> str:
        written: KeyPath = ()
        for part in path:
            names = [part, *(key for key, (name, _) in _OTHER_UNITS.items() if name == part)]
            inner = ((*written, name) for name in names)
            written = next((item for item in inner if item in document.lines), written)
        return document.place(written)

    def meant(path: KeyPath) -> str:
        return did_you_mean(path[-1], {*known, *_OTHER_UNITS})

    return sorted(problems_of(error, place, meant), key=by_line)


def from_modified(table: DHModel) -> tuple[DHModel, Pose]:
    """Standard chain and base of a modified (Craig) table, exactly.

    Row i reads ``Tx(a) Rx(alpha) Ry(beta) Rz(q + theta) Tz(d)``: a, alpha and beta lie before the
    joint. Regrouping the same product moves them to the row above.

    Parameters
    ----------
    table : DHModel
        Arm of k joints whose rows are of the modified convention.

    Returns
    -------
    table : DHModel
        The same arm by the standard convention; a, alpha and beta of the last row are 0.
    base : Pose
        First DH frame in the arm's base frame, mm.
    """
    handed_up = {name: np.append(getattr(table, name)[1:], 0.0) for name in PARAMETERS[2:]}
    first = rotation_x(table.alpha_rad[0]) @ rotation_y(table.beta_rad[0])
    return replace(table, **handed_up), Pose(first, np.array([table.a_mm[0], 0.0, 0.0]))


def as_yaml(robot: Robot, heading: Iterable[str] = ()) -> str:
    """Robot file of an arm in standard DH, lengths in mm and angles in rad.

    Parameters
    ----------
    robot : Robot
        The arm.
    heading : iterable of str
        Lines of comment at the top.

    Returns
    -------
    str
        Text of which ``of_text`` reads joints and limits back bit by bit, and turns of the frames
        to rounding.
    """
    about = {"name": robot.name, "source": robot.source, "date": robot.date}
    lines = [f"# {line}" for line in heading]
    lines += [f"{key}: {json.dumps(value)}" for key, value in about.items() if value]
    signs = np.diag(robot.joint_map)
    simple = np.array_equal(robot.joint_map, np.diag(signs)) and (np.abs(signs) == 1.0).all()
    lines.append("dh:")
    for joint, slides in enumerate(robot.dh.prismatic):
        name = robot.joint_names[joint] if robot.joint_names else f"joint {joint + 1}"
        row: dict[str, Any] = {} if name == f"joint {joint + 1}" else {"name": json.dumps(name)}
        row |= {key: float(getattr(robot.dh, key)[joint]) for key in PARAMETERS}
        ends = [float(robot.q_min_rad[joint]), float(robot.q_max_rad[joint])]
        row |= {"joint": "prismatic", "limits_mm": ends} if slides else {"limits_rad": ends}
        if simple and signs[joint] < 0.0:
            row["sign"] = -1
        lines.append(f"  - {{{', '.join(f'{key}: {value}' for key, value in row.items())}}}")
    if not simple:
        lines.append("joint_map: # DH joints = joint_map times reported joints")
        lines += [f"  - {values}" for values in robot.joint_map.tolist()]
    for name, pose in (("base", robot.base), ("flange", robot.flange), ("tool", robot.tool)):
        if not all(map(np.array_equal, pose, IDENTITY)):
            turn = quaternion_from_rotation(pose.rotation).tolist()
            position = f"  position_mm: {pose.position_mm.tolist()}"
            lines += [f"{name}:", position, f"  quaternion_wxyz: {turn}"]
    return "\n".join(lines) + "\n"
