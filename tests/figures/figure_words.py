"""The six figures drawn from plausible tables, and the words found in a figure."""

from __future__ import annotations

import figure_tables as tables
import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text

from kinacc.figures import fig1, fig2, fig3, fig4, iterations, save
from kinacc.kinematics import robot

CYLINDER = {
    "inner_radius_mm": 1200.0,
    "radial_span_mm": 900.0,
    "bottom_mm": 0.0,
    "height_mm": 500.0,
    "angle_deg": [0.0, 60.0],
}


def figures(dataset: str | None = None) -> dict[str, Figure]:
    """Draw each figure once."""
    arm = robot.load("mh180").dh
    return {
        "fig1": fig1.draw(dataset=dataset),
        "fig2": fig2.draw(arm, tables.joint_angles(), cylinder=CYLINDER, dataset=dataset),
        "fig3": fig3.draw(tables.accuracy_map(), dataset=dataset),
        "fig4": fig4.draw(tables.study_summary(), dataset=dataset),
        "fig5": iterations.draw(
            tables.history(0.834, seed=0),
            example="rejected",
            true_accuracy_mm=tables.TRUE_MM,
            dataset=dataset,
        ),
        "fig6": iterations.draw(
            tables.history(1.023, seed=5, example="not_rejected"),
            example="not_rejected",
            true_accuracy_mm=tables.TRUE_MM,
            dataset=dataset,
        ),
    }


def words(figure: Figure) -> list[Text]:
    """Return every text that a reader sees, after the layout has settled."""
    save.settle(figure)
    figure.draw_without_rendering()
    hidden: set[int] = set()
    for axes in figure.axes:
        for axis in axes._axis_map.values():
            # Labels of ticks outside the range keep stale places, and so do all those of 3-D axes.
            drawn = set() if axes.name == "3d" else {id(tick) for tick in axis._update_ticks()}
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if id(tick) not in drawn:
                    hidden |= {id(tick.label1), id(tick.label2)}
    return [
        text
        for text in figure.findobj(Text)
        if text.get_text().strip() and text.get_visible() and id(text) not in hidden
    ]


def said(figure: Figure) -> str:
    """Return all words of a figure as one text."""
    return "\n".join(text.get_text() for text in words(figure))


def boxes(figure: Figure) -> list[tuple[str, np.ndarray]]:
    """Return each text with its box (left, bottom, right, top) in points."""
    scale = 72 / figure.dpi
    return [(t.get_text(), t.get_window_extent().extents * scale) for t in words(figure)]


def problems(figure: Figure, slack_pt: float = 1.0) -> list[str]:
    """Name the texts that leave the figure or run into one another."""
    found, known = [], boxes(figure)
    width, height = figure.get_size_inches() * 72
    for index, (text, (x0, y0, x1, y1)) in enumerate(known):
        if min(x0, y0) < -slack_pt or x1 > width + slack_pt or y1 > height + slack_pt:
            found.append(f"{text!r} leaves the figure")
        for other, (u0, v0, u1, v1) in known[index + 1 :]:
            if min(x1, u1) - max(x0, u0) > slack_pt and min(y1, v1) - max(y0, v0) > slack_pt:
                found.append(f"{text!r} overlaps {other!r}")
    return found
