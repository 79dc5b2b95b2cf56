"""The sentences on Fig. 3 under every reading of it: on what share of the arms each holds."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from kinacc.figures import style
from research.map_readings import READINGS, SENTENCES, Reading, shares

WORDS = {
    "map_nonlinear": "errors are\nhighly\nnonlinear",
    "map_largest_changes_location": "largest\nchange\ntheir place",
    "map_position_outer_reaches": "position:\noutside at\n0° and 60°",
    "map_position_less_predictable_inside": "position:\nless pre-\ndictable\n15° to 45°",
    "map_orientation_less_predictable": "orientation:\neven less\npredictable",
    "map_orientation_near_discontinuities": "orientation:\nnear dis-\ncontinuities",
    "map_discontinuities_at_wrist_changes": "these at\nwrist\nchanges",
}
FRAMES = {"slice": "turning with the slice", "base": "held in the robot's base"}
TURNS = {"signs_and_zero": "9 turns", "all_27": "27 turns"}
_ROW_IN, _GAP = 0.185, 0.8  # height of a row; free space between the two frames, in rows
_COUNTS_AT = tuple(len(SENTENCES) + np.array([0.0, 0.85, 1.55]))  # columns of the counts
_FORMS = ("{:.1f}", "{:.0f} %", "{:.0f}")
_DARK = 0.55  # shares above this are dark cells


def draw(table: pd.DataFrame, *, dataset: str | None = None) -> Figure:
    """Draw ``map_readings`` as a table of shares: a row per reading, a column per sentence."""
    found = shares(table)
    heights, place = [], 0.0
    for number, reading in enumerate(READINGS):
        new = number > 0 and reading.reference_frame != READINGS[number - 1].reference_frame
        place += 1.0 + _GAP * (number == 0) + (_GAP + 0.4) * new
        heights.append(place)
    with style.new_figure(style.DOUBLE_COLUMN_IN, 1.25 + _ROW_IN * heights[-1], dataset) as figure:
        ax = figure.subplots()
        for number, (reading, y) in enumerate(zip(READINGS, heights, strict=True)):
            _row(ax, y, reading, found.holds[number])
            counts = found.sentences[number], 100 * found.reached[number], found.arms[number]
            for x, value, form in zip(_COUNTS_AT, counts, _FORMS, strict=True):
                words = "–" if np.isnan(value) else form.format(value)
                ax.text(x, y, words, ha="center", va="center", fontsize=style.SMALL_PT)
            if number == 0 or READINGS[number - 1].reference_frame != reading.reference_frame:
                words = f"flange attitude {FRAMES[reading.reference_frame]}"
                ax.text(-2.35, y - 0.85, words, weight="bold", va="center", fontsize=style.SMALL_PT)
        heads = [WORDS[name] for name in SENTENCES]
        heads += ["sentences\nof 7\nthat hold", "combi-\nnations\nreached", "arms"]
        at = [*np.arange(len(SENTENCES)), *_COUNTS_AT]
        for x, words in zip(at, heads, strict=True):
            ax.text(x, -0.15, words, ha="center", va="bottom", fontsize=style.SMALL_PT)
        ax.set(xlim=(-2.4, _COUNTS_AT[-1] + 0.3), ylim=(heights[-1] + 0.55, -0.2))
        ax.axis("off")
        figure.supxlabel(
            "Share of arms on which a sentence of the paper holds; each reading has its own "
            "calibration plan and its own arms, none chosen by its maps.",
            fontsize=style.SMALL_PT, color=style.MUTED, x=0.01, ha="left",
        )  # fmt: skip
    return figure


def _row(ax: Axes, y: float, reading: Reading, values: np.ndarray) -> None:
    words = f"[{reading.orientation}], {TURNS[reading.rotations]}".replace("-", "−")
    ax.text(-0.6, y, words, ha="right", va="center", fontsize=style.SMALL_PT)
    for x, value in enumerate(values):
        if np.isnan(value):
            ax.text(x, y, "–", ha="center", va="center", fontsize=style.SMALL_PT)
            continue
        colour = colormaps["Blues"](0.9 * value)
        ax.add_patch(Rectangle((x - 0.48, y - 0.46), 0.96, 0.92, fc=colour, ec="none"))
        ax.text(
            x, y, f"{100 * value:.0f} %", ha="center", va="center", fontsize=style.SMALL_PT,
            color="white" if value > _DARK else style.INK,
        )  # fmt: skip
