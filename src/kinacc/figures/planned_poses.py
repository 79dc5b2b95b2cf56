"""Observability index against the number of poses."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from kinacc.figures import style


def draw(index: np.ndarray, robot: str | None = None) -> Figure:
    """Draw the observability index against the number of poses.

    Parameters
    ----------
    index
        O1 (n,) after each added pose, the last one after all swaps, mm or mrad.
    robot
        Name above the figure.
    """
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 2.6)
        ax = figure.subplots()
        ax.plot(np.arange(1, len(index) + 1), index, color=style.BLUE, marker="o", ms=3)
        ax.set(
            xlabel="Poses", ylabel="O1 (mm or mrad)", ylim=(0.0, 1.18 * float(index.max()) or 1.0)
        )
        style.name_dataset(figure, robot)
    return figure
