"""Fig. 4: assessed accuracy against noise, one line per assessor, with the true accuracy."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from kinacc.figures import style, truth

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
    """
    table = pd.DataFrame(dict(summary)).sort_values("noise_mm", kind="stable")
    table["noise_um"] = table["noise_mm"] * UM_PER_MM
    if true_accuracy_mm is None:
        true_accuracy_mm = float((table["mean_mm"] - table["bias_mm"]).median())
    looks = style.assessor_style(table["assessor"])
    levels = np.unique(table["noise_um"])
    step = float(np.diff(levels).min()) if levels.size > 1 else 50.0
    few, many = table["repetitions"].min(), table["repetitions"].max()
    span = f"{many:.0f}" if few == many else f"{few:.0f} to {many:.0f}"
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 3.1)
        ax = figure.subplots()
        for index, (name, (label, colour, marker)) in enumerate(looks.items()):
            rows = table[(table["assessor"] == name) & table["mean_mm"].notna()]
            ends = rows["mean_mm"] - rows["min_mm"], rows["max_mm"] - rows["mean_mm"]
            shift = (index - (len(looks) - 1) / 2) * 0.14 * step
            ax.errorbar(rows["noise_um"] + shift, rows["mean_mm"], np.clip(ends, 0, None),
                        color=colour, marker=marker, label=label)  # fmt: skip
        label = "“True” accuracy*" if taken_as_true else "True accuracy"
        if np.isfinite(true_accuracy_mm):
            label = f"{label} {true_accuracy_mm:.3f} mm"
            ax.axhline(true_accuracy_mm, **style.TRUTH, zorder=1, label=label)
        ax.set(xlabel="Noise, standard deviation per axis (µm)", ylabel="Assessed accuracy (mm)")
        ax.set_xticks(levels[:: max(-(-levels.size // 8), 1)])
        ax.grid(axis="x", visible=False)
        ax.set_title(f"Mean, smallest and largest of {span} simulations", loc="left",
                     color=style.MUTED, fontsize=style.SMALL_PT)  # fmt: skip
        figure.legend(loc="outside lower center", ncols=2, title=taken_as_true,
                      title_fontsize=style.SMALL_PT)  # fmt: skip
        style.name_dataset(figure, dataset)
    return figure
