"""Fig. 4: assessed accuracy against noise, one line per assessor, with the true accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style, truth

COLUMNS = ("assessor", "noise_mm", "mean_mm", "min_mm", "max_mm", "bias_mm", "repetitions")
UM_PER_MM = 1000.0


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``study_summary``, with the truth of ``assessment_points``."""
    return draw(inputs["study_summary"], **truth.known(inputs, settings))


def draw(
    summary: Mapping,
    *,
    true_accuracy_mm: float | None = None,
    taken_as_true: str | None = None,
    dataset: str | None = None,
) -> Figure:
    """Draw ``study_summary``: means joined by lines, bars from the smallest to the largest.

    ``true_accuracy_mm`` is the true accuracy; without it, it is taken from ``mean_mm - bias_mm``.
    ``taken_as_true``: footnote where the truth is not known; what the study took for it.
    Raises InputError where a column is missing.
    """
    style.require(summary, COLUMNS, "study_summary")
    table = pd.DataFrame({name: summary[name] for name in COLUMNS})
    table["noise_um"] = table["noise_mm"] * UM_PER_MM
    if true_accuracy_mm is None:
        true_accuracy_mm = float((table["mean_mm"] - table["bias_mm"]).median())
    looks = style.assessor_style(table["assessor"])
    levels = np.unique(table["noise_um"].dropna())
    step = float(np.diff(levels).min()) if levels.size > 1 else 50.0
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 2.7)
        ax = figure.subplots()
        labels = []
        for index, (name, (label, colour, marker)) in enumerate(looks.items()):
            rows = table[(table["assessor"] == name) & table["mean_mm"].notna()]
            rows = rows.sort_values("noise_um", kind="stable")
            if rows.empty:
                continue
            mean = rows["mean_mm"]
            below, above = (mean - rows["min_mm"]), (rows["max_mm"] - mean)
            ax.errorbar(
                rows["noise_um"] + (index - (len(looks) - 1) / 2) * 0.14 * step, mean,
                yerr=np.nan_to_num(np.clip([below, above], 0, None)), color=colour, marker=marker,
                ms=4, mec="white", mew=0.4, capsize=2, elinewidth=0.9, capthick=0.9, lw=1.1,
            )  # fmt: skip
            labels.append((mean.iloc[-1], fill(label, 13), colour))
        if np.isfinite(true_accuracy_mm):
            ax.axhline(true_accuracy_mm, **style.TRUTH, zorder=1)
            label = "“True” accuracy*" if taken_as_true else "True accuracy"
            labels.append((true_accuracy_mm, f"{label}\n{true_accuracy_mm:.3f} mm", style.INK))
        ax.set(xlabel="Noise, standard deviation per axis (µm)", ylabel="Assessed accuracy (mm)")
        ax.set_xticks(levels[:: max(-(-levels.size // 8), 1)])
        if levels.size:
            ax.set_xlim(levels[0] - 0.55 * step, levels[-1] + 0.55 * step)
        ax.margins(y=0.06)
        ax.grid(axis="x", visible=False)
        _label_lines(ax, labels)
        few, many = table["repetitions"].min(), table["repetitions"].max()
        span = f"{many:.0f}" if few == many else f"{few:.0f} to {many:.0f}"
        ax.set_title(f"Mean, smallest and largest of {span} simulations", loc="left",
                     color=style.MUTED, fontsize=style.SMALL_PT)  # fmt: skip
        if taken_as_true:
            figure.supxlabel(taken_as_true, fontsize=style.SMALL_PT, color=style.MUTED,
                             x=0.01, ha="left")  # fmt: skip
        style.name_dataset(figure, dataset)
    return figure


def _label_lines(ax: Axes, labels: list[tuple[float, str, str]]) -> None:
    """Name each line at its right end, moved apart where the names would overlap."""
    low, high = ax.get_ylim()
    heights = [(y - low) / (high - low) for y, _, _ in labels]
    lines = max((text.count("\n") + 1 for _, text, _ in labels), default=1)
    places = style.spread(heights, 0.02 + 0.052 * lines, 0.05, 0.95)
    for place, (_, text, colour) in zip(places, labels, strict=True):
        style.outside_label(ax, place, text, colour)
