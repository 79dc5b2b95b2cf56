"""What looks wrong in a file, with the lines it concerns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from kinacc.measurements.row_names import RowNames
from kinacc.tables.allowed import LEFT_OUT

KINDS = {
    "outside_limits": "joints outside the robot's limits",
    "joint_units": "joints in another unit than stated",
    "length_units": "positions in another unit than stated",
    "angle_units": "orientation angles in another unit than stated",
    "left_handed": "left-handed coordinates",
    "transposed_rotation": "orientations the wrong way round (transposed)",
    "euler_convention": "orientations of another convention than stated",
    "orientations": "orientations that do not go with the joints",
    "joint_sign": "a joint that counts the other way",
    "joint_coupling": "joints that are coupled",
    "joint_zero": "a joint that counts from another zero",
    "joint_order": "joints in another order",
    "duplicate_rows": "rows that are there twice",
    "repeated_reading": "a reading that was not taken anew",
    "target_moved": "a target that moved",
    "target_swapped": "targets taken for one another",
    "base_jump": "a base frame that jumps",
    "drift": "a base frame that drifts",
    "commanded_joints": "joints as commanded, not as read back",
    "outliers": "readings far from all the others",
    "largest_rows": "readings on which the largest error hangs",
    "does_not_fit": "a robot that is not the one described",
    "few_poses": "fewer poses than the model asks for",
    "thin_coverage": "joints that hardly move",
    LEFT_OUT: "what is left out of the file",
}
STOPS, WARNING, NOTE = "stops", "warning", "note"
# Numbers that mean something else, a base or target that moved, a model that asks for more.
_WRONG = {
    *("joint_units", "length_units", "angle_units", "left_handed", "transposed_rotation"),
    *("euler_convention", "orientations", "joint_sign", "joint_coupling", "joint_zero"),
    *("joint_order", "target_moved", "base_jump", "drift", "does_not_fit", "few_poses"),
}
_NEVER_STOP = {"largest_rows", "thin_coverage", LEFT_OUT}
_OF_ROWS = {"outliers", "repeated_reading", "duplicate_rows", "outside_limits", "target_swapped"}
STOPPING = tuple(kind for kind in KINDS if kind not in _NEVER_STOP)  # some of them by their size


@dataclass(frozen=True)
class Suspicion:
    """One thing that looks wrong: ``kind`` of ``KINDS``, in words, with its lines of the file.

    ``fix`` says what to do about it; ``values`` are the numbers behind it, units in their names.
    ``level``: whether it stops a workflow that fits the data, warns, or is a note beside it.
    ``row_names`` say what the rows at its lines are called.
    """

    kind: str
    what: str
    lines: tuple[int, ...]
    fix: str = ""
    values: Mapping[str, object] = field(default_factory=dict)
    level: str = WARNING
    row_names: RowNames = field(default_factory=RowNames)

    @property
    def where(self) -> str:
        """The lines in words."""
        return self.row_names.spans(self.lines)

    def commands(self, config: str = "FILE.yaml") -> list[str]:
        """Commands to go on with: without the rows, where it is about rows, and all the same."""
        start = f"kinacc check-data {config} --accept {self.kind}"
        found = [f'{start} --reason ".."']
        if self.kind in _OF_ROWS and self.lines:
            found.insert(0, f'kinacc exclude {config} --lines {_ranges(self.lines)} --reason ".."')
        return found

    def held_to(self, gross: Iterable[int]) -> Suspicion:
        """The suspicion with its level; rows at the lines ``gross`` are too far off for any fit."""
        if self.kind in _NEVER_STOP:
            return self
        stops = self.kind in _WRONG or not set(gross).isdisjoint(self.lines)
        return replace(self, level=STOPS if stops else WARNING)


def _ranges(lines: Sequence[int]) -> str:
    """Line numbers in order as text: 12,15-18."""
    parts: list[list[int]] = []
    for line in lines:
        if parts and line == parts[-1][-1] + 1:
            parts[-1][1:] = [line]
        else:
            parts.append([line])
    return ",".join("-".join(map(str, part)) for part in parts)


def suspicion(kind: str, what: str, lines: Iterable[int], fix: str = "", **values) -> Suspicion:
    """A suspicion of any lines, each named once and in order."""
    unique = tuple(sorted({int(line) for line in lines}))
    return Suspicion(kind, what, unique, fix, values)
