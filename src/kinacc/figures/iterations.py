"""The iteration history of one simulation of model invalidation, as in Figs. 5 and 6."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.errors import InputError, Problem
from kinacc.figures import style, truth


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
    Raises InputError where there is no row.
    """
    table = pd.DataFrame(dict(histories))
    steps = table[table["example"] == example].sort_values("iteration", kind="stable")
    if steps.empty:
        present = ", ".join(sorted(set(table["example"]))) or "none"
        raise InputError(
            Problem("histories", f"no row belongs to example {example!r}", f"found: {present}")
        )
    eta_mm, alpha = steps[["eta_mm", "alpha"]].iloc[0]
    true = "“true” {}*" if taken_as_true else "true {}"
    title = _verdict(steps)
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 4.2)
        top, bottom = axes = figure.subplots(2, 1, sharex=True, height_ratios=(1.35, 1))
        top.step(steps["iteration"], steps["true_mm"], where="mid", color="#9a9a9a", lw=0.6,
                 label=true.format("error"))  # fmt: skip
        _dots(top, steps, "measured_mm", False, style.BLUE, "first measurement")
        _dots(top, steps, "averaged_mm", True, style.ORANGE, "after resampling (average)")
        top.axhline(eta_mm, color=style.VERMILION, lw=1, label="accuracy bound η")
        column = "rejection_probability"
        _dots(bottom, steps, column, False, style.PURPLE, "probability at new point")
        _dots(bottom, steps, column, True, style.ORANGE, "_after resampling, as above")
        bottom.axhline(alpha, color=style.INK, lw=0.9, zorder=1.5)
        bottom.text(1.01, alpha, "α", transform=bottom.get_yaxis_transform(), va="center")
        if true_accuracy_mm is not None:
            label = f"{true.format('accuracy')} {true_accuracy_mm:.3f} mm"
            top.axhline(true_accuracy_mm, **style.TRUTH, label=label)
            reached = steps["iteration"][np.isclose(steps["true_mm"], true_accuracy_mm, 0, 1e-9)]
            for ax in axes if len(reached) else ():
                ax.axvline(reached.iloc[0], color=style.INK, lw=0.8, ls=":", zorder=1.5)
            place = f"first measured at k = {reached.iloc[0]} (dotted)" if len(reached) else ""
            title += f"\nlargest {true.format('error')} {place or 'not measured'}"
        if "rule_met" in steps and not steps["rule_met"].iloc[0]:
            title += "\n" + fill(f"shown: {steps['rule'].iloc[0]}", 56)
        top.set_title(title, loc="left", fontsize=style.SMALL_PT)
        top.set(ylim=(0.0, None), ylabel="Error magnitude (mm)")
        bottom.set(xlabel="Iteration k", ylim=(-0.03, 1.03), ylabel="Rejection probability")
        bottom.locator_params("x", integer=True, nbins=6)
        for ax in axes:
            ax.grid(axis="x", visible=False)
        figure.legend(loc="outside lower center", ncols=2, markerscale=1.6, title=taken_as_true,
                      title_fontsize=style.SMALL_PT)  # fmt: skip
        figure.align_ylabels()
        style.name_dataset(figure, dataset)
    return figure


def _verdict(steps: pd.DataFrame) -> str:
    """Bound, noise, threshold and outcome in a line."""
    last = steps.iloc[-1]
    outcome = "rejected" if last["rejection_probability"] > last["alpha"] else "not rejected"
    noise_um, alpha = 1000 * last["noise_mm"], 100 * last["alpha"]
    return f"η = {last['eta_mm']:.3f} mm, noise {noise_um:.0f} µm, α = {alpha:.0f} %: {outcome}"


def _dots(ax: Axes, steps: pd.DataFrame, column: str, again: bool, colour: str, label: str) -> None:
    """Draw the iterations at points measured before (``again``), or at new ones."""
    shown = steps[steps["point"].duplicated() == again]
    if len(shown):
        ax.plot(shown["iteration"], shown[column], "D" if again else "o", ms=2.4, mew=0,
                color=colour, label=label, zorder=4 if again else 3)  # fmt: skip
