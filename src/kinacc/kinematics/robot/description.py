"""Robots by name or file: a table of DH rows in YAML, or URDF. Robot files written."""

from __future__ import annotations

import difflib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)
from scipy.spatial.transform import Rotation

from kinacc.config.names import not_in_a_line
from kinacc.config.reading import Document, parsed, read
from kinacc.errors import InputError, Problem, refuse
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

_SHIPPED = Path(__file__).parents[1] / "robots"
_LARGEST = 1e9  # of any number: beyond, nothing about an arm is meant, and products overflow
_SHORTEST_MM = 20.0  # of all lengths together
_MOST_TURNS_RAD = 4.0 * pi
_SUGGESTIONS = 20
_UNITS = {"deg": pi / 180.0, "rad": 1.0, "mm": 1.0, "m": 1e3}

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-_LARGEST, le=_LARGEST)]
Limits = tuple[Number, Number]
Vector = tuple[Number, Number, Number]
Text = Annotated[str, BeforeValidator(lambda value: "" if value is None else str(value))]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")

    def given(self, stem: str) -> tuple[str, Any] | None:
        """Unit and value of a quantity whose key names its unit; ValueError where two are given."""
        keys = [f"{stem}_{unit}" for unit in _UNITS]
        found = [key for key in keys if getattr(self, key, None) is not None]
        if len(found) > 1:
            raise ValueError(f"{stem} is given twice: {' and '.join(found)}")
        return (found[0].rpartition("_")[2], getattr(self, found[0])) if found else None

    def quantity(self, stem: str, default: Any = None) -> Any:
        """A length in mm or an angle in rad; ValueError where it is missing."""
        found = self.given(stem) or (None if default is None else ("rad", default))
        if found is None:
            units = [unit for unit in _UNITS if f"{stem}_{unit}" in type(self).model_fields]
            raise ValueError(
                f"{stem} is missing: {' or '.join(f'{stem}_{unit}' for unit in units)}"
            )
        return np.multiply(found[1], _UNITS[found[0]])


class Frame(_Strict):
    """A frame by a position and one form of orientation."""

    position_mm: Vector | None = None
    position_m: Vector | None = None
    quaternion_wxyz: tuple[Number, Number, Number, Number] | None = None
    rotation_vector_deg: Vector | None = None
    rotation_vector_rad: Vector | None = None
    rpy_deg: Vector | None = None
    rpy_rad: Vector | None = None

    @model_validator(mode="after")
    def _one_orientation(self) -> Self:
        self.pose()
        return self

    def pose(self) -> Pose:
        """The frame; identity where nothing is given."""
        turns = [stem for stem in ("rotation_vector", "rpy") if self.given(stem)]
        if len(turns) + (self.quaternion_wxyz is not None) > 1:
            raise ValueError("a second orientation: give one")
        rotation = np.eye(3)
        if self.quaternion_wxyz is not None:
            if abs(np.linalg.norm(self.quaternion_wxyz) - 1.0) > 1e-3:
                raise ValueError("quaternion_wxyz is no unit quaternion w, x, y, z")
            rotation = Rotation.from_quat(np.roll(self.quaternion_wxyz, -1)).as_matrix()
        elif turns == ["rpy"]:  # as in URDF: about fixed x, then y, then z
            rotation = Rotation.from_euler("xyz", self.quantity("rpy")).as_matrix()
        elif turns:
            rotation = Rotation.from_rotvec(self.quantity("rotation_vector")).as_matrix()
        return Pose(rotation, np.array(self.quantity("position", (0.0, 0.0, 0.0)), dtype=float))


