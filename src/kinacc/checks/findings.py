"""Everything that can be wrong with a measured file, each with its message and remedy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from kinacc.measurements.row_names import RowNames
from kinacc.tables.allowed import LEFT_OUT

STOPS, WARNING, NOTE = "stops", "warning", "note"

# Message and remedy of every finding; behind a slash stands which of its messages.
TEXTS = {
    "joint_units": (
        "the joints are in {unit}, not in {stated}",
        "name the columns q1_{short} .., or set measurements.file.joint_unit: {short}",
    ),
    "joint_units/sliding": ("the sliding joints are in {unit}", "correct the unit of the columns"),
    "length_units": (
        "the positions are in {unit}",
        "name the columns x_{short} .., or set measurements.file.length_unit: {short}",
    ),
    "length_units/other": ("the positions are in {unit}", "convert them to millimetres or metres"),
    "length_units/small": (
        "the positions are in a thousandth of the stated unit",
        "state their unit (measurements.file.length_unit: mm), or convert them",
    ),
    "angle_units": (
        "the orientation angles are in {unit}, not in {stated}",
        "name the columns rx_{short} .., or set measurements.file.orientation.unit: {short}",
    ),
    "left_handed": (
        "the positions are in left-handed coordinates",
        "negate one coordinate (of the orientations too), or export right-handed coordinates",
    ),
    "left_handed/axis": ("{axis} has the wrong sign", "negate {axis}"),
    "left_handed/turns": (
        "the orientations are in left-handed coordinates ({axis} reversed)",
        "export right-handed coordinates",
    ),
    "transposed_rotation": (
        "the orientations are transposed: of the instrument seen from the target",
        "invert the orientations (quaternion: negate x, y and z)",
    ),
    "euler_convention": (
        "the orientations are Euler angles {convention}{order}, not {stated}",
        "set measurements.file.orientation.convention: {convention}",
    ),
    "euler_convention/quaternion": (
        "the quaternions are in the order {order}",
        "set measurements.file.orientation.order: {order}, or exchange the columns",
    ),
    "euler_convention/vector": (
        "the orientations are rotation vectors, not Euler angles",
        "set measurements.file.orientation.kind: rotation_vector",
    ),
    "orientations": (
        "orientations do not go with the joints: seen from the flange they scatter by "
        "{as_written_deg:.3g} deg, and no other reading of them does better",
        "check their kind, convention, unit and the order of their columns",
    ),
    "joint_sign": (
        "joint {joint} counts the other way",
        "reverse joint {joint} in the robot file (sign: -1) or in the measured file",
    ),
    "joint_coupling": (
        "joint {joint} is joint {joint} {sign} joint {other} of the file",
        "write joint_map: {map} into the robot file",
    ),
    "joint_zero": (
        "joint {joint} counts from another zero, {zero_deg:+g} deg away",
        "change theta_offset of joint {joint} in the robot file",
    ),
    "joint_order": ("joints {joint} and {other} are exchanged", "exchange their columns"),
    "does_not_fit": (
        "no reading of the numbers that was tried brings {robot} nearer than {sigma_mm:.3g} mm per "
        "axis",
        "check the robot, its joint order, zeros and couplings, and that joints and readings are "
        "of the same rows{more}",
    ),
    "does_not_fit/lengths": (
        "{robot} fits with other lengths only ({lengths}): the arm is another one of the same "
        "build, or its robot file is wrong",
        "name the robot that was measured, or correct its robot file",
    ),
    "outside_limits": (
        "joint {joint} reaches {largest:.4g} {unit}; its limits are {allowed}",
        "check the rows, or the limits in the robot file",
    ),
    "base_jump": (
        "the base frame jumps before {row} by {by} mm (x, y, z) and {turn_mrad:.3g} mrad",
        "give the rows before and after a session each (column session)",
    ),
    "drift": (
        "the base frame drifts slowly, by {by} mm (x, y, z) in the order of the file",
        "let arm and instrument warm up and measure again; sessions do not help. To use the file, "
        "hold out blocks of time (measurements.fold_by: time_block)",
    ),
    "target_moved": (
        "target {target} moved before {row}, by {by} mm in the flange frame",
        "give the target another name from there on",
    ),
    "target_moved/distances": (
        "target {target}{sure} moved before {row}: its distances change by {by}",
        "give the target another name from there on",
    ),
    "target_swapped": ("target {target} was taken for another", "exchange them"),
    "duplicate_rows": (
        "rows equal to an earlier one in every joint and reading: {count}; the first copies {row}",
        "take the copies out: they count as measurements that were never made",
    ),
    "repeated_reading": (
        "rows with the reading of an earlier row, equal in every digit, at other joints: {pairs}",
        "the instrument was not read anew: measure them again, or exclude the rows",
    ),
    "repeated_reading/off": (
        "readings equal to an earlier one in every digit that do not fit the joints: {count}",
        "the instrument was not read anew: exclude the rows",
    ),
    "commanded_joints": (
        "joints on whole {grid_deg:g} deg, which the others are not, in {count} rows that fit "
        "{times} times worse: commanded joints, not those read back",
        "take the joints read back",
    ),
    "commanded_joints/all": (
        "all joints are on whole {grid_deg:g} deg, and the errors of {error} mm are as large as "
        "such rounding makes them ({rounding} mm): commanded or rounded joints",
        "take the joints read back, with all their digits",
    ),
    "commanded_joints/apart": (
        "joints read back and commanded differ in {count} rows, by up to {largest_mm:.3g} mm at "
        "the target; {better} fit better",
        "the arm was not where it was sent, or the two belong to different rows",
    ),
    "commanded_joints/exchanged": (
        "the commanded joints fit better than those read back ({sigma} mm per axis): the two may "
        "be exchanged",
        "exchange the columns",
    ),
    "commanded_joints/better": (
        "the commanded joints fit and those read back do not",
        "see which of the two columns are the joints measured at",
    ),
    "commanded_joints/one": (
        "joint {joint} alone explains errors of {count} rows, by up to {largest_deg:.3g} deg: "
        "commanded instead of read back, or not at rest",
        "take the joints read back when the instrument was read",
    ),
    "outliers": (
        "readings too far from where all others put the arm: {count}; up to {largest_mm:.3g} mm"
        "{turned} at {row}, where {limit_mm:.3g} mm is the most to be expected",
        "measure them again; exclude slips, keep errors that repeat: those are the arm's",
    ),
    "outliers/distances": (
        "rows in which distances between targets differ from all others, by up to "
        "{largest_mm:.3g} mm: {count}",
        "a target was exchanged, hidden or touched: measure the rows again, or exclude them",
    ),
    "outliers/repeats": (
        "readings far from the repeats at the same configuration, by up to {largest_mm:.3g} mm: "
        "{count}",
        "measure them again, or exclude the rows",
    ),
    "largest_rows": (
        "the largest error hangs on {count} poses: off by {errors} mm, the next by {next} mm",
        "measure them again; exclude slips, keep errors that repeat: those are the arm's",
    ),
    "few_poses": (
        "{poses} different poses give {numbers} independent numbers for {coefficients} "
        "coefficients of the VEC model of order {order}{frames}: its prior decides most of them",
        "measure more poses, lower calibration.vec.order, or let it be chosen (order: auto)",
    ),
    "thin_coverage": (
        "joint {joint} moves through {percent} % of its range only: its errors are poorly "
        "determined",
        "measure poses in which it moves further",
    ),
    LEFT_OUT: ("{words}", ""),
}
_WARN = {"outside_limits", "target_swapped", "duplicate_rows", "repeated_reading"}
_WARN |= {"commanded_joints", "outliers"}  # they stop a workflow where a reading is far off
_NOTES = {"thin_coverage", LEFT_OUT}
_NEVER_STOP = _NOTES | {"largest_rows"}
_OF_ROWS = _WARN - {"commanded_joints"}
STOPPING = tuple(
    dict.fromkeys(k for k in (key.partition("/")[0] for key in TEXTS) if k not in _NEVER_STOP)
)


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a file, or may be.

    Attributes
    ----------
    kind
        Its code, see ``TEXTS``.
    what, fix
        Message and remedy.
    values
        Numbers behind it, units in their names.
    lines
        Lines of the file it concerns, in order.
    level
        Whether it stops a workflow that fits the data, warns, or is a note.
    row_names
        How the rows at these lines are called.
    """

    kind: str
    what: str
    fix: str
    values: Mapping[str, object]
    lines: tuple[int, ...] = ()
    level: str = WARNING
    row_names: RowNames = field(default_factory=RowNames)

    @property
    def where(self) -> str:
        """The lines in words."""
        return self.row_names.spans(self.lines)

    def at(self, lines: Iterable[int], detail: str = "", **values) -> Finding:
        """The finding at these lines, with more numbers; ``detail`` is appended to its message."""
        unique = tuple(sorted({int(line) for line in lines}))
        values = {**self.values, **values}
        what = self.what + detail.format(**values)
        return replace(self, what=what, lines=unique, values=values)

    def held_to(self, gross: Iterable[int]) -> Finding:
        """The finding with its level; rows at the lines ``gross`` are too far off for any fit."""
        if self.kind in _NEVER_STOP:
            return self
        stops = self.kind not in _WARN or not set(gross).isdisjoint(self.lines)
        return replace(self, level=STOPS if stops else WARNING)

    def commands(self, config: str = "FILE.yaml") -> list[str]:
        """Commands to go on with: exclude the rows, or accept the finding."""
        found = [f'kinacc check-data {config} --accept {self.kind} --reason ".."']
        if self.kind in _OF_ROWS and self.lines:
            runs = np.split(self.lines, np.flatnonzero(np.diff(self.lines) > 1) + 1)
            lines = ",".join("-".join(dict.fromkeys(f"{run[0]} {run[-1]}".split())) for run in runs)
            found.insert(0, f'kinacc exclude {config} --lines {lines} --reason ".."')
        return found


def finding(key: str, lines: Iterable[int] = (), **values) -> Finding:
    """The finding ``key`` of ``TEXTS`` at ``lines``, each named once and in order."""
    what, fix = (text.format(**values) for text in TEXTS[key])
    kind = key.partition("/")[0]
    level = NOTE if kind in _NOTES else WARNING
    return Finding(kind, what, fix, values, level=level).at(lines)
