"""The iteration history of one simulation of model invalidation, as in Figs. 5 and 6."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from kinacc.errors import InputError, Problem
from kinacc.figures import style, truth

COLUMNS = (
    "example",
    "noise_mm",
    "alpha",
    "iteration",
    "point",
    "eta_mm",
    "measured_mm",
    "averaged_mm",
    "true_mm",
    "rejection_probability",
)
LINE_IN = 0.15  # of text beside the panels


def run(inputs: Mapping, settings: Mapping, example: str) -> Figure:
    """Return the figure of an example of the ``histories``, with the truth of all points."""
    return draw(inputs["histories"], example=example, **truth.known(inputs, settings))


def draw(
    histories: Mapping,
    *,
    example: str,
    true_accuracy_mm: float | None = None,
    taken_as_true: str | None = None,
    dataset: str | None = None,
) -> Figure:
    """Draw one example of ``histories``.

    Above: magnitude of first readings, of the averages after resampling, of the true errors, with
    the bound eta and the true accuracy (largest true error of all operating points, visited or
    not); a dotted line where the largest is first measured. Below: rejection
    probability and its threshold alpha.
    ``taken_as_true``: footnote where the truth is not known; what the study took for it.
    Raises InputError where a column is missing or there is no row.
    """
    style.require(histories, COLUMNS, "histories")
    table = pd.DataFrame(dict(histories))
    steps = table[table["example"] == example].sort_values("iteration", kind="stable")
    if steps.empty:
        present = ", ".join(sorted(set(table["example"]))) or "none"
        raise InputError(
            Problem("histories", f"no row belongs to example {example!r}", f"found: {present}")
        )
    with style.house():
        height = 4.0 + LINE_IN * (bool(dataset) + bool(taken_as_true))
        figure = style.new_figure(style.SINGLE_COLUMN_IN, height)
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1.35, 1))
        _magnitudes(top, steps, true_accuracy_mm, bool(taken_as_true))
        _probability(bottom, steps)
        handles = [ax.get_legend_handles_labels() for ax in (top, bottom)]
        figure.legend(
            *(above + below for above, below in zip(*handles, strict=True)), ncols=2,
            loc="outside lower center", alignment="left", markerscale=1.6, title=taken_as_true,
            title_fontproperties={"size": style.SMALL_PT},
        )  # fmt: skip
        title = verdict(steps)
        if true_accuracy_mm is not None:
            error = "largest “true” error*" if taken_as_true else "largest true error"
            at = steps["iteration"][np.isclose(steps["true_mm"], true_accuracy_mm, 0, 1e-9)]
            for ax in (top, bottom) if len(at) else ():
                ax.axvline(at.iloc[0], color=style.INK, lw=0.8, ls=(0, (1, 1.5)), zorder=1.5)
            found = f"first measured at k = {at.iloc[0]} (dotted)" if len(at) else "not measured"
            title += f"\n{error} {found}"
        if "rule_met" in steps and not steps["rule_met"].iloc[0]:
            title += "\n" + fill(f"shown: {steps['rule'].iloc[0]}", 56)
        top.set_title(title, loc="left", fontsize=style.SMALL_PT, linespacing=1.3)
        bottom.set_xlabel("Iteration k")
        bottom.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
        first, last = steps["iteration"].iloc[[0, -1]]
        pad = max(0.02 * (last - first), 0.5)
        bottom.set_xlim(first - pad, last + pad)
        figure.align_ylabels([top, bottom])
        style.name_dataset(figure, dataset)
    return figure


def verdict(steps: pd.DataFrame) -> str:
    """State bound, noise, threshold and outcome in one line."""
    last = steps.iloc[-1]
    outcome = "rejected" if last["rejection_probability"] > last["alpha"] else "not rejected"
    noise_um, alpha = 1000 * last["noise_mm"], 100 * last["alpha"]
    return f"η = {last['eta_mm']:.3f} mm, noise {noise_um:.0f} µm, α = {alpha:.0f} %: {outcome}"


def _dots(ax: Axes, steps: pd.DataFrame, column: str, again: bool, colour: str, label: str) -> None:
    """Draw the iterations at points measured before (``again``), or at new ones."""
    shown = steps[steps["point"].duplicated() == again]
    if len(shown):
        ax.plot(shown["iteration"], shown[column], ls="", marker="D" if again else "o", ms=2.4,
                mew=0, color=colour, label=label, zorder=4 if again else 3)  # fmt: skip


def _magnitudes(
    ax: Axes, steps: pd.DataFrame, true_accuracy_mm: float | None, only_taken: bool
) -> None:
    true = "“true” {}*" if only_taken else "true {}"
    ax.step(steps["iteration"], steps["true_mm"], where="mid", color="#9a9a9a", lw=0.6,
            label=true.format("error"), zorder=2)  # fmt: skip
    _dots(ax, steps, "measured_mm", False, style.BLUE, "first measurement")
    _dots(ax, steps, "averaged_mm", True, style.ORANGE, "after resampling (average)")
    eta_mm = steps["eta_mm"].iloc[0]
    ax.axhline(eta_mm, color=style.VERMILION, lw=1, label="accuracy bound η", zorder=2.5)
    if true_accuracy_mm is not None:
        label = f"{true.format('accuracy')} {true_accuracy_mm:.3f} mm"
        ax.axhline(true_accuracy_mm, **style.TRUTH, zorder=2.5, label=label)
    ax.set_ylim(bottom=0)
    ax.set_ylabel("Error magnitude (mm)")
    ax.grid(axis="x", visible=False)


def _probability(ax: Axes, steps: pd.DataFrame) -> None:
    column = "rejection_probability"
    _dots(ax, steps, column, False, style.PURPLE, "probability at new point")
    _dots(ax, steps, column, True, style.ORANGE, "_after resampling, as above")
    alpha = steps["alpha"].iloc[0]
    ax.axhline(alpha, color=style.INK, lw=0.9, zorder=1.5)
    ax.annotate(
        "α", (1, alpha), xycoords=("axes fraction", "data"), xytext=(2, 0),
        textcoords="offset points", va="center", fontsize=style.TEXT_PT,
    )  # fmt: skip
    ax.set_ylim(-0.03, 1.03)
    ax.set_ylabel("Rejection probability")
    ax.grid(axis="x", visible=False)
