"""Fig. 4: assessed accuracy against noise, one line per assessor, with the true accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style, truth
from kinacc.figures.columns import floats, require, texts
from kinacc.tables.columns import Columns

COLUMNS = ("assessor", "noise_mm", "mean_mm", "min_mm", "max_mm", "bias_mm", "repetitions")
UM_PER_MM = 1000.0


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure of the ``study_summary``, with the truth of ``assessment_points``."""
    return draw(inputs["study_summary"], **truth.known(inputs, settings))


def draw(
    summary: Columns,
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
    require(summary, COLUMNS, "study_summary")
    names = texts(summary, "assessor")
    noise_um = floats(summary, "noise_mm") * UM_PER_MM
    if true_accuracy_mm is None:
        implied = floats(summary, "mean_mm") - floats(summary, "bias_mm")
        true_accuracy_mm = float(np.nanmedian(implied)) if np.isfinite(implied).any() else None
    looks = style.assessor_style(list(names))
    levels = np.unique(noise_um[np.isfinite(noise_um)])
    step = float(np.diff(levels).min()) if levels.size > 1 else 50.0

    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 2.7)
        ax = figure.subplots()
        labels = []
        for index, (name, (words, colour, marker)) in enumerate(looks.items()):
            mine = names == name
            shift = (index - (len(looks) - 1) / 2) * 0.14 * step
            last = _assessor(ax, summary, mine, noise_um[mine] + shift, colour, marker)
            if last is not None:
                labels.append((last, fill(words, 13), colour))
        if true_accuracy_mm is not None:
            ax.axhline(true_accuracy_mm, color=style.INK, lw=1, ls=(0, (4, 2)), zorder=1)
            words = "“True” accuracy*" if taken_as_true else "True accuracy"
            labels.append((true_accuracy_mm, f"{words}\n{true_accuracy_mm:.3f} mm", style.INK))
        ax.set(xlabel=r"Noise, standard deviation per axis (µm)", ylabel="Assessed accuracy (mm)")
        ax.set_xticks(levels if levels.size <= 8 else levels[:: -(-levels.size // 8)])
        margin = 0.55 * step
        if levels.size:
            ax.set_xlim(levels[0] - margin, levels[-1] + margin)
        ax.margins(y=0.06)
        ax.grid(axis="x", visible=False)
        _label_lines(ax, labels)
        ax.set_title(_repetitions(summary), loc="left", color=style.MUTED, fontsize=style.SMALL_PT)
        if taken_as_true:
            figure.supxlabel(
                taken_as_true,
                fontsize=style.SMALL_PT, color=style.MUTED, x=0.01, ha="left",
            )  # fmt: skip
        style.name_dataset(figure, dataset)
    return figure


def _assessor(
    ax: Axes, summary: Columns, mine: np.ndarray, x_um: np.ndarray, colour: str, marker: str
) -> float | None:
    """Draw one assessor; return the height of its rightmost mean, None where it has none."""
    mean, low, high = (floats(summary, c)[mine] for c in ("mean_mm", "min_mm", "max_mm"))
    order = np.argsort(x_um, kind="stable")
    order = order[np.isfinite(mean[order])]
    if not order.size:
        return None
    x_um, mean, low, high = x_um[order], mean[order], low[order], high[order]
    ax.errorbar(
        x_um,
        mean,
        yerr=np.nan_to_num(np.clip([mean - low, high - mean], 0, None)),
        color=colour,
        marker=marker,
        ms=4,
        mec="white",
        mew=0.4,
        capsize=2,
        elinewidth=0.9,
        capthick=0.9,
        lw=1.1,
    )
    return float(mean[-1])


def _label_lines(ax: Axes, labels: list[tuple[float, str, str]]) -> None:
    """Name each line at its right end, moved apart where the names would overlap."""
    low, high = ax.get_ylim()
    heights = [(y - low) / (high - low) for y, _, _ in labels]
    lines = max((words.count("\n") + 1 for _, words, _ in labels), default=1)
    places = style.spread(heights, 0.02 + 0.052 * lines, 0.05, 0.95)
    for place, (_, words, colour) in zip(places, labels, strict=True):
        style.outside_label(ax, place, words, colour)


def _repetitions(summary: Columns) -> str:
    counts = floats(summary, "repetitions")
    counts = counts[np.isfinite(counts)]
    if not counts.size:
        return "Mean, smallest and largest"
    few, many = int(counts.min()), int(counts.max())
    span = f"{many}" if few == many else f"{few} to {many}"
    return f"Mean, smallest and largest of {span} simulation{'s' if many != 1 else ''}"
