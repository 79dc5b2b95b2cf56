"""Joint and pose files a command is given: units by column name, all faults listed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

from kinacc.cli.exit_codes import AGAINST
from kinacc.config import json_files
from kinacc.config.names import of_csv
from kinacc.errors import InputError, Problem, first_few, refuse
from kinacc.geometry import Pose, exp_so3, rotation_from_quaternion
from kinacc.kinematics.robot import Robot, outside_limits
from kinacc.measurements.files import EXCEL, PARQUET, load, refuse_other_files
from kinacc.measurements.layout import (
    ANGLE,
    LENGTH,
    MASS,
    PAYLOAD,
    PURE,
    ROUNDED_MM,
    ROUNDED_RAD,
    Layout,
    Place,
    columns_of_quantity,
    listed,
    names_of,
)
from kinacc.measurements.table import RawTable, frame, numbers, numbers_of

if TYPE_CHECKING:
    from kinacc.deployment.record import Calibration

_DIGITS = 15  # a whole number of more is no count
_UNIT_QUATERNION = 1e-3
_OWN_NAMES = {  # what a file under our names has where the need is for it
    "joints": re.compile(r"(?<![^\s,;\"'])q1_(?:deg|rad|mm|m)(?![^\s,;\"'])"),
    "points": re.compile(r"(?<![^\s,;\"'])(?:x|ex)_(?:mm|m)(?![^\s,;\"'])"),
    "poses": re.compile(r"(?<![^\s,;\"'])(?:qw|rv?x_(?:deg|rad))(?![^\s,;\"'])"),
}
_HEAD = 1_000_000  # characters of a line looked at
_MUCH_MOVED_MM = 0.1  # by a mm or mrad of what is undetermined


@dataclass(frozen=True)
class Rows:
    """What a file holds: ``joints`` (n, k) reported joints (rad, mm), ``directions`` (n, k) of
    travel, wanted ``pose`` (n, ...) in mm, ``payload`` (n, 4) in kg and mm; each None where the
    file has no such columns.

    ``label`` (n,) is the file's ``pose`` column, or the line a row stands on.
    """

    count: int
    label: np.ndarray
    joints: np.ndarray | None
    directions: np.ndarray | None
    pose: Pose | None
    unused: tuple[str, ...]
    payload: np.ndarray | None = None


def read(
    path: str | Path,
    robot: Robot,
    joints: bool = True,
    pose: bool = False,
    answers: Mapping | None = None,
) -> Rows:
    """Rows of a file, as ``open_table`` reads it; it must have ``joints`` or ``pose`` if asked for.

    Poses are not looked for where they are not asked for.

    Joints: ``q1_deg``, ``q1_rad`` (``q1_mm``, ``q1_m`` where a joint slides). Poses: ``x_mm`` or
    ``x_m`` .., and ``qw`` .. ``qz``, or a rotation vector ``rvx_deg`` .. , or intrinsic XYZ angles
    ``rx_deg`` .. (or rad). A quantity may stand in both units where they say the same. Raises
    InputError listing every problem.
    """
    slides = robot.dh.prismatic
    names = [f"q{i + 1}" for i in range(len(slides))]
    table = open_table(path, "poses" if pose else "joints", answers)
    table = _answered(table, names, "joints") if joints else table
    table = _answered(table, ["x", "y", "z"], "a pose") if pose else table
    reader = Quantities(table)
    q_rad = reader.group(names, [LENGTH if each else ANGLE for each in slides], joints)
    if any(f"q{len(slides) + 1}_{unit}" in table.columns for unit in (*ANGLE, *LENGTH)):
        what = f"has a joint q{len(slides) + 1}, {robot.name} has {len(slides)} joints"
        reader.problems.append(Problem(table.path, what))
    directions = reader.directions(len(slides))
    wanted = reader.pose() if pose else None
    payload = reader.payload()
    label = table.line
    if "pose" in table.columns:
        reader.used.add("pose")
        label = np.array([e.removesuffix(".0") for e in table.texts("pose")], dtype=object)
    refuse(reader.problems, f"{table.path} cannot be used")
    unused = tuple(name for name in table.columns if name not in reader.used)
    return Rows(len(table), label, q_rad, directions, wanted, unused, payload)


def _answered(table: RawTable, names: list[str], what: str) -> RawTable:
    """The rows that hold an answer, of a file that says in a column ``status`` why others do not.

    They are told on the error stream; an empty cell without a status stays, to be refused.
    """
    units = (*ANGLE, *LENGTH)
    columns = [f"{name}_{unit}" for name in names for unit in units]
    columns = [each for each in columns if each in table.columns]
    if "status" not in table.columns or not columns:
        return table
    none = np.all([table.gaps(each) for each in columns], axis=0) & ~table.gaps("status")
    if none.all() or not none.any():
        return table
    rows = table.rows_in_words(np.flatnonzero(none))
    click.echo(f"left out, without {what} by their status: {rows}", err=True)
    kept = np.flatnonzero(~none)
    return table.select(kept)


def of_arguments(texts: tuple[str, ...], unit: str, robot: Robot, option: str) -> np.ndarray:
    """Joints (n, k) of arguments such as "10,-20,30,0,45,0" in ``unit``; InputError if unfit."""
    slides, rows, problems = robot.dh.prismatic, [], []
    for text in texts:
        row = numbers_of(text)
        if len(row) != len(slides):
            allowed = f"{len(slides)} numbers, one per joint of {robot.name}"
            problems.append(Problem(option, repr(text), allowed))
        rows.append(row)
    refuse(problems)
    return np.array(rows) * np.where(slides, 1.0, ANGLE[unit])


def given_joints(
    robot: Robot, path: str | None, in_deg: tuple, in_rad: tuple, answers: Mapping
) -> Rows:
    """Joints of a file or of arguments. InputError without any, or outside the limits.

    ``answers`` to what the file leaves open, by option.
    """
    if [path is not None, bool(in_deg), bool(in_rad)].count(True) != 1:
        raise InputError(Problem("joints", "are needed once", "a file, --joints-deg, --joints-rad"))
    if path is not None:
        given = read(path, robot, answers=answers)
    else:
        unit = "deg" if in_deg else "rad"
        joints = of_arguments(in_deg or in_rad, unit, robot, f"--joints-{unit}")
        given = Rows(len(joints), np.arange(1, len(joints) + 1), joints, None, None, ())
    require_within_limits(robot, given, path or "joints")
    return given


def joint_columns(prismatic: np.ndarray, joints: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of reported joints (n, k): q1_deg .., q1_mm where a joint slides (k,)."""
    return {
        f"q{joint + 1}_{'mm' if slides else 'deg'}": values if slides else np.rad2deg(values)
        for joint, (slides, values) in enumerate(zip(prismatic, joints.T, strict=True))
    }


