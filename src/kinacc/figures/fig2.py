"""Fig. 2: the arm, drawn from its own kinematics, over the evaluation space."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from kinacc.errors import InputError, Problem
from kinacc.figures import style
from kinacc.figures.columns import floats
from kinacc.kinematics import dh, tables
from kinacc.kinematics import robot as robots

JOINT_SHARE = 0.03  # of the reach: half the length of the thickest joint
LEGEND_IN = 0.34  # height of the legend below the axes
VIEW_DEG = (24.0, -58.0)  # elevation, azimuth
LINK, JOINT = "#f2a93b", "#5b6470"


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``dh_model`` among the ``assessment_points``."""
    robot = robots.load(settings["robot"])
    model = dh.DHModel.from_columns(inputs["dh_model"], robot.dh.prismatic)
    points = inputs["assessment_points"]
    reported = np.stack([floats(points, f"q{i + 1}") for i in range(model.joints)], axis=-1)
    evaluation = settings["evaluation"]
    return draw(
        model,
        robot.dh_joints(reported),
        tool_mm=_tool_mm(inputs.get("frames"), evaluation, robot),
        cylinder=evaluation["cylinder"] if evaluation["space"] == "cylinder" else None,
        measured=evaluation["space"] == "measured",
        dataset=settings.get("dataset"),
    )


def _tool_mm(
    frames: dict[str, np.ndarray] | None, evaluation: Mapping, robot: robots.Robot
) -> np.ndarray:
    """Return the tool centre point in the last DH frame: the fitted one, or the configured one."""
    own = robots.carried(robot)
    fitted = tables.fitted_tool(frames, "dh", own)
    if fitted is not None:
        return fitted.position_mm
    offset = np.asarray(evaluation["tool_mm"], dtype=float)
    return own.position_mm + own.rotation @ offset


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
    q_rad = np.atleast_2d(np.asarray(q_rad, dtype=float))
    q_rad = q_rad[np.isfinite(q_rad).all(axis=1)]
    if not len(q_rad):
        raise InputError(Problem("assessment_points", "no point has joint angles", "at least one"))
    tool_mm = np.zeros(3) if tool_mm is None else np.asarray(tool_mm, dtype=float)
    flange = dh.forward(model, q_rad)
    points_mm = flange.position_mm + flange.rotation @ tool_mm
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 3.2 + LEGEND_IN, arranged=False)
        ax: Axes3D = figure.add_axes((-0.06, 0.03, 1.06, 1.0), projection="3d")
        ax.computed_zorder = False
        ax.set_autoscale_on(False)
        ax.view_init(*VIEW_DEG)
        middle = points_mm.mean(axis=0)
        seen = [points_mm, np.zeros((1, 3))]
        if cylinder is not None:
            seen.append(_sector(ax, cylinder))
            middle = seen[-1].mean(axis=0)
        ax.scatter(*points_mm.T, s=2.0, c=style.BLUE, lw=0, depthshade=False, zorder=2)
        posture = q_rad[np.linalg.norm(points_mm - middle, axis=1).argmin()]
        seen.append(_arm(ax, model, posture, tool_mm))
        _first_axis(ax, min(part[:, 2].min() for part in seen))
        _frame_axes(ax, np.concatenate(seen))
        _fill(figure, ax, top_in=0.2 if dataset else 0.04, foot_in=LEGEND_IN)
        _legend(figure, len(points_mm), measured, cylinder is not None)
        style.name_dataset(figure, dataset)
    return figure


def _legend(figure: Figure, points: int, measured: bool, space: bool) -> None:
    """Say below the axes what is drawn."""
    what = "measured poses of the study" if measured else "operating points"
    handles: list[Any] = [
        Line2D([], [], ls="", marker="o", ms=3.0, mew=0, color=style.BLUE),
        Patch(facecolor=LINK),
    ]
    names = [f"tool at {points} {what}", "arm at a point in their middle"]
    if space:
        handles.append(Patch(facecolor=style.SKY, alpha=0.4, edgecolor=style.BLUE))
        names.append("evaluation space")
    figure.legend(handles, names, loc="lower left", ncols=2 if space else 1)


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


def _bar(ax: Axes3D, points: list[np.ndarray], colour: str, width_pt: float) -> None:
    ax.plot(*np.transpose(points), color=colour, lw=width_pt, solid_joinstyle="round", zorder=3)


