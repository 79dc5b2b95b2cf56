"""Figs. 1 to 6 as the workflow draws them, and those of the study: noise and iterations."""

from __future__ import annotations

from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.config.records import Settings
from kinacc.figures import fig1, fig2, fig3, style
from kinacc.tables.columns import Columns, Tables

AT_MEASURED = "* measured minus modelled: contains the instrument's noise"
OF_MODELS = "* taken as true by the study: VEC minus DH of a measured arm"


_EXAMPLES = {"fig5": "rejected", "fig6": "not_rejected"}
_UM_PER_MM = 1000.0


def draw_figure(name: str, inputs: Tables, settings: Settings) -> Figure:
    """Draw ``fig1`` to ``fig6`` of the tables of a data set.

    The true accuracy (eq. 7) is the largest true error of ``assessment_points``.
    """
    dataset = settings.get("dataset")
    if name == "fig1":  # the same for every data set
        return fig1.draw()
    if name == "fig2":
        return fig2.run(inputs, settings)
    if name == "fig3":
        return fig3.draw(inputs["accuracy_map"], dataset=dataset)
    truth = pd.Series(inputs["assessment_points"]["true_error_mm"]).max(), footnote(inputs), dataset
    if name == "fig4":
        return draw_noise(inputs["study_summary"], *truth)
    return draw_iterations(inputs["histories"], _EXAMPLES[name], *truth)


def footnote(tables: Tables) -> str | None:
    """What a study of a measured arm takes as true; None of the synthetic arm, which is known."""
    points, measurements = (
        pd.DataFrame(tables[name]) for name in ("assessment_points", "measurements")
    )
    joints = [name for name in points if name[:1] == "q" and name[1:].isdigit()]
    measured = pd.MultiIndex.from_frame(measurements[joints])
    if pd.MultiIndex.from_frame(points[joints]).isin(measured).all():
        return AT_MEASURED
    return OF_MODELS if measurements["row"].notna().any() else None


def draw_noise(
    summary: Columns,
    true_accuracy_mm: float,
    taken_as_true: str | None = None,
    dataset: str | None = None,
) -> Figure:
    """Fig. 4: assessed accuracy against noise, one line per assessor, with the true accuracy.

    Means of ``study_summary`` joined by lines, bars from the smallest to the largest.
    ``taken_as_true``: footnote where the truth is not known; what the study took for it.
    """
    table = pd.DataFrame(summary).sort_values("noise_mm", kind="stable")
    table["noise_um"] = table["noise_mm"] * _UM_PER_MM
    looks = style.assessor_style(table["assessor"])
    levels = np.unique(table["noise_um"])
    step = float(np.diff(levels).min()) if levels.size > 1 else 50.0
    with style.new_figure(style.SINGLE_COLUMN_IN, 3.1, dataset) as figure:
        ax = figure.subplots()
        for index, (name, (label, colour, marker)) in enumerate(looks.items()):
            rows = table[(table["assessor"] == name) & table["mean_mm"].notna()]
            ends = rows["mean_mm"] - rows["min_mm"], rows["max_mm"] - rows["mean_mm"]
            shift = (index - (len(looks) - 1) / 2) * 0.14 * step
            ax.errorbar(rows["noise_um"] + shift, rows["mean_mm"], np.clip(ends, 0, None),
                        color=colour, marker=marker, label=label)  # fmt: skip
        label = "“True” accuracy*" if taken_as_true else "True accuracy"
        label = f"{label} {true_accuracy_mm:.3f} mm"
        ax.axhline(true_accuracy_mm, **style.TRUTH, zorder=1, label=label)
        ax.set(xlabel="Noise, standard deviation per axis (µm)", ylabel="Assessed accuracy (mm)")
        ax.set_xticks(levels[:: max(-(-levels.size // 8), 1)])
        ax.grid(axis="x", visible=False)
        title = f"Mean, smallest and largest of {table['repetitions'].max():.0f} simulations"
        ax.set_title(title, color=style.MUTED)
        figure.legend(loc="outside lower center", ncols=2, title=taken_as_true)
    return figure


def draw_iterations(
    histories: Columns,
    example: str,
    true_accuracy_mm: float,
    taken_as_true: str | None = None,
    dataset: str | None = None,
) -> Figure:
    """Figs. 5 and 6: the iteration history of one example of ``histories``.

    Above: magnitude of first readings, of the averages after resampling, of the true errors, with
    the bound eta and the true accuracy (largest true error of all operating points, visited or
    not); a dotted line where the largest is first measured. Below: rejection probability and its
    threshold alpha.
    ``taken_as_true``: footnote where the truth is not known; what the study took for it.
    """
    table = pd.DataFrame(histories)
    steps = table[table["example"] == example].sort_values("iteration", kind="stable")
    eta_mm, alpha = steps[["eta_mm", "alpha"]].iloc[0]
    true = "“true” {}*" if taken_as_true else "true {}"
    title = _verdict(steps)
    with style.new_figure(style.SINGLE_COLUMN_IN, 4.2, dataset) as figure:
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
        label = f"{true.format('accuracy')} {true_accuracy_mm:.3f} mm"
        top.axhline(true_accuracy_mm, **style.TRUTH, label=label)
        place = "not measured"
        reached = steps["iteration"][np.isclose(steps["true_mm"], true_accuracy_mm, 0, 1e-9)]
        if len(reached):
            place = f"first measured at k = {reached.iloc[0]} (dotted)"
            for ax in axes:
                ax.axvline(reached.iloc[0], color=style.INK, lw=0.8, ls=":", zorder=1.5)
        title += f"\nlargest {true.format('error')} {place}"
        if not steps["rule_met"].iloc[0]:
            title += "\n" + fill(f"shown: {steps['rule'].iloc[0]}", 56)
        top.set_title(title)
        top.set(ylim=(0.0, None), ylabel="Error magnitude (mm)")
        bottom.set(xlabel="Iteration k", ylim=(-0.03, 1.03), ylabel="Rejection probability")
        bottom.locator_params("x", integer=True, nbins=6)
        for ax in axes:
            ax.grid(axis="x", visible=False)
        figure.legend(loc="outside lower center", ncols=2, markerscale=1.6, title=taken_as_true)
        figure.align_ylabels()
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
