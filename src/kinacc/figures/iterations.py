"""The iteration history of one simulation of model invalidation, as in Figs. 5 and 6."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from kinacc.errors import InputError, Problem
from kinacc.figures import style, truth
from kinacc.figures.columns import floats, require, rows, texts
from kinacc.tables.columns import Columns

COLUMNS = (
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
    histories: Columns,
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
    values = _sorted(histories, example)
    again = resampled(values["point"])
    with style.house():
        height = 4.0 + LINE_IN * (bool(dataset) + bool(taken_as_true))
        figure = style.new_figure(style.SINGLE_COLUMN_IN, height)
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1.35, 1))
        _magnitudes(top, values, again, true_accuracy_mm, taken_as_true)
        _probability(bottom, values, again)
        _legend(figure, top, bottom, taken_as_true)
        title = verdict(values)
        if true_accuracy_mm is not None:
            title += "\n" + _mark_largest((top, bottom), values, true_accuracy_mm, taken_as_true)
        title += _unmet(histories, example)
        top.set_title(title, loc="left", fontsize=style.SMALL_PT, linespacing=1.3)
        bottom.set_xlabel("Iteration k")
        bottom.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
        k = values["iteration"]
        pad = max(0.02 * (k[-1] - k[0]), 0.5)
        bottom.set_xlim(k[0] - pad, k[-1] + pad)
        figure.align_ylabels([top, bottom])
        style.name_dataset(figure, dataset)
    return figure


def _sorted(histories: Columns, example: str) -> dict[str, np.ndarray]:
    """Return the columns of one example in the order of its iterations."""
    require(histories, ("example", *COLUMNS), "histories")
    names = texts(histories, "example")
    mine = rows(histories, names == example)
    k = floats(mine, "iteration")
    if not k.size:
        present = ", ".join(sorted(set(names))) or "none"
        raise InputError(
            Problem("histories", f"no row belongs to example {example!r}", f"found: {present}")
        )
    order = np.argsort(k, kind="stable")
    return {name: floats(mine, name)[order] for name in COLUMNS}


def resampled(point: np.ndarray) -> np.ndarray:
    """Say for each iteration whether its operating point had been measured before."""
    again = np.ones(point.shape, dtype=bool)
    again[np.unique(point, return_index=True)[1]] = False
    return again


def verdict(values: Columns) -> str:
    """State bound, noise, threshold and outcome in one line."""
    eta, noise, alpha = (values[name][0] for name in ("eta_mm", "noise_mm", "alpha"))
    final = values["rejection_probability"][-1]
    outcome = "rejected" if final > alpha else "not rejected"
    return f"η = {eta:.3f} mm, noise {noise * 1000:.0f} µm, α = {alpha * 100:.0f} %: {outcome}"


def _magnitudes(
    ax: Axes,
    values: Columns,
    again: np.ndarray,
    true_accuracy_mm: float | None,
    taken_as_true: str | None,
) -> None:
    k = values["iteration"]
    label = "“true” error*" if taken_as_true else "true error"
    accuracy = "“true” accuracy*" if taken_as_true else "true accuracy"
    ax.step(k, values["true_mm"], where="mid", color="#9a9a9a", lw=0.6, label=label, zorder=2)
    ax.plot(
        k[~again], values["measured_mm"][~again], ls="", marker="o", ms=2.4, mew=0,
        color=style.BLUE, label="first measurement", zorder=3,
    )  # fmt: skip
    if again.any():
        ax.plot(
            k[again], values["averaged_mm"][again], ls="", marker="D", ms=2.4, mew=0,
            color=style.ORANGE, label="after resampling (average)", zorder=4,
        )  # fmt: skip
    ax.axhline(
        values["eta_mm"][0], color=style.VERMILION, lw=1, label="accuracy bound η", zorder=2.5
    )
    if true_accuracy_mm is not None and np.isfinite(true_accuracy_mm):
        ax.axhline(
            true_accuracy_mm, color=style.INK, lw=1, ls=(0, (4, 2)), zorder=2.5,
            label=f"{accuracy} {true_accuracy_mm:.3f} mm",
        )  # fmt: skip
    ax.set_ylim(bottom=0)
    ax.set_ylabel("Error magnitude (mm)")
    ax.grid(axis="x", visible=False)


def _legend(figure: Figure, top: Axes, bottom: Axes, taken_as_true: str | None) -> None:
    """Name what both panels show below them, where it covers no point."""
    handles, names = (
        above + below
        for above, below in zip(
            top.get_legend_handles_labels(), bottom.get_legend_handles_labels(), strict=True
        )
    )
    figure.legend(
        handles,
        names,
        loc="outside lower center",
        ncols=2,
        alignment="left",
        markerscale=1.6,
        title=taken_as_true,
        title_fontproperties={"size": style.SMALL_PT},
    )


def _mark_largest(
    axes: tuple[Axes, Axes], values: Columns, true_accuracy_mm: float, taken_as_true: str | None
) -> str:
    """Mark the iteration that first measures the point with the largest true error, in words."""
    words = "largest “true” error*" if taken_as_true else "largest true error"
    k = values["iteration"][np.isclose(values["true_mm"], true_accuracy_mm, rtol=0, atol=1e-9)]
    if not k.size:
        return f"{words} not measured"
    for ax in axes:
        ax.axvline(k[0], color=style.INK, lw=0.8, ls=(0, (1, 1.5)), zorder=1.5)
    return f"{words} first measured at k = {k[0]:.0f} (dotted)"


def _unmet(histories: Columns, example: str) -> str:
    """Say by which lesser rule the simulation was chosen, where the rule itself was not met."""
    if "rule" not in histories or "rule_met" not in histories:
        return ""
    mine = np.flatnonzero(texts(histories, "example") == example)[0]
    if floats(histories, "rule_met")[mine]:
        return ""
    return "\n" + fill(f"shown: {texts(histories, 'rule')[mine]}", 56)


def _probability(ax: Axes, values: Columns, again: np.ndarray) -> None:
    k, p = values["iteration"], values["rejection_probability"]
    for mask, marker, colour, label in (
        (~again, "o", style.PURPLE, "probability at new point"),
        (again, "D", style.ORANGE, "_after resampling, as above"),
    ):
        ax.plot(k[mask], p[mask], ls="", marker=marker, ms=2.4, mew=0, color=colour, label=label)
    alpha = values["alpha"][0]
    ax.axhline(alpha, color=style.INK, lw=0.9, zorder=1.5)
    ax.annotate(
        "α", (1, alpha), xycoords=("axes fraction", "data"), xytext=(2, 0),
        textcoords="offset points", va="center", fontsize=style.TEXT_PT,
    )  # fmt: skip
    ax.set_ylim(-0.03, 1.03)
    ax.set_ylabel("Rejection probability")
    ax.grid(axis="x", visible=False)