def candidates(path: str, robot: Robot, most: int, answers: Mapping | None = None) -> Rows:
    """Joints of a file to choose from, as ``read`` reads them.

    Raises InputError outside the limits and for more than ``most``, too.
    """
    given = read(path, robot, answers=answers)
    require_within_limits(robot, given, path, "Candidates")
    if given.count > most:
        raise InputError(Problem(path, f"{given.count} candidates", f"at most {most}"))
    return given


def require_within_limits(robot: Robot, given: Rows, where: str, what: str = "Joints") -> None:
    """Raise InputError with every joint of which a row lies outside the robot's limits."""
    problems = []
    for each in outside_limits(robot, given.joints, 1e-9):
        name = f"q{each.joint}"
        hint = f"the column looks like degrees: name it {name}_deg"
        place = f"{where}, {name}, rows {first_few(given.label[each.rows])}"
        value = f"{each.values[0]:g} {each.unit}"
        problems.append(
            Problem(place, value, each.allowed, hint if each.looks_like_degrees else "")
        )
    if problems:
        raise InputError(problems, f"{what} outside the robot's limits")


class Quantities:
    """Quantities of a table by name and unit; ``problems`` and the columns ``used`` grow.

    ``cells``: where what is wrong with single cells is noted; they are NaN then.
    """

    def __init__(self, table: RawTable, cells: list[Problem] | None = None) -> None:
        self.table = table
        self.problems: list[Problem] = []
        self.used: set[str] = set()
        self.cells = self.problems if cells is None else cells

    def group(self, names: list[str], units: list[dict], needed: bool) -> np.ndarray | None:
        """Columns (n, m) of quantities that come together, or None where none is there."""
        found = [
            columns_of_quantity(self.table, name, own)
            for name, own in zip(names, units, strict=True)
        ]
        present = [bool(each) for each in found]
        if not any(present) and not needed:
            return None
        if not all(present):
            missing = [
                " or ".join(names_of(name, own))
                for name, own, there in zip(names, units, present, strict=True)
                if not there
            ]
            many = len(missing) > 1
            where = f"{self.table.path}: column{'s' * many} {', '.join(missing)}"
            what = "are missing" if many else "is missing"
            self.problems.append(Problem(where, what, fix=listed(self.table)))
            return None
        rounded = [ROUNDED_MM if own is LENGTH else ROUNDED_RAD for own in units]
        return np.stack([self._one(*each) for each in zip(names, found, rounded, strict=True)], 1)

    def _one(self, name: str, places: list[Place], rounded: float) -> np.ndarray:
        """Values (n,) of a quantity; all columns it is given in have to say the same."""
        values = {
            each.column: numbers(self.table, each.column, self.cells) * each.factor
            for each in places
        }
        self.used.update(values)
        first, *others = values
        value = values[first]
        for other in others:
            apart = np.flatnonzero(np.abs(value - values[other]) > rounded)
            if apart.size:
                cells = (self.table.columns[each][apart[0]] for each in (first, other))
                lines = self.table.rows_in_words(apart)
                where = f"{self.table.path}: columns {first} and {other}, {lines}"
                what = f"{name} is given twice and differs: {' and '.join(map(str, cells))}"
                fix = "leave out the column that is wrong"
                self.problems.append(Problem(where, what, "the same in both units", fix))
            value = np.where(np.isnan(value), values[other], value)
        return value

    def directions(self, joints: int) -> np.ndarray | None:
        names = [f"s{i + 1}" for i in range(joints)]
        s = self.group(names, [PURE] * joints, False)
        if s is not None and not np.isin(s, (-1, 0, 1)).all():
            where = f"{self.table.path}: columns s1 .. s{joints}"
            self.problems.append(Problem(where, "a value is no direction", "-1, 0 or 1"))
        return None if s is None else s.astype(np.int8)

    def payload(self) -> np.ndarray | None:
        mass = self.group([PAYLOAD[0]], [MASS], False)
        centre = self.group(list(PAYLOAD[1:]), [LENGTH] * 3, False)
        if mass is None:
            if centre is not None:
                where = f"{self.table.path}: column payload_kg"
                self.problems.append(Problem(where, "is missing beside the payload's centre"))
            return None
        if (mass < 0.0).any():
            where = f"{self.table.path}: column payload_kg"
            self.problems.append(Problem(where, "a mass is negative", "0 or above"))
        return np.hstack([mass, np.zeros((len(mass), 3)) if centre is None else centre])

    def pose(self) -> Pose | None:
        position = self.group(["x", "y", "z"], [LENGTH] * 3, True)
        quaternion = self.group(["qw", "qx", "qy", "qz"], [PURE] * 4, False)
        vector = self.group(["rvx", "rvy", "rvz"], [ANGLE] * 3, False)
        euler = self.group(["rx", "ry", "rz"], [ANGLE] * 3, False)
        given = [each is not None for each in (quaternion, vector, euler)]
        where = f"{self.table.path}: orientation"
        if sum(given) > 1:
            self.problems.append(Problem(where, "is given in more than one form", "one form"))
        elif position is not None and not any(given):
            allowed = "qw .. qz, or rvx_deg .. rvz_deg, or rx_deg .. rz_deg (or rad)"
            self.problems.append(Problem(where, "is missing", allowed))
        if position is None or sum(given) != 1:
            return None
        if quaternion is not None:
            length = np.linalg.norm(quaternion, axis=1)
            bad = np.flatnonzero(~(np.abs(length - 1.0) <= _UNIT_QUATERNION))
            if bad.size:
                place = f"{where}, {self.table.rows_in_words(bad)}"
                what = f"quaternion of length {length[bad[0]]:.6g}"
                self.problems.append(Problem(place, what, "length 1 within 0.001"))
            rotation = rotation_from_quaternion(quaternion / length[:, None])
        elif vector is not None:
            rotation = exp_so3(vector)
        else:
            from scipy.spatial.transform import Rotation

            rotation = Rotation.from_euler("XYZ", euler).as_matrix()
        return Pose(rotation, position)


