"""Fig. 2: the arm, drawn from its own kinematics, over the evaluation space."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from kinacc.errors import InputError, Problem
from kinacc.figures import style
from kinacc.kinematics import dh, tables
from kinacc.kinematics import robot as robots

JOINT_SHARE = 0.03  # of the reach: half the length of the thickest joint
LEGEND_IN = 0.34  # height below the axes
VIEW_DEG = (24.0, -58.0)  # elevation, azimuth
LINK, JOINT = "#f2a93b", "#5b6470"


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``dh_model`` among the ``assessment_points``.

    The tool centre point is the fitted one, or else the configured one.
    """
    robot = robots.load(settings["robot"])
    model = dh.DHModel.from_columns(inputs["dh_model"], robot.dh.prismatic)
    points, evaluation = inputs["assessment_points"], settings["evaluation"]
    reported = np.stack([points[f"q{i + 1}"] for i in range(model.joints)], axis=-1)
    own = robots.carried(robot)
    tool = tables.fitted_tool(inputs.get("frames"), "dh", own)
    configured_mm = own.position_mm + own.rotation @ np.asarray(evaluation["tool_mm"], float)
    return draw(
        model,
        robot.dh_joints(reported),
        tool_mm=configured_mm if tool is None else tool.position_mm,
        cylinder=evaluation["cylinder"] if evaluation["space"] == "cylinder" else None,
        measured=evaluation["space"] == "measured",
        dataset=settings.get("dataset"),
    )


def draw(
    model: dh.DHModel,
    q_rad: np.ndarray,
    *,
    tool_mm: np.ndarray | None = None,
    cylinder: Mapping[str, Any] | None = None,
    measured: bool = False,
    dataset: str | None = None,
) -> Figure:
    """Draw the operating points and the arm at the one nearest to their middle, in mm.

    ``q_rad`` (n, k) are the DH joint angles of the points, ``tool_mm`` (3,) the tool centre point
    in the flange frame; ``cylinder`` is the evaluation space as a sector about the axis of joint 1
    with ``inner_radius_mm``, ``radial_span_mm``, ``bottom_mm``, ``height_mm`` and ``angle_deg``
    (two values); ``measured``: the points are poses that were measured. Everything is in the robot
    base frame. Raises InputError without a point.
    """
    q_rad = q_rad[np.isfinite(q_rad).all(axis=1)]
    if not len(q_rad):
        raise InputError(Problem("assessment_points", "no point has joint angles", "at least one"))
    tool_mm = np.zeros(3) if tool_mm is None else tool_mm
    flange = dh.forward(model, q_rad)
    points_mm = flange.position_mm + flange.rotation @ tool_mm
    kind = "measured poses of the study" if measured else "operating points"
    legend: dict[str, Any] = {
        f"tool at {len(q_rad)} {kind}": Line2D(
            [], [], ls="", marker="o", ms=3, mew=0, color=style.BLUE
        ),
        "arm at a point in their middle": Patch(facecolor=LINK),
    }
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 3.2 + LEGEND_IN, arranged=False)
        ax: Axes3D = figure.add_axes((-0.04, 0.13, 1.04, 0.86), projection="3d")
        ax.computed_zorder = False
        ax.set_autoscale_on(False)
        ax.view_init(*VIEW_DEG)
        seen, middle = [points_mm, np.zeros((1, 3))], points_mm.mean(axis=0)
        if cylinder is not None:
            seen.append(_sector(ax, cylinder))
            middle = seen[-1].mean(axis=0)
            space = Patch(facecolor=style.SKY, alpha=0.4, edgecolor=style.BLUE)
            legend["evaluation space"] = space
        ax.scatter(*points_mm.T, s=2.0, c=style.BLUE, lw=0, depthshade=False, zorder=2)
        nearest = np.linalg.norm(points_mm - middle, axis=1).argmin()
        seen.append(_arm(ax, model, q_rad[nearest], tool_mm))
        every = np.concatenate(seen)
        _bar(ax, [[0, 0, every[:, 2].min()], [0, 0, 0]], style.MUTED, 0.8, ls=(0, (6, 2, 1, 2)))
        _frame_axes(ax, every)
        columns = len(legend) - 1
        figure.legend(legend.values(), legend.keys(), loc="lower left", ncols=columns)
        style.name_dataset(figure, dataset)
    return figure