class Row(_Strict):
    """A row of a DH table and what belongs to its joint."""

    joint: Literal["revolute", "prismatic"] = "revolute"
    name: Text = ""
    theta_offset_deg: Number | None = None
    theta_offset_rad: Number | None = None
    d_mm: Number | None = None
    d_m: Number | None = None
    a_mm: Number | None = None
    a_m: Number | None = None
    alpha_deg: Number | None = None
    alpha_rad: Number | None = None
    beta_deg: Number | None = None
    beta_rad: Number | None = None
    sign: Literal[1, -1] = 1
    limits_deg: Limits | None = None
    limits_rad: Limits | None = None
    limits_mm: Limits | None = None
    limits_m: Limits | None = None

    @field_validator("theta_offset_rad", "alpha_rad", "beta_rad")
    @classmethod
    def _not_in_deg(cls, value: float | None) -> float | None:
        if value and abs(value) > 2.0 * pi + 1e-3:
            raise ValueError("more than a turn: write _deg")
        return value

    @model_validator(mode="after")
    def _whole(self) -> Self:
        self.parameters()
        found, units = self.given("limits"), ("mm", "m") if self.slides else ("deg", "rad")
        if found and found[0] not in units:
            kind = "slides" if self.slides else "turns"
            raise ValueError(f"the joint {kind}: give its limits in {' or '.join(units)}")
        if found:
            _limits_of(*found)
        return self

    @property
    def slides(self) -> bool:
        """Whether the joint is prismatic."""
        return self.joint == "prismatic"

    def parameters(self) -> tuple[float, ...]:
        """theta, d, a, alpha, beta in rad and mm."""
        needed = [float(self.quantity(stem)) for stem in ("theta_offset", "d", "a", "alpha")]
        return (*needed, float(self.quantity("beta", 0.0)))


def _limits_of(unit: str, limits: Limits) -> np.ndarray:
    """Limits (2,) in rad or mm; ValueError where they are reversed or look like degrees."""
    if limits[0] >= limits[1]:
        raise ValueError(f"limits {list(limits)} are reversed or empty")
    if unit == "rad" and max(map(abs, limits)) > _MOST_TURNS_RAD:
        raise ValueError(f"limits {list(limits)} look like degrees: write limits_deg")
    return np.multiply(limits, _UNITS[unit])


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
            raise ValueError(fault.what)
        return value

    def matrix(self, count: int) -> np.ndarray:
        """Matrix (k, k) from reported to DH joints; ValueError where it is none."""
        rows = self.joint_map or []
        if len(rows) != count or any(len(row) != count for row in rows):
            raise ValueError(f"joint_map is no {count} x {count} matrix")
        if abs(np.linalg.det(rows)) < 1e-9:
            raise ValueError("joint_map is singular")
        return np.array(rows)


class Table(_About):
    """A robot file with a table of DH rows."""

    convention: Literal["standard", "modified"] = "standard"
    dh: list[Row]
    limits_deg: list[Limits] | None = None
    limits_rad: list[Limits] | None = None
    base: Frame = Frame()
    flange: Frame = Frame()

    @field_validator("dh", mode="before")
    @classmethod
    def _as_many_joints(cls, rows: Any) -> Any:
        if isinstance(rows, list) and not FEWEST_JOINTS <= len(rows) <= MOST_JOINTS:
            raise ValueError(f"has {len(rows)} joints, not {FEWEST_JOINTS} to {MOST_JOINTS}")
        return rows

    @model_validator(mode="after")
    def _whole(self) -> Self:
        self.robot()
        return self

    def robot(self) -> Robot:
        """The arm; ValueError where parts of the file contradict each other."""
        columns = np.array([row.parameters() for row in self.dh]).T
        total = np.abs(columns[1:3]).sum()
        if 0.0 < total < _SHORTEST_MM:
            raise ValueError(f"all lengths together are {total:g} mm: write d_m and a_m")
        slides = np.array([row.slides for row in self.dh])
        table, base = DHModel(*columns, slides), self.base.pose()
        if self.convention == "modified":
            table, before = from_modified(table)
            base = compose(base, before)
        signs = [row.sign for row in self.dh]
        joint_map = np.diag(np.array(signs, dtype=float))
        if self.joint_map is not None:
            if any("sign" in row.model_fields_set for row in self.dh):
                raise ValueError("joint_map is given beside a joint's sign")
            joint_map = self.matrix(len(self.dh))
        limits = self._limits()
        return Robot(
            name=self.name or "robot",
            source=self.source,
            date=self.date,
            dh=table,
            q_min_rad=limits[:, 0],
            q_max_rad=limits[:, 1],
            joint_map=joint_map,
            base=base,
            flange=self.flange.pose(),
            tool=self.tool.pose(),
            joint_names=tuple(row.name or f"joint {i}" for i, row in enumerate(self.dh, 1)),
        )

    def _limits(self) -> np.ndarray:
        """Limits (k, 2) of the reported joints, from the rows or from one list for all."""
        shared = self.given("limits")
        if shared and len(shared[1]) != len(self.dh):
            raise ValueError(f"limits_{shared[0]} has {len(shared[1])} pairs, not {len(self.dh)}")
        limits, in_degrees = [], []
        for number, row in enumerate(self.dh):
            found = row.given("limits")
            if shared and not row.slides:
                if found:
                    raise ValueError(f"joint {number + 1}: its limits are given twice")
                found = shared[0], shared[1][number]
            if found is None:
                units = ("mm", "m") if row.slides else ("deg", "rad")
                names = " or ".join(f"limits_{unit}" for unit in units)
                raise ValueError(f"joint {number + 1}: its limits are missing: {names}")
            limits.append(_limits_of(*found))
            in_degrees += found[1] if found[0] == "deg" else ()
        if in_degrees and max(map(abs, in_degrees)) < 6.3:
            raise ValueError("no joint turns more than 6.3 deg: write limits_rad")
        return np.array(limits)


