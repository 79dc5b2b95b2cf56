"""Observability index against the number of poses, chosen by exchange and taken at random."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from kinacc.figures import style


def draw(
    counts: np.ndarray,
    chosen: np.ndarray,
    random: np.ndarray,
    count: int,
    index: str,
    meaning: str,
    dataset: str | None = None,
) -> Figure:
    """Draw the index (n,) of sets of ``counts`` (n,) poses beside random sets (draws, n).

    ``count`` is the number of poses planned, ``meaning`` says in words what the index is.
    """
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 2.6)
        ax = figure.subplots()
        low, middle, high = np.percentile(random, [5.0, 50.0, 95.0], axis=0)
        ax.fill_between(counts, low, high, color=style.ORANGE, alpha=0.25, lw=0)
        ax.plot(counts, middle, color=style.ORANGE, ls=(0, (4, 1.5)), label="random (5 to 95 %)")
        ax.plot(counts, chosen, color=style.BLUE, marker="o", ms=3, label="greedy exchange")
        here = int(np.argmin(np.abs(counts - count)))
        ax.plot(counts[here], chosen[here], "o", ms=7, mfc="none", mec=style.VERMILION)
        ax.annotate(
            f"{count} poses: {chosen[here]:.3g}",
            (counts[here], chosen[here]),
            xytext=(-4, 7),
            textcoords="offset points",
            ha="right",
            fontsize=style.SMALL_PT,
            color=style.darker(style.VERMILION),
        )
        ax.set(xlabel="Poses", ylabel=f"{index}")
        ax.set_ylim(0.0, 1.18 * float(chosen.max()))
        ax.legend(loc="lower right")
        ax.set_title(_wrapped(f"{index}: {meaning}"), fontsize=style.SMALL_PT, loc="left")
        style.name_dataset(figure, dataset)
    return figure


def _wrapped(text: str) -> str:
    from textwrap import fill

    return fill(text, 56)