def _first_axis(ax: Axes3D, lowest_mm: float) -> None:
    """Draw the axis of joint 1 from the base frame down to the level of what is lowest."""
    ax.plot([0, 0], [0, 0], [lowest_mm, 0], color=style.MUTED, lw=0.8, ls=(0, (6, 2, 1, 2)))


def _sector(ax: Axes3D, cylinder: Mapping[str, Any]) -> np.ndarray:
    """Draw the evaluation space, translucent with firm edges; return its corner points."""
    inner = float(cylinder["inner_radius_mm"])
    outer = inner + float(cylinder["radial_span_mm"])
    low = float(cylinder["bottom_mm"])
    high = low + float(cylinder["height_mm"])
    first_deg, last_deg = cylinder["angle_deg"]
    turn = np.radians(np.linspace(float(first_deg), float(last_deg), 31))

    arcs = {
        (r, h): np.stack([r * np.cos(turn), r * np.sin(turn), np.full(turn.size, h)], axis=-1)
        for r in (inner, outer)
        for h in (low, high)
    }
    sides = [((r, low), (r, high)) for r in (inner, outer) if r > 0]
    sides += [((inner, h), (outer, h)) for h in (low, high)]
    walls = [np.concatenate([arcs[one], arcs[other][::-1]]) for one, other in sides]
    round_ = [(inner, low), (outer, low), (outer, high), (inner, high)]
    ends = [np.array([arcs[each][end] for each in round_]) for end in (0, -1)]
    ax.add_collection3d(
        Poly3DCollection(walls + ends, facecolors=style.SKY, alpha=0.14, lw=0, zorder=1)
    )
    edges = [*arcs.values(), *(np.concatenate([each, each[:1]]) for each in ends)]
    # Not as a 3D one: for the limits of the axes, which are set, matplotlib 3.9 wants lines alike.
    lines = Line3DCollection(edges, colors=style.BLUE, linewidths=0.9, zorder=4)
    ax.add_collection(lines, autolim=False)
    return np.concatenate(list(arcs.values()))


def _frame_axes(ax: Axes3D, points: np.ndarray) -> None:
    """Set equal scales around everything drawn, and name the axes."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.06 * (high - low).max()
    low, high = low - margin, high + margin
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low, zoom=1.0)
    ax.set_xlabel("x (mm)", labelpad=-2)
    ax.set_ylabel("y (mm)", labelpad=-2)
    ax.set_zlabel("z (mm)", labelpad=1)
    ax.tick_params(pad=-2, labelsize=style.SMALL_PT)
    ax.tick_params(axis="z", pad=2)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
        axis._axinfo["grid"].update(color="#e3e3e3", linewidth=0.5)
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10], min_n_ticks=3))


def _fill(
    figure: Figure, ax: Axes3D, top_in: float, foot_in: float, margin_in: float = 0.04
) -> None:
    """Scale and move the axes until what they draw just fills the figure.

    Text keeps its size while the axes grow, so one step does not suffice; two do.
    """
    size = np.array(figure.get_size_inches())
    low, high = np.array([margin_in, foot_in]) / size, 1 - np.array([margin_in, top_in]) / size
    for _ in range(2):
        figure.draw_without_rendering()
        drawn = _drawn(figure, ax)
        place = ax.get_position(original=True)
        scale = float(min((high - low) / np.array([drawn.width, drawn.height])))
        shift = (low + high) / 2 - scale * np.array([drawn.x0 + drawn.x1, drawn.y0 + drawn.y1]) / 2
        x, y = scale * np.array([place.x0, place.y0]) + shift
        ax.set_position((x, y, scale * place.width, scale * place.height))


def _drawn(figure: Figure, ax: Axes3D) -> Bbox:
    """Return what the box of the axes and its words cover, in figure fractions."""
    corners = np.array(list(product(ax.get_xlim(), ax.get_ylim(), ax.get_zlim())))
    flat = np.array(proj3d.proj_transform(*corners.T, ax.get_proj())[:2]).T
    box = Bbox.null()
    box.update_from_data_xy(ax.transData.transform(flat))
    words = [axis.get_tightbbox() for axis in (ax.xaxis, ax.yaxis, ax.zaxis)]
    return Bbox.union([box, *words]).transformed(figure.transFigure.inverted())