def open_table(path: str | Path, need: str = "points", answers: Mapping | None = None) -> RawTable:
    """A file of ``need`` (joints, points or poses) under our names.

    A file of other names is read as ``kinacc init`` reads it; how is printed on the error stream.
    ``answers`` to what it leaves open, by option. Files that commands write are read as well: JSON,
    units that stand in the description of a Parquet column, and text of a CSV with the apostrophe
    that keeps it from being a formula.
    """
    path = Path(path)
    refuse_other_files(path)
    if path.suffix.lower() == ".json":
        return _of_json(path)
    if path.suffix.lower() in PARQUET:
        return _with_units(load(path))
    if path.suffix.lower() in EXCEL:
        if _OWN_NAMES[need].search(" ".join((table := load(path)).columns)):
            return table
    else:
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            head, first = file.readline(_HEAD), file.readline(_HEAD)
        if _OWN_NAMES[need].search(head):
            delimiter = next((mark for mark in ";\t" if mark in head), ",")
            comma = delimiter == ";" and "," in first and "." not in first
            table = load(path, Layout(delimiter, "," if comma else "."))
            return replace(table, columns=table.columns.map(of_csv))
    from kinacc.measurements.intake import guess as guesses

    given = {key: value for key, value in (answers or {}).items() if value}
    guess = guesses.look(path, given, need)
    for line in (*guess.notes, *guess.assumed.values(), *guesses.summary(guess)):
        click.echo(f"{path}: {line}", err=True)
    return guesses.under_our_names(guess)


