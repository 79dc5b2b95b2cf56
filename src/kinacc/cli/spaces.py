"""Where poses may be drawn: ranges of joints and a box of the tool, as options give them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kinacc.cli.choice import Options
from kinacc.errors import input_error
from kinacc.kinematics import robot as robots

Ends = tuple[np.ndarray, np.ndarray]
# Ends (k,), (k,) of the reported joints, and a test of positions (n, 3) of the tool.
Space = tuple[Ends | None, Callable[[np.ndarray], np.ndarray] | None]


def of_options(options: Options, robot: robots.Robot) -> Space:
    """The space of ``--joints-deg`` and ``--inside-mm``. Raises InputError."""
    joints = _ranges("--joints-deg", options["joints_deg"], robot.dh.joints)
    box = _ranges("--inside-mm", options["inside_mm"], 3)
    ends = None if joints is None else tuple(robots.in_own_units(robot, joints))
    if box is None:
        return ends, None
    low, high = box
    return ends, lambda at_mm: np.all((at_mm >= low) & (at_mm <= high), axis=1)


def _ranges(option: str, text: str | None, count: int) -> np.ndarray | None:
    """Ends (2, count) of a text such as "-90:90,-60:60"; None where there is none."""
    if text is None:
        return None
    try:
        ends = np.array([pair.split(":") for pair in text.split(",")], dtype=float).T
    except ValueError:
        ends = np.empty(0)
    if ends.shape != (2, count) or not (ends[0] < ends[1]).all():
        raise input_error(option, repr(text), f"{count} ranges low:high, apart by commas")
    return ends
