"""A robot's history: errors, movement and temperature over the lines of its series."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from kinacc.figures import style


def run(inputs: Mapping, settings: Mapping) -> Figure:
    """Of the table ``history`` of the data set."""
    history = inputs["history"]
    with style.house():
        figure = style.new_figure(style.SINGLE_COLUMN_IN, 2.6)
        axes = figure.subplots()
        axes.plot(history["date"].astype(str), history["held_out_mean_mm"], "o-")
        axes.set_ylabel("mean held-out error [mm]")
        style.name_dataset(figure, settings["dataset"])
    return figure