class ByUrdf(_About):
    """A robot file that names a URDF file, the links its chain runs between, and what it lacks."""

    urdf: str = Field(min_length=1)
    base_link: str | None = None
    tip_link: str | None = None


def shipped() -> list[str]:
    """Names of the robots that come with kinacc."""
    return sorted(path.stem for path in _SHIPPED.glob("*.yaml"))


def load(name_or_path: str | Path) -> Robot:
    """Robot of a shipped name, of a YAML file or of a URDF file.

    Raises InputError listing what is wrong with the description.
    """
    path = _path(name_or_path)
    if path.suffix.lower() in (".urdf", ".xacro", ".xml"):
        return _urdf.load(path)
    document, problems = read(path)
    if path.parent == _SHIPPED:
        document = replace(document, name=path.name)
    return _described(document, problems, path)


def of_text(text: str, name: str) -> Robot:
    """Robot of the text of a robot YAML, as ``as_yaml`` writes it; ``name`` is for messages.

    Raises InputError as ``load`` does.
    """
    return _described(*parsed(text, name), Path(name))


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
        close = difflib.get_close_matches(name[:100].lower(), shipped(), n=1)
        allowed = "a name listed in docs/robots.md, or the path of a robot YAML or URDF"
        fix = f"did you mean {close[0]}?" if close else ""
        raise InputError(Problem(name, "is neither a shipped robot nor a file", allowed, fix))
    return path


def _described(document: Document, problems: list[Problem], path: Path) -> Robot:
    title = f"The robot description {document.name} cannot be used"
    refuse(problems, title)
    kind: type[_About] = ByUrdf if "urdf" in document.data else Table
    try:
        described = kind.model_validate(document.data)
        if isinstance(described, Table):
            return described.robot()
        return _by_urdf(described, document, path)
    except ValidationError as error:
        raise InputError(_problems(error, document, kind), title) from None
    except ValueError as error:
        raise InputError(Problem(document.name, str(error)), title) from None


def _by_urdf(described: ByUrdf, document: Document, path: Path) -> Robot:
    file = path.parent / described.urdf
    if not os.path.isfile(file):
        raise InputError(Problem(document.place(("urdf",)), f"{file}: there is no such file"))
    robot = _urdf.load(file, described.base_link, described.tip_link)
    matrix = robot.joint_map
    if described.joint_map is not None:
        matrix = described.matrix(len(matrix))
    return replace(
        robot,
        name=described.name or robot.name,
        source=described.source or robot.source,
        date=described.date,
        joint_map=matrix,
        tool=described.tool.pose(),
    )