def _arm(ax: Axes3D, model: dh.DHModel, q_rad: np.ndarray, tool_mm: np.ndarray) -> np.ndarray:
    """Draw links (along d, then along a) and joints (along their axes); return the frames."""
    frames = dh.chain(model, q_rad[None])
    rotation, origin = frames.rotation[0], frames.position_mm[0]
    reach = float(np.abs(model.a_mm).sum() + np.abs(model.d_mm).sum())
    tip = origin[-1] + rotation[-1] @ tool_mm
    _bar(ax, [origin[-1], tip], JOINT, 1.5)
    for i in range(model.joints):
        axis, thick = rotation[i][:, 2], 8.0 - 4.5 * i / model.joints
        _bar(ax, [origin[i], origin[i] + model.d_mm[i] * axis, origin[i + 1]], LINK, thick)
        half = JOINT_SHARE * reach * thick / 8.0 * axis
        _bar(ax, [origin[i] - half, origin[i] + half], JOINT, 1.3 * thick)
    return np.concatenate([origin, tip[None]])


def _bar(ax: Axes3D, points: list, colour: str, width_pt: float, **look: Any) -> None:
    look = look or {"solid_joinstyle": "round", "zorder": 3}
    ax.plot(*np.transpose(points), color=colour, lw=width_pt, **look)


def _sector(ax: Axes3D, cylinder: Mapping[str, Any]) -> np.ndarray:
    """Draw the evaluation space, translucent with firm edges; return its corner points."""
    inner, low = float(cylinder["inner_radius_mm"]), float(cylinder["bottom_mm"])
    outer, high = inner + cylinder["radial_span_mm"], low + cylinder["height_mm"]
    turn = np.radians(np.linspace(cylinder["angle_deg"][0], cylinder["angle_deg"][1], 31))
    corners = [(inner, low), (outer, low), (outer, high), (inner, high)]
    arcs = [
        np.stack([r * np.cos(turn), r * np.sin(turn), np.full(turn.size, h)], axis=-1)
        for r, h in corners
    ]
    walls = [np.concatenate([arcs[i - 1], arcs[i][::-1]]) for i in range(4) if inner > 0 or i]
    ends = [np.array([arc[end] for arc in arcs]) for end in (0, -1)]
    ax.add_collection3d(
        Poly3DCollection(walls + ends, facecolors=style.SKY, alpha=0.14, lw=0, zorder=1)
    )
    edges = arcs + [np.concatenate([end, end[:1]]) for end in ends]
    # Not as a 3D one: for the limits of the axes, which are set, matplotlib 3.9 wants lines alike.
    lines = Line3DCollection(edges, colors=style.BLUE, linewidths=0.9, zorder=4)
    ax.add_collection(lines, autolim=False)
    return np.concatenate(arcs)


def _frame_axes(ax: Axes3D, points: np.ndarray) -> None:
    """Set equal scales around everything drawn, and name the axes."""
    margin = 0.06 * np.ptp(points, axis=0).max()
    low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
    ax.set_box_aspect(high - low, zoom=0.9)
    ax.tick_params(pad=-2, labelsize=style.SMALL_PT)
    ax.tick_params(axis="z", pad=2)
    for name, axis, *ends in zip("xyz", (ax.xaxis, ax.yaxis, ax.zaxis), low, high, strict=True):
        getattr(ax, f"set_{name}lim")(ends)
        axis.set_label_text(f"{name} (mm)")
        axis.labelpad = 1 if name == "z" else -2
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
        axis._axinfo["grid"].update(color="#e3e3e3", linewidth=0.5)
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10], min_n_ticks=3))
