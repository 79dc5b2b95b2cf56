"""Corrections of a robot program, position by position."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from kinacc.figures import style


def draw(table: pd.DataFrame) -> Figure:
    """Changes in mm and mrad by position; refused positions are marked at zero."""
    with style.house():
        figure = Figure(figsize=(7.0, 5.0), layout="constrained")
        axes = figure.subplots(2, 1, sharex=True)
        places = range(len(table))
        refused = [place for place in places if table["status"].iloc[place] != "corrected"]
        for axis, column, label in zip(
            axes,
            ("change_mm", "change_mrad"),
            ("position change (mm)", "orientation change (mrad)"),
            strict=True,
        ):
            values = table.get(column, pd.Series(0.0, table.index))
            axis.bar(places, values.fillna(0.0), color="0.5")
            axis.plot(refused, [0.0] * len(refused), "rx", clip_on=False)
            axis.set_ylabel(label)
        names = [f"{name}" for name in table["position"]]
        if len(names) <= 40:
            axes[-1].set_xticks(list(places), names, rotation=90)
        axes[-1].set_xlabel("position" + ("; refused: x" if refused else ""))
        return figure
