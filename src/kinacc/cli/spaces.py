"""Where poses may be drawn: ranges and boxes of options, and a data set's own space."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kinacc.calibration.dh_estimator import hayati_joints
from kinacc.cli.choice import CONFIG
from kinacc.config import schema
from kinacc.errors import InputError, Problem
from kinacc.kinematics import region
from kinacc.kinematics import robot as robots
from kinacc.study.evaluation import cylinder, joint_box
from kinacc.workflow.data_sets import read_data_sets

Ends = tuple[np.ndarray, np.ndarray]
Inside = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Settings:
    """Fitted parameters and region of a robot.

    ``box``: ends (k,), (k,) of the reported joints; ``inside`` tests positions (n, 3) of the tool.
    """

    robot: str | None
    frames_estimated: bool
    rotation_weight_mm_per_rad: float
    hayati_joints: tuple[int, ...]
    box: Ends | None = None
    inside: Inside | None = None


def without_dataset() -> Settings:
    """The settings of no data set: base and tool are unknown, else as the schema has them."""
    calibration = schema.defaults()["calibration"]
    hayati = tuple(calibration["dh"]["hayati_joints"])
    return Settings(None, True, calibration["rotation_weight_mm_per_rad"], hayati)


def settings_of(dataset: str, config: Sequence[str]) -> Settings:
    """The settings of a configured data set. Raises InputError."""
    datasets = read_data_sets(config or (CONFIG,)).settings
    if dataset not in datasets:
        what = f"{dataset!r} is not in the configuration"
        raise InputError(Problem("--dataset", what, ", ".join(datasets)))
    settings = datasets[dataset]
    robot, calibration = robots.load(settings["robot"]), settings["calibration"]
    evaluation = settings["evaluation"]
    known = Settings(
        settings["robot"],
        calibration["base_and_tool"] == "estimated",
        float(calibration["rotation_weight_mm_per_rad"]),
        tuple(hayati_joints(calibration["dh"], robot)),
    )
    if evaluation["space"] == "joint_box":
        return replace(known, box=joint_box(evaluation, robot))
    if evaluation["space"] == "cylinder":
        space = cylinder(evaluation)
        return replace(known, inside=lambda at_mm: np.asarray(region.contains(space, at_mm)))
    return known


def inside_box(space: Ends) -> Inside:
    """Test of positions (n, 3) for lying in a box (3,), (3,)."""
    low, high = space
    return lambda position_mm: np.all((position_mm >= low) & (position_mm <= high), axis=1)


def ranges(option: str, text: str | None, count: int, problems: list[Problem]) -> Ends | None:
    """Ends (count,), (count,) of a text such as "-90:90,-60:60"; None where there is none."""
    if text is None:
        return None
    allowed = f"{count} ranges low:high, apart by commas"
    try:
        pairs = [[float(end) for end in pair.split(":")] for pair in text.split(",")]
    except ValueError:
        pairs = []
    if len(pairs) != count or any(len(pair) != 2 or not pair[0] < pair[1] for pair in pairs):
        problems.append(Problem(option, repr(text), allowed))
        return None
    low, high = np.array(pairs).T
    return low, high


def joint_ranges(text: str | None, robot: robots.Robot, problems: list[Problem]) -> Ends | None:
    """Ends (k,), (k,) of ``--joints-deg`` in rad, mm where a joint slides; None where not given."""
    ends = ranges("--joints-deg", text, robot.dh.joints, problems)
    return ends and tuple(robots.in_own_units(robot, np.stack(ends)))
