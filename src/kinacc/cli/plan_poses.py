"""``kinacc plan-poses``: which poses to measure, and in which order to drive to them."""

from __future__ import annotations

from collections.abc import Mapping

import click

from kinacc.cli import choice
from kinacc.cli.choice import option
from kinacc.cli.file_options import joint_file_options
from kinacc.cli.output import answers
from kinacc.config import schema

_MOST_CANDIDATES = 100_000
_TRUNCATION = "calibration.dh.truncation"


@click.command("plan-poses")
@click.argument("robot", required=False)
@option("--poses", "count", default=40, type=click.IntRange(1, 2000), help="Number of poses.")
@option("--candidates", default="1000", metavar="FILE|N", help="File of joints, or number to draw.")
@joint_file_options
@option("--joints-deg", help='Ranges to draw from, e.g. "-90:90,-60:60,...". [limits]')
@option("--inside-mm", help='Tool positions to draw in the base: "x0:x1,y0:y1,z0:z1".')
@option("--dataset", help="Data set whose robot, fit and region are taken.")
@option("--config", multiple=True, help=f"Configuration. [{choice.CONFIG}]")
@option("--tool-mm", help="Measured point in the flange frame. [the robot's tool]")
@option("--position-only", is_flag=True, help="No measured orientations.")
@option("--frames-known", is_flag=True, help="No estimation of base and tool.")
@option("--hayati", help='Joints with a Hayati angle, e.g. "2,3".')
@option("--threshold", default=schema.key(_TRUNCATION)["default"],
        type=choice.values_of(_TRUNCATION),
        help="Least share of the best-determined direction.")  # fmt: skip
@option("--from-deg", help="Joints the arm starts at. [zero]")
@answers(table=True, picture="Index against number of poses: .svg, .png, .pdf.")
def plan_poses(out, robot, count, config, dataset, from_deg, **given) -> None:
    """Choose a D-optimal set of poses, in an order with little travel.

    ROBOT is a shipped name or a robot file (not needed with --dataset). Collisions and the view of
    the instrument are not known: leave such poses out of a file of candidates.

    \b
    Example:
      kinacc plan-poses ur10 --hayati 2,3 --poses 50 -o plan.csv --picture index.svg
      kinacc plan-poses --dataset mh180 --poses 60 --json
      kinacc plan-poses my_robot.yaml --candidates reachable.csv --position-only -o my_plan.csv
    """
    import numpy as np
    import pandas as pd

    from kinacc.cli import rows, spaces
    from kinacc.deployment import planning
    from kinacc.errors import InputError, Problem
    from kinacc.kinematics import robot as robots
    from kinacc.progress import reporting

    if dataset is None and robot is None:
        raise InputError(Problem("ROBOT", "is not given", "a shipped name, a robot file"))
    settings = spaces.settings_of(dataset, config) if dataset else spaces.without_dataset()
    arm = robots.load(robot or settings.robot)
    experiment, box, inside = _experiment(arm, settings, given)
    start = np.zeros(arm.dh.joints)
    if from_deg is not None:
        start = rows.of_arguments((from_deg,), "deg", arm, "--from-deg")[0]
    with reporting("plan-poses", bar=True):
        joints, label = _candidates(arm, given, box, inside, experiment)
        plan = planning.plan_poses(arm, joints, experiment, count, start)
    if out.picture is not None:
        from kinacc.figures import planned_poses

        out.draw(planned_poses.draw(plan.index, arm.name))
    table = pd.DataFrame({
        "order": np.arange(1, count + 1),
        **rows.joint_columns(arm.dh.prismatic, joints[plan.chosen]),
        "move_deg": np.rad2deg(plan.moves_rad),
        "candidate": label[plan.chosen],
    })  # fmt: skip
    facts = {
        "robot": arm.name,
        "index_o1": plan.index[-1],
        "poses": count,
        "candidates": len(joints),
        "parameters": plan.parameters,
        "determined_directions": plan.determined,
        "undetermined": plan.undetermined,
        "travel_deg": np.rad2deg(plan.moves_rad.sum()),
        "candidate_travel_deg": np.rad2deg(plan.candidate_travel_rad),
        "rows": table,
    }
    out.show(facts, table, [
        f"{arm.name}: {count} of {len(joints)} poses, O1 = {plan.index[-1]:.4g} (geometric mean of "
        "the singular values over the root of the number of poses).",
        f"Travel: {facts['travel_deg']:.0f} deg ({facts['candidate_travel_deg']:.0f} deg in the "
        "order of the candidates), by the joint that moves most.",
        f"Determined: {plan.determined} of {plan.parameters} parameters."
        + (" Undetermined:" if plan.undetermined else ""),
        *(f"  - {text}" for text in plan.undetermined),
    ])  # fmt: skip


def _experiment(arm, settings, given: Mapping):
    """What is measured and fitted, the joint box and the test of tool positions."""
    import numpy as np

    from kinacc.cli import spaces
    from kinacc.deployment.planning import Experiment
    from kinacc.errors import Problem, refuse
    from kinacc.geometry import Pose, compose
    from kinacc.kinematics import robot as robots
    from kinacc.measurements.table import numbers_of

    problems: list[Problem] = []
    tool, hayati = robots.carried(arm), settings.hayati_joints
    if given["tool_mm"] is not None:
        offset = numbers_of(given["tool_mm"])
        if len(offset) != 3:
            problems.append(Problem("--tool-mm", repr(given["tool_mm"]), "3 numbers, 1,2,3"))
        else:
            tool = compose(arm.flange, Pose(np.eye(3), offset))
    if given["hayati"] is not None:
        hayati = tuple(numbers_of(given["hayati"]))
        if not hayati or not set(hayati) <= set(range(1, arm.dh.joints + 1)):
            allowed = f"joints 1 to {arm.dh.joints}, 2,3"
            problems.append(Problem("--hayati", repr(given["hayati"]), allowed))
    box = spaces.joint_ranges(given["joints_deg"], arm, problems) or settings.box
    space = spaces.ranges("--inside-mm", given["inside_mm"], 3, problems)
    refuse(problems)
    experiment = Experiment(
        tool,
        orientation=not given["position_only"],
        frames_estimated=settings.frames_estimated and not given["frames_known"],
        hayati_joints=tuple(int(joint) for joint in hayati),
        rotation_weight_mm_per_rad=settings.rotation_weight_mm_per_rad,
        threshold=given["threshold"],
    )
    return experiment, box, settings.inside if space is None else spaces.inside_box(space)


def _candidates(arm, given: Mapping, box, inside, experiment):
    """Joints (n, k) of the file, or drawn, with their labels (n,)."""
    import numpy as np

    from kinacc.cli import rows
    from kinacc.cli.file_options import joint_answers
    from kinacc.deployment.planning import spread
    from kinacc.errors import InputError, Problem

    if not given["candidates"].isdecimal():
        answered = joint_answers(given)
        file = rows.candidates(given["candidates"], arm, _MOST_CANDIDATES, answered)
        return file.joints, file.label
    number = int(given["candidates"])
    if not 10 <= number <= _MOST_CANDIDATES:
        allowed = f"10 to {_MOST_CANDIDATES}, or a file"
        raise InputError(Problem("--candidates", f"{number}", allowed))
    return spread(arm, number, box, inside, experiment.tool), np.arange(1, number + 1)
