"""Fig. 1: the one-dimensional example, two measurements of one operating point, computed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style


@dataclass(frozen=True)
class Example:
    """One operating point in one dimension, all in mm.

    ``true_mm`` lies beyond the bound ``eta_mm``, so H0 does not hold; ``far_mm`` and ``near_mm``
    are two measurements of it, far from and near to the true value.
    """

    eta_mm: float = 1.0
    true_mm: float = 1.5
    sigma_mm: float = 0.25
    far_mm: float = 1.17
    near_mm: float = 1.4


@dataclass(frozen=True)
class Case:
    """One measurement judged: candidate (eq. 21), distance (eq. 20), P_k (eqs. 17-18)."""

    measured_mm: float
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
    return Case(measured_mm, candidate, distance, math.erfc(distance / math.sqrt(2)))


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Return the figure, which needs no table and is the same for every data set."""
    return draw()


def draw(example: Example | None = None, dataset: str | None = None) -> Figure:
    """Draw the less likely case above the more likely one.

    Shaded: the part of the candidate's distribution farther from it than the measurement, whose
    area is P_k.
    """
    example = example or Example()
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 3.5)
        axes = figure.subplots(2, 1, sharex=True)
        for ax, measured, words in zip(
            axes,
            (example.far_mm, example.near_mm),
            ("Less likely: far from its true value", "More likely: near its true value"),
            strict=True,
        ):
            _case(ax, example, judge(measured, example.eta_mm, example.sigma_mm), words)
        axes[1].set_xlabel("Error (mm)")
        handles = axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=1, alignment="left")
        style.name_dataset(figure, dataset)
    return figure


def _density(x: np.ndarray, mean: float, sigma: float) -> np.ndarray:
    return np.exp(-0.5 * ((x - mean) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))


def _case(ax: Axes, example: Example, case: Case, words: str) -> None:
    sigma, peak = example.sigma_mm, 1 / (example.sigma_mm * np.sqrt(2 * np.pi))
    low = min(case.candidate_mm, example.true_mm) - 3.3 * sigma
    high = max(case.candidate_mm, example.true_mm) + 3.3 * sigma
    x = np.linspace(low, high, 401)
    assumed = _density(x, case.candidate_mm, sigma)
    ax.plot(
        x,
        _density(x, example.true_mm, sigma),
        color=style.BLUE,
        ls=(0, (4, 2)),
        label="distribution of ẽ about its true value e (H₀ does not hold)",
    )
    ax.plot(x, assumed, color=style.VERMILION, label="assumed under H₀, about the candidate ê")
    reach = abs(case.measured_mm - case.candidate_mm)
    for tail in (x[x <= case.candidate_mm - reach], x[x >= case.candidate_mm + reach]):
        edge = case.candidate_mm + np.copysign(reach, tail.mean() - case.candidate_mm)
        tail = np.sort(np.append(tail, edge))
        shade = ax.fill_between(
            tail, _density(tail, case.candidate_mm, sigma), color=style.ORANGE, alpha=0.55, lw=0
        )
    shade.set_label("Pₖ, the chance of a measurement farther from ê than ẽ")

    ax.vlines(example.true_mm, 0, peak, color=style.BLUE, lw=0.8, ls=(0, (4, 2)))
    ax.vlines(case.candidate_mm, 0, peak, color=style.VERMILION, lw=0.8)
    ax.plot(
        [case.measured_mm] * 2, [0, peak], color=style.INK, lw=1, marker="o", ms=3.5,
        markevery=[0], clip_on=False, zorder=4,
    )  # fmt: skip
    for place, height, mark, colour in (
        (case.candidate_mm, 1.03, "ê = η", style.VERMILION),
        (example.true_mm, 1.03, "e", style.BLUE),
        (case.measured_mm, 1.03, "ẽ", style.INK),
    ):
        ax.text(
            place, peak * height, mark, ha="center", va="bottom", color=style.darker(colour),
            bbox={"fc": "white", "ec": "none", "pad": 0.6}, zorder=5,
        )  # fmt: skip
    ax.text(
        0.985,
        0.93,
        f"Pₖ = {case.probability:.2f}",
        transform=ax.transAxes,
        ha="right",
        va="top",
        fontsize=style.TEXT_PT + 1,
    )
    ax.set_title(words, loc="left")
    ax.set(ylim=(0, peak * 1.28), xlim=(low, high), ylabel="Density (1/mm)")
    ax.grid(False)
