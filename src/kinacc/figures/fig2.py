"""Fig. 2: the arm, drawn from its own kinematics, over the evaluation space."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from kinacc.calibration.summary import reported_joints
from kinacc.config.error_models import PLAINEST
from kinacc.config.records import Settings
from kinacc.figures import style
from kinacc.kinematics import dh
from kinacc.kinematics import robot as robots
from kinacc.kinematics.region import Cylinder
from kinacc.study.evaluation import cylinder, equipped
from kinacc.tables.columns import Tables

VIEW_DEG = (24.0, -58.0)  # elevation, azimuth
LINK, JOINT = "#f2a93b", "#5b6470"
_HALF_JOINT = 0.03  # of the reach


def run(inputs: Tables, settings: Settings) -> Figure:
    """Return the figure of the ``dh_model`` among the ``assessment_points``.

    The tool centre point is the fitted one, or else the configured one.
    """
    robot, evaluation = robots.load(settings["robot"]), settings["evaluation"]
    model = dh.DHModel.from_columns(inputs["dh_model"], robot.dh)
    tool = equipped(inputs, evaluation, robot)[PLAINEST].tool
    reported = reported_joints(inputs["assessment_points"], model.joints)
    return draw(
        model,
        robot.dh_joints(reported),
        tool_mm=tool.position_mm,
        space=cylinder(evaluation) if evaluation["space"] == "cylinder" else None,
        measured=evaluation["space"] == "measured",
        dataset=settings.get("dataset"),
    )


def draw(
    model: dh.DHModel,
    q_rad: np.ndarray,
    *,
    tool_mm: np.ndarray,
    space: Cylinder | None = None,
    measured: bool = False,
    dataset: str | None = None,
) -> Figure:
    """Draw the operating points and the arm at the one nearest to their middle, in mm.

    ``q_rad`` (n, k) are the DH joint angles of the points, ``tool_mm`` (3,) the tool centre point
    in the flange frame; ``space`` is the evaluation space; ``measured``: the points are poses that
    were measured. Everything is in the robot base frame.
    """
    q_rad = q_rad[np.isfinite(q_rad).all(axis=1)]
    flange = dh.forward(model, q_rad)
    points_mm = flange.position_mm + flange.rotation @ tool_mm
    edges = [] if space is None else _edges(space)
    middle = np.concatenate(edges or [points_mm]).mean(axis=0)
    nearest = np.linalg.norm(points_mm - middle, axis=1).argmin()
    kind = "measured poses of the study" if measured else "operating points"
    with style.new_figure(style.SINGLE_COLUMN_IN, 3.5, dataset, arranged=False) as figure:
        place = (-0.04, 0.17, 1.0, 0.83)
        ax: Axes3D = figure.add_axes(place, projection="3d", computed_zorder=False)
        ax.view_init(*VIEW_DEG)
        ax.scatter(*points_mm.T, s=2.0, lw=0, c=style.BLUE, depthshade=False,
                   label=f"tool at {len(q_rad)} {kind}")  # fmt: skip
        _arm(ax, model, q_rad[nearest], tool_mm)
        for edge in edges:
            ax.plot(*edge.T, color=style.SKY, lw=0.9, zorder=1)
        if edges:
            ax.lines[-1].set_label("evaluation space")
        ax.set_aspect("equal")
        ax.locator_params(nbins=5)
        ax.tick_params(pad=-2)
        for name in "xyz":
            getattr(ax, f"set_{name}label")(f"{name} (mm)", labelpad=-1)
        figure.legend(loc="lower left", ncols=2)
    return figure


def _arm(ax: Axes3D, model: dh.DHModel, q_rad: np.ndarray, tool_mm: np.ndarray) -> None:
    """Draw links (along d, then along a) and joints (along their axes)."""
    frames = dh.chain(model, q_rad[None])
    rotation, origin = frames.rotation[0], frames.position_mm[0]
    axes = rotation[:-1, :, 2]
    corners = origin[:-1] + model.d_mm[:, None] * axes
    path = np.stack([origin[:-1], corners], axis=1).reshape(-1, 3)
    links = np.concatenate([path, [origin[-1]]])
    look = {"color": LINK, "lw": 5.0, "solid_capstyle": "butt", "zorder": 3}
    ax.plot(*links.T, **look, label="arm at a point in their middle")
    ax.plot(*np.stack([origin[-1], origin[-1] + rotation[-1] @ tool_mm], axis=1), color=JOINT)
    half = _HALF_JOINT * (np.abs(model.a_mm).sum() + np.abs(model.d_mm).sum()) * axes
    for low, high in zip(origin[:-1] - half, origin[:-1] + half, strict=True):
        ax.plot(*np.stack([low, high], axis=1), color=JOINT, lw=8.0, solid_capstyle="butt",
                zorder=4)  # fmt: skip


def _edges(space: Cylinder) -> list[np.ndarray]:
    """Edges of the evaluation space: four arcs and two ends."""
    turn = np.linspace(space.angle_min_rad, space.angle_max_rad, 31)
    inner, outer = space.inner_radius_mm, space.outer_radius_mm
    low, high = space.bottom_mm, space.top_mm
    corners = [(inner, low), (outer, low), (outer, high), (inner, high)]
    arcs = [
        np.stack([r * np.cos(turn), r * np.sin(turn), np.full(turn.size, h)], axis=-1)
        for r, h in corners
    ]
    return arcs + [np.array([*(arc[end] for arc in arcs), arcs[0][end]]) for end in (0, -1)]