def _of_json(path: Path) -> RawTable:
    """The rows of an answer that a command gave as JSON."""
    try:
        content = json_files.bytes_of(path)
        rows = json_files.values_of(content, str(path), parse_int=_whole)["rows"]
        columns = {name: [row.get(name) for row in rows] for name in rows[0]}
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError):
        allowed = "a table of rows, as commands write with -o NAME.json"
        raise InputError(Problem(str(path), "holds no rows", allowed)) from None
    return RawTable(str(path), frame(columns), np.arange(1, len(rows) + 1))


def _whole(digits: str) -> int | float:
    return int(digits) if len(digits) <= _DIGITS else float(digits)


def _with_units(table: RawTable) -> RawTable:
    """A Parquet table whose joints carry the unit in their names: in tables of results and of
    campaigns it stands in the columns' descriptions."""
    import pyarrow.parquet as pq

    names = {}
    for field in pq.read_schema(table.path):
        unit = ((field.metadata or {}).get(b"unit") or b"").decode(errors="replace")
        if re.fullmatch(r"q\d+", field.name) and unit in (*ANGLE, *LENGTH):
            names[field.name] = f"{field.name}_{unit}"
    fresh = {name: whole for name, whole in names.items() if whole not in table.columns}
    return replace(table, columns=table.columns.rename(columns=fresh))


def say_unused(given: Rows, calibration: Calibration) -> None:
    """Name the columns of a file that were not used, on the error stream."""
    if given.unused:
        click.echo(f"not used: {', '.join(given.unused)}", err=True)
    if given.payload is not None and not calibration.model.knows_loads:
        what = f"the {calibration.choice} model was fitted without loads that change"
        click.echo(f"not used: payload; {what}", err=True)


def warn_unlike(unlike: np.ndarray) -> None:
    """Count the rows (n,) unlike measured poses on the error stream."""
    if np.any(unlike):
        click.echo(
            f"warning: {np.sum(unlike)} of {len(unlike)} poses are not near measured poses "
            "(status); their errors may be larger",
            err=True,
        )


def warn_undetermined(moved_mm: np.ndarray, frame: str) -> None:
    """Warn where undetermined parameters move poses (n,) in the robot's base, mm per mm or mrad."""
    largest = np.nan_to_num(moved_mm).max(initial=0.0)
    if frame == "base" and largest > _MUCH_MOVED_MM:
        click.echo(
            f"warning: each mm or mrad of undetermined parameters moves poses by up to "
            f"{largest:.2g} mm in the base frame; compare --frame instrument",
            err=True,
        )


def end_where_missing(answers: np.ndarray, what: str) -> None:
    """Count the rows (n, m) without an answer on the error stream, and leave with exit code 1."""
    missing = int(np.isnan(answers).any(axis=1).sum())
    if missing:
        click.echo(f"{missing} of {len(answers)} rows without {what}: status says why", err=True)
        raise SystemExit(AGAINST)
