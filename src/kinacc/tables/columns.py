"""What a column and a table are, and short ways to state columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

Columns = dict[str, np.ndarray]  # a table in memory: a null number is NaN, a null text None
Tables = Mapping[str, Columns]  # by their names
JOINTS_MIN, JOINTS_MAX = 4, 7
# Two runs of one work may differ by so much, by the unit of a column: rounding differs from machine
# to machine. What an arm is sure of begins at 1e-3 mm; 1e-9 rad is 1e-6 mm at a metre. Pure numbers
# are held to as much as radians, which are pure numbers too.
SAME_WITHIN = {
    **dict.fromkeys(("mm", "mrad", "mm^2", "mm per mm or mrad", "mm or mrad", "kg", "degC"), 1e-6),
    # Statistics of claims: lengths in mm, shares and ratios.
    **dict.fromkeys(("see statement", "see claims", "see factor"), 1e-6),
    **{"rad": 1e-9, "deg": 1e-7, "1": 1e-9},
}
# Among values of several units pure numbers may be as large as thousands of degrees of freedom.
SAME_AMONG = {**SAME_WITHIN, "1": 1e-6}


@dataclass(frozen=True)
class Column:
    """One column of a table.

    ``kind`` is float, int, int8, bool or text. ``unit`` is empty for text and names, "1" for pure
    numbers. ``low`` and ``high`` bound what is physically possible, both included; ``choices`` or
    ``pattern`` bound what a text may say. An ``optional`` column is null throughout where a table
    does not state it; one that ``may_be_absent`` is not in the file then. ``same`` is what two runs
    of one work may differ by where that is not as its unit says (SAME_WITHIN).
    """

    name: str
    kind: str
    unit: str
    meaning: str
    nullable: bool = False
    low: float | None = None
    high: float | None = None
    choices: tuple[str | int, ...] = ()
    pattern: str = ""
    optional: bool = False
    may_be_absent: bool = False
    same: float | None = None

    @property
    def same_within(self) -> float | None:
        """What two runs of one work may differ by; None where that depends on the row."""
        if self.kind != "float":
            return 0.0
        return SAME_WITHIN.get(self.unit) if self.same is None else self.same

    @property
    def per_joint(self) -> bool:
        """Whether the column stands for one column per joint."""
        return self.name.endswith("*")

    def numbered(self, joint: int) -> Column:
        """The column of one joint (1-based)."""
        meaning = self.meaning.replace("each joint", f"joint {joint}")
        return replace(self, name=self.name[:-1] + str(joint), meaning=meaning)

    @property
    def limits(self) -> str:
        """What the column may hold, in words."""
        bounds = {"at least": self.low, "at most": self.high}
        limits = [f"{text} {limit:g}" for text, limit in bounds.items() if limit is not None]
        parts = [
            ", ".join(map(str, self.choices)),
            f"text like {self.pattern}" if self.pattern else "",
            ", ".join(limits),
            "null" if self.nullable else "",
            "absent" if self.may_be_absent else "",
        ]
        return " or ".join(filter(None, parts))


@dataclass(frozen=True)
class Artefact:
    """One table: its columns in order, and the columns that together name a row only once."""

    name: str
    topic: str
    meaning: str
    columns: tuple[Column, ...]
    key: tuple[str, ...]
    may_be_empty: bool = False

    def in_file(self, names: Iterable[str]) -> list[Column]:
        """The columns a file has that is given those of these ``names``, for as many joints."""
        supplied, joints = set(names), JOINTS_MIN
        stem = next((column.name[:-1] for column in self.columns if column.per_joint), "")
        while joints < JOINTS_MAX and f"{stem}{joints + 1}" in supplied:
            joints += 1
        every = self.for_joints(joints)
        return [item for item in every if not item.may_be_absent or item.name in supplied]

    def for_joints(self, joints: int) -> list[Column]:
        """The columns of an arm with this many joints, in file order."""
        return [
            item.numbered(joint) if joint else item
            for item in self.columns
            for joint in (range(1, joints + 1) if item.per_joint else [0])
        ]


def texts(cells: Iterable[object]) -> np.ndarray:
    """Cells (n,) as objects, each as it is: None for null, and none spread over a row."""
    return np.array([*cells, None], dtype=object)[:-1]
