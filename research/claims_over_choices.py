"""The paper's sentences over arms and open choices: where they hold, and what decides them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kinacc.figures import style

# pd.DataFrame of shares: words, colour and marker.
_SHARES = {
    "arms": ("further arms", style.VERMILION, "^"),
    "alone": ("one choice varied", style.SKY, "s"),
    "all": ("all choices at once", style.BLUE, "o"),
    "all_and_arm": ("all choices and the arm", style.INK, "D"),
}
_NUMBERS = ("table1_", "table2_", "table3_", "true_accuracy")
_SAMPLE = "all_and_arm"
_ROW_IN = 0.155


def draw(shares: pd.DataFrame, reasons: pd.DataFrame) -> Figure:
    """Draw a row per sentence: shares of runs in which it holds, and what changes them how much.

    Numbers of Tables I to III and the true accuracy are left out: they are about the arm.
    """
    shares = shares[~shares["claim"].str.startswith(_NUMBERS)]
    reasons = reasons[reasons["sample"] == _SAMPLE]
    claims = [*shares["claim"]]
    factors = _factors(reasons)
    with style.new_figure(style.DOUBLE_COLUMN_IN, 1.5 + _ROW_IN * len(claims)) as figure:
        left, right = figure.subplots(
            1, 2, sharey=True, width_ratios=[1, max(len(factors), 1) / 11]
        )
        _shares(left, shares)
        _decisions(right, reasons, claims, factors)
        left.set_yticks(range(len(claims)), [name.replace("_", " ") for name in claims])
        left.set_ylim(len(claims) - 0.5, -0.5)
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower left", ncols=4)
    return figure


def _factors(reasons: pd.DataFrame) -> list[str]:
    """Choices, then properties, each in the order of their names."""
    kinds = dict(zip(reasons["factor"], reasons["kind"], strict=True))
    return sorted(kinds, key=lambda name: (kinds[name], name))


def _shares(ax: Axes, shares: pd.DataFrame) -> None:
    places = np.arange(len(shares["claim"]))
    for step, (name, (words, colour, marker)) in enumerate(_SHARES.items()):
        shift = 0.13 * (step - (len(_SHARES) - 1) / 2)
        share = 100.0 * shares[f"{name}_share"]
        ax.plot(share, places + shift, marker, color=colour, ms=3, ls="", label=words, mew=0.0)
    ax.set(xlabel="Runs in which it holds (%)", xlim=(-4, 104))
    ax.set_xticks([0, 50, 100])


def _decisions(
    ax: Axes, reasons: pd.DataFrame, claims: Sequence[str], factors: Sequence[str]
) -> None:
    """A square where a factor decides, as large as the difference it makes."""
    told = reasons[(reasons["decides"] > 0) & reasons["claim"].isin(claims)]
    x = [factors.index(name) for name in told["factor"]]
    y = [claims.index(name) for name in told["claim"]]
    ax.scatter(x, y, s=60.0 * told["difference"], marker="s", color=style.PURPLE, linewidths=0)
    ax.set_xlim(-0.6, len(factors) - 0.4)
    ax.set_xticks(range(len(factors)), [name.replace("_", " ") for name in factors], rotation=90)
    ax.tick_params(axis="y", length=0)
    ax.set_title(
        "Square: its values change the share (full height 100 %)",
        loc="left", color=style.MUTED, fontsize=style.SMALL_PT,
    )  # fmt: skip
