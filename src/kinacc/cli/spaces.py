"""Where poses may be drawn: ranges and boxes of options, and a data set's own space."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from kinacc.cli.choice import CONFIG
from kinacc.errors import InputError, Problem, refuse
from kinacc.kinematics import region
from kinacc.kinematics import robot as robots
from kinacc.study.evaluation import cylinder
from kinacc.workflow.data_sets import read_data_sets

Ends = tuple[np.ndarray, np.ndarray]
# Ends (k,), (k,) of the reported joints, and a test of positions (n, 3) of the tool.
Space = tuple[Ends | None, Callable[[np.ndarray], np.ndarray] | None]


def settings_of(dataset: str, config: Sequence[str]) -> Mapping[str, Any]:
    """The settings of a configured data set. Raises InputError."""
    datasets = read_data_sets(config or (CONFIG,)).settings
    if dataset not in datasets:
        what = f"{dataset!r} is not in the configuration"
        raise InputError(Problem("--dataset", what, ", ".join(datasets)))
    return datasets[dataset]


def configured(settings: Mapping[str, Any], robot: robots.Robot) -> Space:
    """The evaluation space of a data set."""
    evaluation = settings["evaluation"]
    if evaluation["space"] == "cylinder":
        space = cylinder(evaluation)
        return None, lambda at_mm: np.asarray(region.contains(space, at_mm))
    return None, None


def of_options(options: Mapping[str, Any], robot: robots.Robot) -> Space:
    """The space of ``--joints-deg`` and ``--inside-mm``. Raises InputError."""
    problems: list[Problem] = []
    joints = _ranges("--joints-deg", options["joints_deg"], robot.dh.joints, problems)
    box = _ranges("--inside-mm", options["inside_mm"], 3, problems)
    refuse(problems)
    ends = None if joints is None else tuple(robots.in_own_units(robot, joints))
    if box is None:
        return ends, None
    low, high = box
    return ends, lambda at_mm: np.all((at_mm >= low) & (at_mm <= high), axis=1)


def _ranges(
    option: str, text: str | None, count: int, problems: list[Problem]
) -> np.ndarray | None:
    """Ends (2, count) of a text such as "-90:90,-60:60"; None where there is none."""
    if text is None:
        return None
    try:
        ends = np.array([pair.split(":") for pair in text.split(",")], dtype=float).T
    except ValueError:
        ends = np.empty(0)
    if ends.shape != (2, count) or not (ends[0] < ends[1]).all():
        problems.append(Problem(option, repr(text), f"{count} ranges low:high, apart by commas"))
        return None
    return ends
