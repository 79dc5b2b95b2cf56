"""What ``plan-poses`` is asked, and its answer as a sheet, a picture and in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kinacc.calibration.blind_words import sentences
from kinacc.cli import rows
from kinacc.cli.file_options import joint_answers
from kinacc.cli.plan_poses import MOST_CANDIDATES
from kinacc.cli.sheet import Field, Sheet
from kinacc.cli.spaces import inside_box, joint_ranges, ranges, settings_of, without_dataset
from kinacc.cli.tables import joint_fields
from kinacc.deployment.planning import candidates, exchange, observability, travel
from kinacc.deployment.planning.information import Experiment, Information, information
from kinacc.errors import InputError, Problem, refuse
from kinacc.geometry import Pose, compose
from kinacc.kinematics import robot as robots
from kinacc.kinematics.inverse.limits import travel_unit
from kinacc.kinematics.robot import Robot
from kinacc.measurements.table import numbers_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RANDOM_SETS, _SIZES = 40, 9
_SEED = 0


@dataclass(frozen=True)
class PoseTask:
    """Candidates (n, k) of reported joints with their labels, and what is wanted of them."""

    robot: Robot
    joints: np.ndarray
    label: np.ndarray
    experiment: Experiment
    count: int
    index: str
    metric: str
    start: np.ndarray


@dataclass(frozen=True)
class PosePlan:
    """The poses in driving order (N,), rows of the candidates; ``moves`` (N,) leads to each."""

    information: Information
    plan: exchange.ChosenPoses
    order: np.ndarray
    moves: np.ndarray
    unordered: float


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
        joints = candidates.spread(robot, given["drawn"], box, inside, tool)
        label = np.arange(1, len(joints) + 1)
    return PoseTask(
        robot, joints, label, experiment, given["count"], given["index"], given["metric"], start
    )


def answer(asked: PoseTask, progress: Callable | None = None) -> PosePlan:
    """Choose the poses and the order."""
    told = information(asked.robot, asked.joints, asked.experiment)
    if told.rank == 0:
        raise InputError(Problem("candidates", "show no direction at all"))
    plan = exchange.choose(told.rows, asked.count, asked.index, progress)
    chosen = np.sort(plan.chosen)
    places = np.concatenate([asked.start[None], asked.joints[chosen]]) / travel_unit(asked.robot)
    distance = travel.distances(places, asked.metric)
    path = travel.order(distance)
    moves = distance[path[:-1], path[1:]]
    plain = travel.length(distance, np.arange(len(path)))
    return PosePlan(told, plan, chosen[path[1:] - 1], moves, plain)


def as_sheet(asked: PoseTask, found: PosePlan) -> Sheet:
    """One row per pose, in driving order."""
    facts = {
        "robot": asked.robot.name,
        "index": asked.index,
        "index_meaning": observability.INDICES[asked.index],
        "value": found.plan.value,
        "poses": asked.count,
        "candidates": len(asked.joints),
        "parameters": len(found.information.names),
        "determined_directions": found.information.rank,
        "undetermined": list(sentences(found.information.left_open)),
        "travel_metric": travel.METRICS[asked.metric],
        "travel_deg": float(np.rad2deg(found.moves.sum())),
        "travel_unordered_deg": float(np.rad2deg(found.unordered)),
    }
    fields = [
        Field("order", np.arange(1, len(found.order) + 1), "", "order of driving"),
        *joint_fields(asked.robot.dh.prismatic, asked.joints[found.order]),
        Field("move_deg", np.rad2deg(found.moves), "deg", travel.METRICS[asked.metric]),
        Field("candidate", asked.label[found.order], "", "its pose or line among the candidates"),
    ]
    title = f"{asked.count} of {len(asked.joints)} poses of {asked.robot.name} by {asked.index}"
    return Sheet(title, facts, fields)


def in_words(asked: PoseTask, found: PosePlan) -> str:
    """What was reached, and what no candidate can tell."""
    told, plan = found.information, found.plan
    lines = [
        f"{asked.index} = {plan.value:.4g} ({observability.INDICES[asked.index]}), "
        f"{plan.path[-1]:.4g} before {plan.swaps} swaps; no single swap makes it better",
        f"{told.rank} of {len(told.names)} parameter directions are determined; the candidates "
        "leave open:",
        *(f"  - {words}" for words in sentences(told.left_open)),
        f"travel {np.rad2deg(found.moves.sum()):.0f} deg, {np.rad2deg(found.unordered):.0f} deg in "
        f"the order of the candidates ({travel.METRICS[asked.metric]})",
    ]
    if not told.left_open.groups:
        lines[1] = f"all {told.rank} parameters are determined"
    return "\n".join(lines)


def drawn(asked: PoseTask, found: PosePlan, progress: Callable | None = None) -> Figure:
    """Index against number of poses, with random sets beside it."""
    from kinacc.figures import planned_poses

    rows_, index = found.information.rows, asked.index
    least = -(-found.information.rank // rows_.shape[1])
    most = min(max(asked.count, least + 1), len(rows_))
    counts = np.unique(np.linspace(least, most, _SIZES).astype(int))
    sizes = progress(counts, "numbers of poses compared") if progress else counts
    chosen = np.array(
        [
            found.plan.value if size == asked.count else exchange.choose(rows_, int(size), index)[1]
            for size in sizes
        ]
    )
    random = exchange.random_sets(rows_, counts, index, _RANDOM_SETS, _SEED)
    meaning = observability.INDICES[index]
    return planned_poses.draw(counts, chosen, random, asked.count, index, meaning, asked.robot.name)


def _numbers(option: str, text: str, count: int | None, problems: list[Problem]) -> np.ndarray:
    values = numbers_of(text)
    if not values.size or (count is not None and values.size != count):
        problems.append(Problem(option, repr(text), f"{count or 'some'} numbers, 1,2,3"))
        return np.zeros(count or 0)
    return values
