"""A file nobody has described as a ``measurements.file`` section, with all that was assumed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.data.layout import TOOL
from kinacc.data.table import RawTable, numbers
from kinacc.errors import InputError, Problem
from kinacc.intake import columns, text
from kinacc.intake.columns import Columns
from kinacc.intake.names import Name, name_of

_NATIVE_UNIT = {"C": ("C", "c")}
_FULL_TURN_RAD = 2.0 * np.pi * 1.05
_LARGEST_M = 50.0  # no instrument stands further away


@dataclass(frozen=True)
class Guess:
    """What ``measurements.file`` would say, and what of it the file does not.

    ``assumed`` are words on settings taken by default or by the size of numbers, by setting:
    joint_unit, length_unit, angle_unit, orientation. ``joints`` counts the joints.
    """

    section: dict[str, Any]
    joints: int
    targets: tuple[str, ...]
    assumed: dict[str, str] = field(default_factory=dict)
    unused: tuple[str, ...] = ()

    def but(self, settings: Mapping[str, Any]) -> Guess:
        """The guess with other settings; ``orientation`` is taken key by key."""
        section = self.section | {k: v for k, v in settings.items() if k != "orientation"}
        turn = section["orientation"] | settings.get("orientation", {})
        return replace(self, section=section | {"orientation": turn})


def look(path: str | Path) -> Guess:
    """The best guess at a file. Raises InputError where joints or positions cannot be found."""
    written = text.look(path)
    table = written.load(path)
    units = written.units or ("",) * len(table.columns)
    if len(units) != len(table.columns):
        what = f"{len(units)} units under {len(table.columns)} column names"
        where = f"{path}: line {written.skip_lines + 2}"
        raise InputError(Problem(where, what, "a unit, or nothing, for each"))
    names = [name_of(c, u) for c, u in zip(table.columns, units, strict=True)]
    found = columns.recognise(names)
    _refuse(str(path), found)
    assumed: dict[str, str] = {}
    single = next(iter(found.targets.values()))
    turn = [n for q, n in single.items() if q in ("rx", "ry", "rz")]
    kind, convention = found.turn
    joint_unit = _unit(table, found.joints, "joint_unit", ("deg", "rad"), _FULL_TURN_RAD, assumed)
    points = [single[axis] for axis in "xyz"]
    length_unit = _unit(table, points, "length_unit", ("mm", "m"), _LARGEST_M, assumed)
    angle_unit = _unit(table, turn, "angle_unit", ("deg", "rad"), _FULL_TURN_RAD, assumed)
    if kind == "euler":
        assumed["orientation"] = f"the orientations are Euler angles of convention {convention}"
    section: dict[str, Any] = {
        "path": str(path),
        "delimiter": written.delimiter,
        "decimal": written.decimal,
        "skip_lines": written.skip_lines,
        "skip_under_names": written.skip_under_names,
        "joint_unit": joint_unit,
        "length_unit": length_unit,
        "orientation": {"kind": kind, "convention": convention, "unit": angle_unit},
        "columns": _mapping(found, joint_unit, length_unit, angle_unit),
        "targets": None,
    }
    used = {*section["columns"].values(), *(n.column for n in _all(found))}
    unused = tuple(name for name in table.columns if name not in used)
    return Guess(section, len(found.joints), tuple(found.targets), assumed, unused)


def _refuse(path: str, found: Columns) -> None:
    problems = []
    if not found.joints:
        fix = "name them q1_deg, q2_deg .., or write the data set by hand (docs/configuration.md)"
        problems.append(Problem(path, "no columns of 4 to 7 joints were found", "q1 ..", fix))
    if not found.targets:
        fix = "name them x_mm, y_mm, z_mm, or write the data set by hand (docs/configuration.md)"
        problems.append(Problem(path, "no columns of a measured point were found", "x, y, z", fix))
    if problems:
        raise InputError(problems, f"{path} cannot be described")


def _all(found: Columns):
    yield from found.joints
    yield from found.commanded
    yield from found.single.values()
    for target in found.targets.values():
        yield from target.values()


def _unit(table: RawTable, names, setting: str, units: tuple[str, str], largest: float, assumed):
    """The unit the names state, or the one the size of the numbers speaks for."""
    stated = {each.unit for each in names} - {""}
    if len(stated) == 1 and (unit := stated.pop()) in units:
        return unit
    if not names:
        return units[0]
    values = [numbers(table, each.column, [], gaps=True) for each in names]
    most = max((float(np.nanmax(np.abs(v))) for v in values if np.isfinite(v).any()), default=0.0)
    usual, small = units
    unit = small if most <= largest else usual
    ends = [names[0].column, names[-1].column]
    listed = " .. ".join(ends) if len(names) > 3 else ", ".join(n.column for n in names)
    assumed[setting] = f"{listed} are in {unit}: the largest number is {most:.4g}"
    return unit


def _mapping(found: Columns, joint_unit: str, length_unit: str, angle_unit: str) -> dict[str, str]:
    """Our names and the file's, of columns that do not have ours already."""
    mapping: dict[str, str] = {}

    def put(ours: str, name: Name, unit: str) -> None:
        own = [f"{ours}_{each}" for each in _NATIVE_UNIT.get(unit, (unit,))] if unit else [ours]
        if name.column not in own:
            mapping[ours] = name.column

    for number, name in enumerate(found.joints, 1):
        put(f"q{number}", name, joint_unit)
    for number, name in enumerate(found.commanded, 1):
        put(f"q{number}_cmd", name, joint_unit)
    for target, parts in found.targets.items():
        prefix = "" if target == TOOL else f"{target}_"
        for quantity, name in parts.items():
            turned = quantity.removeprefix("std_").startswith("r")
            unit = "" if quantity[0] == "q" else angle_unit if turned else length_unit
            if quantity.startswith("std_") and name.unit not in ("", unit):
                continue
            put(f"{prefix}{quantity}", name, unit)
    for quantity, name in found.single.items():
        put(quantity, name, "C" if quantity == "temperature" else "")
    # temp_C is read as it stands.
    if mapping.get("temperature", "").lower() == "temp_c":
        del mapping["temperature"]
    return mapping
