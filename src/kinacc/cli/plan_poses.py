"""``kinacc plan-poses``: which poses to measure, and in which order to drive to them."""

from __future__ import annotations

from functools import partial
from typing import Any

import click
import numpy as np
import pandas as pd

from kinacc.calibration.dh_estimator import hayati_joints
from kinacc.cli import choice, rows, spaces
from kinacc.cli.choice import option
from kinacc.cli.output import Output, answers
from kinacc.config import schema
from kinacc.deployment import planning
from kinacc.geometry import Pose, compose
from kinacc.kinematics import robot as robots
from kinacc.measurements.rows import joint_columns
from kinacc.progress import reporting
from kinacc.report.rendering import lines

_MOST_CANDIDATES = 100_000


@click.command("plan-poses")
@click.argument("robot")
@option("--poses", "count", default=40, type=click.IntRange(1, 2000), help="Number of poses.")
@option("--candidates", default="1000", metavar="FILE|N", help="File of joints, or number to draw.")
@choice.joint_file_options
@option("--joints-deg", help='Ranges of joints to draw, e.g. "-90:90,-60:60,...". [limits]')
@choice.INSIDE
@option("--tool-mm", help="Measured point in the flange frame. [the robot's tool]")
@option("--position-only", is_flag=True, help="No measured orientations.")
@answers(table=True, picture="Index against number of poses: .svg, .png, .pdf.")
def plan_poses(robot: str, count: int, out: Output, **options: Any) -> None:
    """Choose a D-optimal set of poses, in an order with little travel.

    ROBOT is a shipped name or a robot file. Collisions and the view of the instrument are not
    known: leave such poses out of a file of candidates.

    \b
    Example:
      kinacc plan-poses ur10 --poses 50 -o plan.csv --picture index.svg
    """
    arm = robots.load(robot)
    calibration, tool = schema.defaults()["calibration"], robots.carried(arm)
    if options["tool_mm"] is not None:
        offset_mm = rows.numbers_given("--tool-mm", options["tool_mm"], 3)
        tool = compose(arm.flange, Pose(np.eye(3), offset_mm))
    experiment = planning.Experiment(
        tool,
        orientation=not options["position_only"],
        hayati_joints=hayati_joints(calibration["dh"], arm),
        rotation_weight_mm_per_rad=float(calibration["rotation_weight_mm_per_rad"]),
        threshold=calibration["dh"]["truncation"],
    )
    with reporting("plan-poses"):
        box, inside = spaces.of_options(options, arm)
        draw = partial(planning.spread, arm, box_rad=box, inside=inside, tool=tool)
        candidates, joints = rows.candidates(options, arm, _MOST_CANDIDATES, draw)
        plan = planning.plan_poses(arm, joints, experiment, count, np.zeros(arm.dh.joints))
    if out.picture is not None:
        from kinacc.figures.campaign import draw_observability

        out.draw(draw_observability(plan.index, arm.name))
    table = pd.DataFrame({
        "order": np.arange(1, count + 1),
        **joint_columns(arm.dh.prismatic, joints[plan.chosen]),
        "move_deg": np.rad2deg(plan.moves_rad),
        "candidate": candidates.label[plan.chosen],
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
    out.show(facts, table, lines("plan_poses.txt", **facts))
