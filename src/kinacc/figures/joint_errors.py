"""The errors of a VEC model over the range of every joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from kinacc.figures import style

_LINES = ((style.BLUE, "-"), (style.ORANGE, "--"), (style.GREEN, "-."))  # of x, y, z
_DEVIATIONS = 2.0


def draw(joints: np.ndarray, values: np.ndarray, std: np.ndarray, units: Sequence[str]) -> Figure:
    """Draw shifts and turns of every joint, with bands of two standard deviations.

    Parameters
    ----------
    joints
        Positions (k, m) of the joints, in ``units`` (k,).
    values, std
        Shifts along x, y, z in mm, then turns in mrad, (k, 6, m); ``std`` NaN where unknown.
    """
    with style.house():
        figure = style.new_figure(style.DOUBLE_COLUMN_IN, 1.15 * len(joints) + 0.5)
        panels = figure.subplots(len(joints), 2, sharey="col", squeeze=False)
        for (joint, kind), ax in np.ndenumerate(panels):
            for axis, (colour, dash) in enumerate(_LINES):
                value = values[joint, 3 * kind + axis]
                reach = _DEVIATIONS * std[joint, 3 * kind + axis]
                ends = value - reach, value + reach
                ax.fill_between(joints[joint], *ends, color=colour, alpha=0.15, lw=0)
                ax.plot(joints[joint], value, color=colour, ls=dash, label="xyz"[axis])
            ylabel = ("shift, mm", "turn, mrad")[kind]
            ax.set(xlabel=f"joint {joint + 1}, {units[joint]}", ylabel=ylabel)
        panels[0, 1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    return figure
