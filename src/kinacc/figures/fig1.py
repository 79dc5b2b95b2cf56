"""Fig. 1: the one-dimensional example, two measurements of one operating point, computed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style

# One operating point in mm: the true value lies beyond the bound eta, so H0 does not hold.
ETA_MM, TRUE_MM, SIGMA_MM = 1.0, 1.5, 0.25
MEASURED_MM = {
    "Less likely: far from its true value": 1.17,
    "More likely: near its true value": 1.4,
}


class Case(NamedTuple):
    """One measurement judged: candidate (eq. 21), distance (eq. 20), P_k (eqs. 17-18)."""

    candidate_mm: float
    distance: float
    probability: float


def judge(measured_mm: float, eta_mm: float, sigma_mm: float) -> Case:
    """Judge one measurement against the bound: n = 1, one operating point, one measurement.

    The squared Mahalanobis distance goes into the chi-square distribution of one degree of
    freedom (the consistent reading of eqs. 18 and 20), which beyond R^2 holds erfc(R / sqrt 2).
    """
    candidate = float(np.clip(measured_mm, -eta_mm, eta_mm))
    distance = abs(measured_mm - candidate) / sigma_mm
    return Case(candidate, distance, math.erfc(distance / math.sqrt(2)))


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure, which needs no table and is the same for every data set."""
    return draw()


def draw(dataset: str | None = None) -> Figure:
    """Draw the less likely case above the more likely one.

    Shaded: the part of the candidate's distribution farther from it than the measurement, whose
    area is P_k.
    """
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 3.5)
        axes = figure.subplots(2, 1, sharex=True)
        for ax, (title, measured) in zip(axes, MEASURED_MM.items(), strict=True):
            _case(ax, measured)
            ax.set_title(title, loc="left")
        axes[1].set_xlabel("Error (mm)")
        handles = axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=1, alignment="left")
        style.name_dataset(figure, dataset)
    return figure


def _case(ax: Axes, measured_mm: float) -> None:
    candidate, _, probability = judge(measured_mm, ETA_MM, SIGMA_MM)
    peak = 1 / (SIGMA_MM * np.sqrt(2 * np.pi))
    ends = min(candidate, TRUE_MM) - 3.3 * SIGMA_MM, max(candidate, TRUE_MM) + 3.3 * SIGMA_MM
    x = np.linspace(*ends, 401)

    def density(at, mean: float) -> np.ndarray:
        return peak * np.exp(-0.5 * ((at - mean) / SIGMA_MM) ** 2)

    ax.plot(
        x, density(x, TRUE_MM), color=style.BLUE, ls=(0, (4, 2)),
        label="distribution of ẽ about its true value e (H₀ does not hold)",
    )  # fmt: skip
    ax.plot(
        x, density(x, candidate), color=style.VERMILION,
        label="assumed under H₀, about the candidate ê",
    )  # fmt: skip
    reach = abs(measured_mm - candidate)
    low, high = candidate - reach, candidate + reach
    label = "Pₖ, the chance of a measurement farther from ê than ẽ"
    for tail in (np.append(x[x <= low], low), np.append(high, x[x >= high])):
        shade = density(tail, candidate)
        ax.fill_between(tail, shade, color=style.ORANGE, alpha=0.55, lw=0, label=label)
        label = ""
    ax.vlines(TRUE_MM, 0, peak, color=style.BLUE, lw=0.8, ls=(0, (4, 2)))
    ax.vlines(candidate, 0, peak, color=style.VERMILION, lw=0.8)
    ax.plot(
        [measured_mm] * 2, [0, peak], color=style.INK, lw=1, marker="o", ms=3.5,
        markevery=[0], clip_on=False, zorder=4,
    )  # fmt: skip
    for place, mark, colour in (
        (candidate, "ê = η", style.VERMILION),
        (TRUE_MM, "e", style.BLUE),
        (measured_mm, "ẽ", style.INK),
    ):
        ax.text(
            place, 1.03 * peak, mark, ha="center", va="bottom", color=style.darker(colour),
            bbox={"fc": "white", "ec": "none", "pad": 0.6}, zorder=5,
        )  # fmt: skip
    ax.text(
        0.985, 0.93, f"Pₖ = {probability:.2f}", transform=ax.transAxes, ha="right", va="top",
        fontsize=style.TEXT_PT + 1,
    )  # fmt: skip
    ax.set(ylim=(0, peak * 1.28), xlim=ends, ylabel="Density (1/mm)")
    ax.grid(False)
