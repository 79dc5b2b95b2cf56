"""Settings of measurements: the synthetic arm, and how a measured file is read."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from kinacc.config.fields import (
    Distinct,
    Section,
    Text,
    distinct,
    is_there,
    refused,
    setting,
)
from kinacc.config.values import did_you_mean, shown

# Names that a column of a measured file has for kinacc; those of POINT may have a target in front.
PAYLOAD = ("payload", "payload_x", "payload_y", "payload_z")
POSITION = ("x", "y", "z")
QUATERNION, QUATERNION_IN_ORDER = ("qw", "qx", "qy", "qz"), ("quat1", "quat2", "quat3", "quat4")
ANGLES, ANGLES_IN_ORDER = ("rx", "ry", "rz"), ("e1", "e2", "e3")
STD = ("std_x", "std_y", "std_z")
_JOINTS = (name.format(joint) for name in ("q{}", "q{}_cmd", "s{}") for joint in range(1, 8))
ROW = ("pose", "target", "repeat", "session", "temperature", *PAYLOAD, *_JOINTS)
POINT = (*POSITION, *STD, *QUATERNION, *QUATERNION_IN_ORDER, *ANGLES, *ANGLES_IN_ORDER)
_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "XYX", "XZX", "YXY", "YZY", "ZXZ", "ZYZ")
CONVENTIONS = (*_ORDERS, *map(str.lower, _ORDERS))  # of Euler angles: intrinsic, extrinsic
_NAMES = f"{', '.join(ROW)}; of a target, or of one named before it (mA_x), {', '.join(POINT)}"


def _column(name: Any) -> Any:
    of_target = isinstance(name, str) and name.endswith(tuple(f"_{word}" for word in POINT))
    if name not in (*ROW, *POINT) and not of_target:
        raise refused(f"unknown name {name!r}", did_you_mean(name, (*ROW, *POINT)))
    return name


def _listed(lines: Any) -> Any:
    return lines if isinstance(lines, list) else [lines]


Columns = Annotated[
    dict[Annotated[str, BeforeValidator(_column)], Text],
    distinct(dict.values),
]
Names = Annotated[list[Text], Field(min_length=1, max_length=10000), Distinct]
Thousands = Literal[".", ",", " ", "'"]
Encoding = Literal["utf-8", "utf-16-le", "utf-16-be", "latin-1", "cp932"]


class Excluded(Section):
    """Rows of a measured file that are not used."""

    lines: Annotated[
        list[Annotated[int, Field(ge=1, le=1e9)]],
        Field(min_length=1, max_length=100_000),
        Distinct,
        BeforeValidator(_listed),
    ] = setting(..., "lines of the file")
    reason: Text = setting(..., "why")


def _lines(rows: list[Excluded]) -> list[int]:
    return [line for row in rows for line in row.lines]


class Synthetic(Section):
    """The synthetic physical arm (used where source is synthetic)."""

    draw: int = setting(0, "which accepted draw of the arm, counted from 0", ge=0, le=10000)
    poses: int = setting(400, "number of calibration poses", ge=10, le=100000)
    tracker_noise_mm: float = setting(
        0.02,
        "standard deviation of the tracker per axis",
        "mm",
        ge=0,
        le=1,
    )
    wave_decay: float = setting(
        1.0,
        "power by which the waves of its errors over a joint's range fall with their number: "
        "less is rougher, the size stays",
        ge=0,
        le=10,
    )
    ripple: float = setting(
        1.0,
        "factor on its errors once and twice per motor turn, which come from the gears",
        ge=0,
        le=100,
    )


class Orientation(Section):
    """How the file states orientations."""

    kind: Literal["none", "quaternion", "rotation_vector", "euler"] = setting(
        "euler",
        "none for position only",
    )
    convention: Literal[*CONVENTIONS] = setting(  # type: ignore[valid-type]
        "XYZ",
        "Euler sequence of the angles about the axes rx, ry, rz, or e1, e2, e3 in order; "
        "capitals intrinsic, small letters extrinsic",
    )
    order: Literal["wxyz", "xyzw"] = setting(
        "wxyz",
        "what quat1, quat2, quat3, quat4 are; columns qw, qx, qy, qz need no order",
    )
    unit: Literal["deg", "rad"] = setting("deg", "unit of Euler angles or rotation vector")


class Directions(Section):
    """How the angles of a spherical layout are counted."""

    unit: Literal["deg", "gon", "rad"] = setting("deg", "unit of both angles")
    vertical: Literal["zenith", "horizon"] = setting(
        "zenith",
        "what the vertical angle is counted from",
    )
    horizontal: Literal["clockwise", "counterclockwise"] = setting(
        "clockwise",
        "how the horizontal angle is counted, seen from above",
    )


class Written(Section):
    """How numbers and columns are written in a file."""

    delimiter: Literal[",", ";", "\t", " ", "blanks"] = setting(
        ",",
        "character between two columns, or blanks for one or more of them",
    )
    decimal: Literal[".", ","] = setting(".", "decimal mark")
    skip_lines: int = setting(0, "lines left out above the line of column names", ge=0, le=10000)
    skip_under_names: int = setting(0, "lines left out under the column names", ge=0, le=100)
    thousands: Thousands | None = setting(
        None,
        "mark between thousands, in cells where it stands between groups of three digits",
    )
    encoding: Encoding = setting(
        "utf-8",
        "characters of a text file; latin-1 with the signs of Windows",
    )
    sheet: Text | None = setting(None, "sheet of an Excel workbook; null for the first")
    names: Names | None = setting(None, "names of the columns of a file that has no line of names")

    @model_validator(mode="after")
    def _marks_differ(self) -> Self:
        # A delimiter within numbers may be quoted; elsewhere it makes rows of too many cells.
        if self.thousands == self.decimal:
            raise refused(f"{self.thousands!r} is also the decimal mark", "", "thousands")
        return self


class JointsFile(Written):
    """Joints that stand in a file of their own, beside the points of path."""

    path: Text | None = setting(
        None,
        "file of the joints, relative to the folder of the file this stands in; null where path"
        " has them",
    )
    by: Literal["name", "time", "order"] = setting(
        "name",
        "what says which joints and points are of one pose",
    )
    key: Text | None = setting(None, "column of the joints' file with the names or times")
    key_of_points: Text | None = setting(None, "column of the points' file with the names or times")
    clock_offset_s: float = setting(
        0.0,
        "what is added to the times of points to get those of joints",
        "s",
        ge=-1e10,
        le=1e10,
    )
    within_s: float = setting(0.5, "how far joints may be from a point in time", "s", gt=0, lt=3600)

    @model_validator(mode="after")
    def _keys_are_given(self) -> Self:
        for key in ("key", "key_of_points"):
            if self.path and self.by != "order" and getattr(self, key) is None:
                raise refused(f"needs {key}, to join by {self.by}", "name the column", key)
        return self


class MeasuredFile(Written):
    """The measured file (used where source is file)."""

    path: Text | None = setting(
        None,
        "CSV, text, Excel (.xlsx) or Parquet file, relative to the folder of the file this "
        "stands in",
    )
    source: Text | None = setting(
        None,
        "where the data comes from; quoted when the file is missing",
        execution=True,
    )
    joint_unit: Literal["deg", "rad"] = setting(
        "deg",
        "unit of the joint positions; refused where their columns state another",
    )
    length_unit: Literal["mm", "m", "cm", "inch"] = setting(
        "mm",
        "unit of the positions; refused where their columns state another",
    )
    orientation: Orientation = Orientation()
    targets: Names | None = setting(
        None,
        "targets to read, by the names in front of their columns (mA_x_mm); null for all but "
        "those whose names call them nominal, commanded, a deviation, an uncertainty or the "
        "robot's own",
    )
    columns: Columns = setting(
        {},
        "the file's own names of columns, where they are not q1_deg, x_mm, rx_deg and the like",
        allowed=f"a mapping of {_NAMES} to text",
    )
    layout: Literal["table", "features", "spherical"] = setting(
        "table",
        "a row per reading, a row per feature and axis (X, Y, Z), or two angles and a distance "
        "in place of x, y, z",
    )
    directions: Directions = Directions()
    no_reading: list[Annotated[float, Field(ge=-1e38, le=1e38)]] = setting(
        [],
        "numbers that say that nothing was read: in all of x, y and z, or in any of them where "
        "it is all nines (9999.999) or beyond all lengths",
        max_length=20,
    )
    sigma: int = setting(1, "standard deviations that an uncertainty in the file is", ge=1, le=3)
    pulses_per_deg: list[Annotated[float, Field(ge=-1e7, le=1e7)]] | None = setting(
        None,
        "pulses of each joint's motor in one degree, where the joints are given in pulses",
        min_length=4,
        max_length=7,
    )
    repeats_in_names: bool = setting(
        False,
        "a number behind _ or - at the end of a pose's name (P12_1, P12-2) counts readings of "
        "one pose",
    )
    joints: JointsFile = JointsFile()
    exclude: Annotated[list[Excluded], distinct(_lines)] = setting(
        [],
        "rows that no fit and no figure uses, by their lines in the file (row numbers of a "
        "Parquet file), each with the reason",
        allowed="a list of {lines: [8, 12], reason: ..}",
    )


class Measurements(Section):
    """Where the measured poses come from and how they are split."""

    source: Literal["synthetic", "file"] = setting(
        "synthetic",
        "a synthetic arm, or a file of measurements",
    )
    folds: int | None = setting(
        5,
        "shares of the poses, each held out once for the held-out errors; null for none",
        ge=2,
        le=100,
    )
    fold_by: Literal["configuration", "time_block"] = setting(
        "configuration",
        "configurations dealt out at random, or in contiguous runs of the rows as measured",
    )
    validation_fold: int | None = setting(
        0,
        "fold held out of the delivered fits, counted from 0; null for none",
        ge=0,
        le=99,
    )
    synthetic: Synthetic = Synthetic()
    file: MeasuredFile = MeasuredFile()

    @model_validator(mode="after")
    def _fold_is_there(self) -> Self:
        if self.validation_fold is not None and self.validation_fold >= (self.folds or 0):
            message = f"there is no fold {self.validation_fold}, with folds: {shown(self.folds)}"
            raise refused(message, "folds count from 0; null for none", "validation_fold")
        return self

    @model_validator(mode="after")
    def _files_are_there(self, info: ValidationInfo) -> Self:
        file, source = self.file, self.file.source
        for path, *keys in (file.path, "path"), (file.joints.path, "joints", "path"):
            if self.source == "file" and path is not None and not is_there(path, info):
                fix = f"the data comes from: {' '.join(source.split())}" if source else ""
                raise refused(f"{path!r} does not exist", fix, "file", *keys)
        return self
