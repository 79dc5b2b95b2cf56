"""Fig. 1: the one-dimensional example, two measurements of one operating point, computed."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import norm

from kinacc.figures import style

# One operating point in mm: the true value lies beyond the bound eta, so H0 does not hold.
ETA_MM, TRUE_MM, SIGMA_MM = 1.0, 1.5, 0.25
MEASURED_MM = {
    "Less likely: far from its true value": 1.17,
    "More likely: near its true value": 1.4,
}
_RANGE_MM = (ETA_MM - 3.3 * SIGMA_MM, TRUE_MM + 3.3 * SIGMA_MM)


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


def draw() -> Figure:
    """Draw the less likely case above the more likely one.

    Shaded: the part of the candidate's distribution farther from it than the measurement, whose
    area is P_k.
    """
    with style.new_figure(style.SINGLE_COLUMN_IN, 3.5) as figure:
        axes = figure.subplots(2, 1, sharex=True)
        for ax, (title, measured) in zip(axes, MEASURED_MM.items(), strict=True):
            _case(ax, measured)
            ax.set_title(title)
        axes[1].set_xlabel("Error (mm)")
        handles = axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=1, alignment="left")
    return figure


def _case(ax: Axes, measured_mm: float) -> None:
    candidate, distance, probability = judge(measured_mm, ETA_MM, SIGMA_MM)
    x = np.linspace(*_RANGE_MM, 801)
    true, assumed = (norm(mean, SIGMA_MM).pdf(x) for mean in (TRUE_MM, candidate))
    peak = assumed.max()
    ax.plot(x, true, color=style.BLUE, ls=(0, (4, 2)),
            label="distribution of ẽ about its true value e (H₀ does not hold)")  # fmt: skip
    ax.plot(x, assumed, color=style.VERMILION, label="assumed under H₀, about the candidate ê")
    ax.fill_between(
        x, assumed, where=abs(x - candidate) >= distance * SIGMA_MM, color=style.ORANGE,
        alpha=0.55, lw=0, label="Pₖ, the chance of a measurement farther from ê than ẽ",
    )  # fmt: skip
    for place, text, colour in (
        (candidate, "ê = η", style.VERMILION),
        (TRUE_MM, "e", style.BLUE),
        (measured_mm, "ẽ", style.INK),
    ):
        ax.vlines(place, 0, peak, color=colour, lw=0.8)
        ax.text(place, 1.03 * peak, text, ha="center", color=colour)
    ax.plot(measured_mm, 0.0, "o", color=style.INK, ms=3.5, clip_on=False)
    ax.text(0.985, 0.85, f"Pₖ = {probability:.2f}", transform=ax.transAxes, ha="right")
    ax.set(ylim=(0, peak * 1.28), xlim=_RANGE_MM, ylabel="Density (1/mm)")
    ax.grid(False)