def _problems(error: ValidationError, document: Document, kind: type) -> list[Problem]:
    """What pydantic found, as it stands in the file."""
    found = []
    for number, each in enumerate(error.errors(include_url=False)):
        place, value = each["loc"], each["input"]
        while place and not document.gives(place):
            place = place[:-1]
        what = each["msg"].removeprefix("Value error, ")
        if each["type"] == "extra_forbidden":
            what = "unknown key"
            if number < _SUGGESTIONS:
                what += _nearest(str(place[-1]), _keys(kind, place))
        elif not isinstance(value, Mapping | list):
            what = f"{str(value)[:60]}: {what}"
        if len(each["loc"]) > len(place) and each["type"] == "missing":
            what = f"{each['loc'][-1]} is missing"
        found.append((document.lines.get(place, 0), Problem(document.place(place), what)))
    return [problem for _, problem in sorted(found, key=lambda pair: pair[0])]


def _keys(kind: type, place: tuple) -> list[str]:
    inner = {"dh": Row, "base": Frame, "flange": Frame, "tool": Frame}
    return list(inner.get(place[0] if len(place) > 1 else "", kind).model_fields)


def _nearest(name: str, known: list[str]) -> str:
    """What to write instead of an unknown key; empty where nothing is like it."""
    stem = name.rpartition("_")[0] if name.rpartition("_")[2] in _UNITS else name
    same = [f"{stem}_{unit}" for unit in _UNITS if f"{stem}_{unit}" in known]
    close = same or difflib.get_close_matches(name[:100].lower(), known, n=1, cutoff=0.55)
    return f"; did you mean {' or '.join(close)}?" if close else ""


def from_modified(table: DHModel) -> tuple[DHModel, Pose]:
    """Standard chain and base of a modified (Craig) table, exactly.

    Row i of ``table`` reads ``Tx(a) Rx(alpha) Ry(beta) Rz(q + theta) Tz(d)``: a, alpha and beta lie
    before the joint. Regrouping the same product hands them to the row above; those of the first
    row become the base (first DH frame in the arm's base frame), those of the last row vanish.
    """
    handed_up = {name: np.append(getattr(table, name)[1:], 0.0) for name in PARAMETERS[2:]}
    first = rotation_x(table.alpha_rad[0]) @ rotation_y(table.beta_rad[0])
    return replace(table, **handed_up), Pose(first, np.array([table.a_mm[0], 0.0, 0.0]))


def as_yaml(robot: Robot, heading: Iterable[str] = ()) -> str:
    """Robot file of ``robot`` in standard DH, lengths in mm and angles in rad.

    ``heading`` are lines of comment at the top. ``of_text`` reads joints and limits back bit by
    bit, and turns of the frames to rounding.
    """
    about = {"name": robot.name, "source": robot.source, "date": robot.date}
    lines = [f"# {line}" for line in heading]
    lines += [f"{key}: {json.dumps(value)}" for key, value in about.items() if value]
    signs = np.diag(robot.joint_map)
    simple = np.array_equal(robot.joint_map, np.diag(signs)) and (np.abs(signs) == 1.0).all()
    lines.append("dh:")
    for joint, slides in enumerate(robot.dh.prismatic):
        row = [f"{name}: {float(getattr(robot.dh, name)[joint])!r}" for name in PARAMETERS]
        if robot.joint_names and robot.joint_names[joint] != f"joint {joint + 1}":
            row.insert(0, f"name: {json.dumps(robot.joint_names[joint])}")
        if slides:
            row.append("joint: prismatic")
        ends = [float(robot.q_min_rad[joint]), float(robot.q_max_rad[joint])]
        row.append(f"limits_{'mm' if slides else 'rad'}: {ends}")
        if simple and signs[joint] < 0.0:
            row.append("sign: -1")
        lines.append(f"  - {{{', '.join(row)}}}")
    if not simple:
        lines.append("joint_map: # DH joints = joint_map times reported joints")
        lines += [f"  - {row}" for row in robot.joint_map.tolist()]
    for name in ("base", "flange", "tool"):
        pose = getattr(robot, name)
        if not all(np.array_equal(own, none) for own, none in zip(pose, IDENTITY, strict=True)):
            turn = quaternion_from_rotation(pose.rotation).tolist()
            position = f"  position_mm: {pose.position_mm.tolist()}"
            lines += [f"{name}:", position, f"  quaternion_wxyz: {turn}"]
    return "\n".join(lines) + "\n"
