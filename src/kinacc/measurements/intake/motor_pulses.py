"""Joints in pulses of their motors, which need the number of pulses of a degree."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.errors import InputError, Problem
from kinacc.measurements.column_names import Name
from kinacc.measurements.intake.choices import Choice, Undecided
from kinacc.measurements.intake.columns import NamedColumns
from kinacc.measurements.intake.groups import is_pulse

_MOST_DEG = 7200.0  # no joint turns further


@dataclass(frozen=True)
class Pulses:
    """``per_deg`` pulses of every joint in a degree, empty where joints are angles."""

    found: NamedColumns
    per_deg: tuple[float, ...] = ()
    told: tuple[str, ...] = ()


def pulses(
    found: NamedColumns, values: Callable[[Name], np.ndarray], answers: Mapping[str, str], path: str
) -> Pulses:
    """Whether the joints are pulses, and of how many to a degree.

    Raises Undecided where that was not answered, InputError where the answer does not fit.
    """
    if found.questions or not found.joints:
        return Pulses(found)
    given = answers.get("pulses_per_deg")
    most = max(np.nanmax(np.abs(values(name)), initial=0.0) for name in found.joints)
    stated = any(is_pulse(name.unit) for name in found.joints)
    columns = f"{found.joints[0].column} .. {found.joints[-1].column}"
    if given is None and not stated and (found.joints[0].unit or most < _MOST_DEG):
        return Pulses(found)
    count = len(found.joints)
    if given is None:
        about = f"{columns} are pulses of the motors, and not said how many make a degree"
        example = ",".join("ABCDEFG"[:count])
        raise Undecided(path, [Choice("--pulses-per-deg", about, {example: "of each joint"})])
    try:
        per_deg = tuple(float(each) for each in given.split(","))
    except ValueError:
        per_deg = ()
    if len(per_deg) != count or 0.0 in per_deg or not np.isfinite(per_deg).all():
        raise InputError(
            Problem("--pulses-per-deg", repr(given), f"{count} numbers parted by commas, none 0")
        )
    return Pulses(found, per_deg, (f"{columns} are pulses, turned into degrees as answered",))
