"""Corrections of a robot program, position by position."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from kinacc.figures import style


def draw(table: pd.DataFrame) -> Figure:
    """Draw the correction of every position of a program.

    Parameters
    ----------
    table
        ``position``, ``status``, ``change_mm`` and ``change_mrad``; positions that are not
        ``corrected`` have no bar.
    """
    moved = table.where(table["status"] == "corrected")
    with style.house():
        figure = Figure(figsize=(7.0, 5.0), layout="constrained")
        axes = figure.subplots(2, 1, sharex=True)
        for axis, unit in zip(axes, ("mm", "mrad"), strict=True):
            axis.bar(moved.index, moved.get(f"change_{unit}", 0.0), color="0.5")
            axis.set_ylabel(f"change ({unit})")
        if len(table) <= 40:
            axes[1].set_xticks(table.index, table["position"], rotation=90)
        axes[1].set_xlabel("position")
        return figure
