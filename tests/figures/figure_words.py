"""The six figures drawn from the golden tables of the MH180, and the words found in a figure."""

from __future__ import annotations

import numpy as np
import shared_data
from matplotlib.figure import Figure
from matplotlib.text import Text

from kinacc.config.schema import defaults
from kinacc.figures import save
from kinacc.figures.paper import draw_figure
from kinacc.tables import store

RESULTS = shared_data.RESULTS / "mh180"
NAMES = ("fig1", "fig2", "fig3", "fig4", "fig5", "fig6")


def figures(dataset: str, names=NAMES) -> dict[str, Figure]:
    """Each figure as its stage draws it."""
    tables = {path.stem: store.read(path) for path in RESULTS.glob("*.parquet")}
    settings = defaults() | {"dataset": dataset, "robot": "mh180"}
    return {name: draw_figure(name, tables, settings) for name in names}


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


def problems(figure: Figure, slack_pt: float = 1.0) -> list[str]:
    """Name the texts that leave the figure or run into one another."""
    scale, found = 72 / figure.dpi, []
    known = [(t.get_text(), t.get_window_extent().extents * scale) for t in words(figure)]
    inside = np.array([0.0, 0.0, *figure.get_size_inches() * 72])
    for index, (text, box) in enumerate(known):
        if np.any((box - inside) * [-1, -1, 1, 1] > slack_pt):
            found.append(f"{text!r} leaves the figure")
        for other, beside in known[index + 1 :]:
            low, high = np.maximum(box[:2], beside[:2]), np.minimum(box[2:], beside[2:])
            if np.all(high - low > slack_pt):
                found.append(f"{text!r} overlaps {other!r}")
    return found
