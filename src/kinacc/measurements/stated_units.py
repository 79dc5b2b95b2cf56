"""Units that a column's name states against those of the configuration."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from kinacc.errors import Problem
from kinacc.measurements.layout import (
    ANGLE,
    ANGLES,
    ANGLES_IN_ORDER,
    LENGTH,
    POSITION,
    STD,
    STD_TURN,
    Layout,
    split,
)
from kinacc.measurements.names import KNOWN, name_of
from kinacc.measurements.table import RawTable

_JOINT = re.compile(r"q(?P<number>\d)(?:_cmd)?")
_DEFAULT = {"joint_unit": "deg", "length_unit": "mm", "orientation.unit": "deg"}


def contradictions(table: RawTable, layout: Layout, prismatic: np.ndarray) -> Iterator[Problem]:
    """Keys that state another unit than the columns they are about.

    A key that is the default may not be meant: of our names (q1_rad) the name is believed then.
    ``prismatic`` (k,) marks joints whose position is a length.
    """
    keys = {
        "joint_unit": layout.joint_unit,
        "length_unit": layout.length_unit,
        "orientation.unit": layout.angle_unit,
    }
    for key, unit in keys.items():
        said = _of_mapped(table, layout, prismatic, key)
        # Where a mapped column states no unit, the key is about that one.
        if unit != _DEFAULT[key] and None not in said.values():
            said |= _of_our_names(table, layout, prismatic, key)
        for other in dict.fromkeys(said.values()):
            if other in (None, unit):
                continue
            columns = ", ".join(column for column, each in said.items() if each == other)
            yield Problem(
                f"{table.path}: column {columns}",
                f"says {other}, but measurements.file.{key} says {unit}",
                "the same in both places",
                "correct the key, or the name where it is the one that is wrong",
            )


def _of_mapped(table: RawTable, layout: Layout, prismatic, key: str) -> dict[str, str | None]:
    """Units that mapped columns state which ``key`` is about, None for none."""
    return {
        column: _unit(table, column)
        for ours, column in layout.columns.items()
        if column in table.columns and _key(ours, prismatic) == key
    }


def _of_our_names(table: RawTable, layout: Layout, prismatic, key: str) -> dict[str, str | None]:
    """Units of the columns with our names for joints, positions and angles."""
    allowed = LENGTH if key == "length_unit" else ANGLE
    found: dict[str, str | None] = {}
    for column in table.columns:
        ours, _, unit = column.rpartition("_")
        value = split(ours)[1] in (*POSITION, *ANGLES, *ANGLES_IN_ORDER) or _JOINT.fullmatch(ours)
        if value and ours not in layout.columns and unit in allowed:
            found |= {column: unit} if _key(ours, prismatic) == key else {}
    return found


def _unit(table: RawTable, column: str) -> str | None:
    """The unit a column states in its name or under it, None for none that is known."""
    place = list(table.columns).index(column)
    under = table.under[place] if place < len(table.under) else ""
    said = name_of(column, under if name_of("x", under).unit in KNOWN else "").unit
    return said if said in KNOWN or " or " in said else None


def _key(name: str, prismatic) -> str:
    """The key that states the unit of a quantity of our name, empty where none does."""
    if joint := _JOINT.fullmatch(name):
        number = int(joint["number"])
        return "length_unit" if number <= len(prismatic) and prismatic[number - 1] else "joint_unit"
    quantity = split(name)[1]
    if quantity in (*POSITION, *STD):
        return "length_unit"
    return "orientation.unit" if quantity in (*ANGLES, *ANGLES_IN_ORDER, *STD_TURN) else ""
