"""The tournament's worlds in a picture: how often bounds are not false, world by world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from kinacc.errors import InputError, Problem
from kinacc.figures import style

_SIDES = (("upper", "Upper bound", "o", 0.14), ("lower", "Lower bound", "s", -0.14))


def draw(rows: Sequence[Mapping], level: float) -> Figure:
    """Shares of campaigns without a false bound, a row per setup and world, a panel per budget.

    rows: as :func:`kinacc.study.tournament.worlds_page.of_kinds` has them, of one assessor, noise
    and number of candidates; ``level``: the confidence to compare with. InputError without rows.
    """
    if not rows:
        raise InputError(Problem("tournament_cells", "no campaigns of this assessor"))
    kinds = list(dict.fromkeys((row["setup"], row["world"]) for row in rows))
    budgets = sorted({row["budget"] for row in rows})
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 0.6 + 0.19 * len(kinds))
        axes = figure.subplots(1, len(budgets), sharey=True, sharex=True, squeeze=False)[0]
        colours = {"upper": style.VERMILION, "lower": style.BLUE}
        for ax, budget in zip(axes, budgets, strict=True):
            for row in (each for each in rows if each["budget"] == budget):
                place = len(kinds) - 1 - kinds.index((row["setup"], row["world"]))
                for side, words, marker, shift in _SIDES:
                    y, colour = place + shift, colours[side]
                    ax.hlines(y, row[f"{side}_low"], row[f"{side}_high"], color=colour, lw=0.8)
                    ax.plot(row[side], y, marker, color=colour, ms=3.2, ls="", label=words)
                ax.text(
                    1.02,
                    place,
                    f"{row['stated']:.0%}",
                    transform=ax.get_yaxis_transform(),
                    va="center",
                    fontsize=style.SMALL_PT,
                )
            ax.text(1.02, len(kinds) - 0.4, "stated", transform=ax.get_yaxis_transform(),
                    fontsize=style.SMALL_PT)  # fmt: skip
            ax.axvline(level, color=style.INK, lw=0.8, ls=(0, (4, 2)), zorder=1)
            ax.set_title(f"{budget} readings", fontsize=style.SMALL_PT)
        names = [f"{setup}: {world}" for setup, world in reversed(kinds)]
        axes[0].set_yticks(np.arange(len(kinds)), names)
        handles, labels = axes[0].get_legend_handles_labels()
        once = dict(zip(labels, handles, strict=True))
        figure.legend(
            once.values(),
            once.keys(),
            loc="outside lower center",
            ncols=2,
            title="Share of campaigns without a false bound",
        )
    return figure
