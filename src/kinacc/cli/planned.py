"""What ``plan-poses`` is asked, and its answer as a sheet and in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from kinacc.cli import rows
from kinacc.cli.file_options import joint_answers
from kinacc.cli.plan_poses import MOST_CANDIDATES
from kinacc.cli.sheet import Field, Sheet
from kinacc.cli.spaces import inside_box, joint_ranges, ranges, settings_of, without_dataset
from kinacc.cli.tables import joint_fields
from kinacc.deployment.planning import Experiment, PosePlan, plan_poses, spread
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, compose
from kinacc.kinematics import robot as robots
from kinacc.kinematics.robot import Robot
from kinacc.measurements.table import numbers_of

INDEX = "geometric mean of the singular values over the root of the number of poses"
TRAVEL = "largest movement of a joint between poses, which sets the time of a move"


@dataclass(frozen=True)
class PoseTask:
    """Candidates (n, k) of reported joints with their labels, and what is wanted of them."""

    robot: Robot
    joints: np.ndarray
    label: np.ndarray
    experiment: Experiment
    count: int
    start: np.ndarray


def question(given: Mapping) -> PoseTask:
    """The question of the command's options. Raises InputError listing what is wrong."""
    if given["dataset"] is None and given["robot"] is None:
        raise InputError(Problem("ROBOT", "is not given", "a shipped name, a robot file"))
    if given["dataset"] is None:
        settings = without_dataset()
    else:
        settings = settings_of(given["dataset"], given["config"])
    robot = robots.load(given["robot"] or settings.robot)
    problems: list[Problem] = []
    tool = robots.carried(robot)
    if given["tool_mm"] is not None:
        offset = _numbers("--tool-mm", given["tool_mm"], 3, problems)
        tool = compose(robot.flange, Pose(np.eye(3), offset))
    hayati = settings.hayati_joints
    if given["hayati"] is not None:
        values = _numbers("--hayati", given["hayati"], None, problems)
        hayati = tuple(int(value) for value in values)
        if any(joint != value for joint, value in zip(hayati, values, strict=True)) or any(
            not 1 <= joint <= robot.dh.joints for joint in hayati
        ):
            problems.append(Problem("--hayati", given["hayati"], f"joints 1 to {robot.dh.joints}"))
    box = joint_ranges(given["joints_deg"], robot, problems) or settings.box
    space = ranges("--inside-mm", given["inside_mm"], 3, problems)
    start = np.zeros(robot.dh.joints)
    if given["from_deg"] is not None:
        start = rows.of_arguments((given["from_deg"],), "deg", robot, "--from-deg")[0]
    refuse(problems)
    experiment = Experiment(
        tool,
        orientation=not given["position_only"],
        frames_estimated=settings.frames_estimated and not given["frames_known"],
        hayati_joints=hayati,
        rotation_weight_mm_per_rad=settings.rotation_weight_mm_per_rad,
        threshold=given["threshold"],
    )
    if given["candidates"] is not None:
        file = rows.candidates(given["candidates"], robot, MOST_CANDIDATES, joint_answers(given))
        joints, label = file.joints, file.label
    else:
        inside = settings.inside if space is None else inside_box(space)
        joints = spread(robot, given["drawn"], box, inside, tool)
        label = np.arange(1, len(joints) + 1)
    return PoseTask(robot, joints, label, experiment, given["count"], start)


def answer(asked: PoseTask, progress: Callable | None = None) -> PosePlan:
    """Choose the poses and the order."""
    return plan_poses(
        asked.robot, asked.joints, asked.experiment, asked.count, asked.start, progress
    )


def as_sheet(asked: PoseTask, plan: PosePlan) -> Sheet:
    """One row per pose, in driving order."""
    facts = {
        "robot": asked.robot.name,
        "index": "O1",
        "index_meaning": INDEX,
        "value": plan.index[-1],
        "poses": asked.count,
        "candidates": len(asked.joints),
        "parameters": len(plan.information.names),
        "determined_directions": plan.information.rank,
        "undetermined": list(plan.information.left_open.sentences),
        "travel_metric": TRAVEL,
        "travel_deg": float(np.rad2deg(plan.moves_rad.sum())),
        "travel_unordered_deg": float(np.rad2deg(plan.candidate_travel_rad)),
    }
    fields = [
        Field("order", np.arange(1, len(plan.chosen) + 1), "", "order of driving"),
        *joint_fields(asked.robot.dh.prismatic, asked.joints[plan.chosen]),
        Field("move_deg", np.rad2deg(plan.moves_rad), "deg", TRAVEL),
        Field("candidate", asked.label[plan.chosen], "", "its pose or line among the candidates"),
    ]
    return Sheet(
        f"{asked.count} of {len(asked.joints)} poses of {asked.robot.name}, D-optimal",
        facts,
        fields,
    )


def in_words(plan: PosePlan) -> str:
    """The index, what no candidate determines, and the travel."""
    shown = plan.information
    lines = [
        f"O1 = {plan.index[-1]:.4g} after {plan.swaps} swaps ({INDEX})",
        f"{shown.rank} of {len(shown.names)} parameter directions are determined; the candidates "
        "leave open:",
        *(f"  - {line}" for line in shown.left_open.sentences),
        f"travel {np.rad2deg(plan.moves_rad.sum()):.0f} deg, "
        f"{np.rad2deg(plan.candidate_travel_rad):.0f} deg in the candidates' order ({TRAVEL})",
    ]
    if not len(shown.left_open.directions):
        lines[1] = f"all {shown.rank} parameters are determined"
    return "\n".join(lines)


def _numbers(option: str, text: str, count: int | None, problems: list[Problem]) -> np.ndarray:
    values = numbers_of(text)
    if not values.size or (count is not None and values.size != count):
        problems.append(Problem(option, repr(text), f"{count or 'some'} numbers, 1,2,3"))
        return np.zeros(count or 0)
    return values
