"""What a column and a table are, and short ways to state columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

Columns = dict[str, "np.ndarray"]  # a table in memory: a null number is NaN, a null text None
Tables = Mapping[str, Columns]  # by their names
JOINTS_MIN, JOINTS_MAX = 4, 7
# Two runs of one work may differ by so much, by the unit of a column: rounding differs from machine
# to machine. What an arm is sure of begins at 1e-3 mm; 1e-9 rad is 1e-6 mm at a metre. Pure numbers
# are held to as much as radians, which are pure numbers too.
SAME_WITHIN = {
    **{"mm": 1e-6, "mrad": 1e-6, "rad": 1e-9, "deg": 1e-7, "1": 1e-9, "mm^2": 1e-6},
    # Statistics of claims: lengths in mm, shares and ratios.
    **{"see statement": 1e-6, "see claims": 1e-6, "see factor": 1e-6},
    **{"kg": 1e-6, "degC": 1e-6, "mm per mm or mrad": 1e-6, "mm or mrad": 1e-6},
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

    @property
    def file_name(self) -> str:
        """Name of the table's file inside a data set's folder."""
        return f"{self.name}.parquet"

    def in_file(self, joints: int, names: Iterable[str]) -> tuple[Column, ...]:
        """The columns a file has that is given those of these ``names``."""
        supplied = set(names)
        every = self.for_joints(joints)
        return tuple(item for item in every if not item.may_be_absent or item.name in supplied)

    def for_joints(self, joints: int) -> tuple[Column, ...]:
        """The columns of an arm with this many joints, in file order."""
        expanded: list[Column] = []
        for per_joint, block in groupby(self.columns, key=lambda column: column.per_joint):
            numbers = range(1, joints + 1) if per_joint else [0]
            expanded += [item.numbered(n) if n else item for item in block for n in numbers]
        return tuple(expanded)

    @property
    def has_joints(self) -> bool:
        """Whether the number of columns depends on the arm."""
        return any(column.per_joint for column in self.columns)


def texts(cells: Iterable[object]) -> np.ndarray:
    """Cells (n,) as objects, each as it is: None for null, and none spread over a row."""
    import numpy as np

    return np.array([*cells, None], dtype=object)[:-1]


def joint_count(artefact: Artefact, names: Iterable[str]) -> int:
    """Number of joints a table's column names speak of; 0 where the table has no joint columns.

    Counts the first per-joint column (``q1``, ``q2``, ...) up to the first gap.
    """
    starred = next((column for column in artefact.columns if column.per_joint), None)
    if starred is None:
        return 0
    present, joints = set(names), 0
    while f"{starred.name[:-1]}{joints + 1}" in present:
        joints += 1
    return joints
