"""Charts that a reader explores in the browser: residuals of every row, and the accuracy map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from bokeh.layouts import column, row
from bokeh.models import (
    CDSView,
    ColumnDataSource,
    CustomJS,
    GroupFilter,
    HoverTool,
    LayoutDOM,
    LinearColorMapper,
)
from bokeh.models.widgets import Select
from bokeh.plotting import figure as bokeh_figure

from kinacc.figures import style
from kinacc.figures.fig3 import colour_range

GREY = "#8a8a8a"
_QUANTITIES = {
    "position, mm": "position",
    "orientation, mrad": "orientation",
    "poses reached, %": "reached",
}
_UNREACHED = "#b9b9bd"


def residuals(
    rows: pd.DataFrame, models: Mapping[str, str], joints: Sequence[str], top_mm: float
) -> LayoutDOM:
    """Position errors over the file, over a joint and in space, of the same rows.

    Parameters
    ----------
    rows
        ``order``, ``name``, the joints, ``x``, ``y``, ``z`` in mm, and an error in mm by model.
    models
        Label by model, the nominal one first and the selected one last.
    joints
        Columns of the joints with their units, e.g. ``J1, deg``.
    top_mm
        Error of the selected model from which all rows have the last colour.
    """
    data = ColumnDataSource(_small(rows))
    tips = [("", "@name")]
    tips += [(label, f"@{{{model}}}{{0.000}} mm") for model, label in models.items()]
    looks = dict(zip(models, (("triangle", GREY), ("circle", style.BLUE)), strict=False))
    plots, glyphs = [], []
    for x, label in (("order", "row"), (joints[0], joints[0])):
        plot = _figure(label, "position error, mm", tips)
        for model, (marker, colour) in looks.items():
            drawn = plot.scatter(
                x, model, source=data, marker=marker, color=colour, size=5, fill_alpha=0.5,
                legend_label=models[model], nonselection_alpha=0.2, selection_color=style.VERMILION,
            )  # fmt: skip
            glyphs.append(drawn.glyph)
        plot.legend.update(click_policy="hide", orientation="horizontal")
        plot.add_layout(plot.legend[0], "above")
        plot.y_range.update(start=0.0)
        plots.append(plot)
    over_file, over_joint = plots
    space = _figure("x, mm", "y, mm", tips, height=380, match_aspect=True)
    mapper = LinearColorMapper(palette="Viridis256", low=0.0, high=top_mm)
    field = {"field": list(models)[-1], "transform": mapper}
    places = space.scatter(
        "x", "y", source=data, size=6, line_color=None, color=field, nonselection_alpha=0.3
    )
    space.add_layout(places.construct_color_bar(title="mm", width=10), "right")
    joint = _select(
        "Joint", joints,
        "for (const g of glyphs) g.x = {field: this.value}; axis.axis_label = this.value",
        glyphs=glyphs[len(looks) :], axis=over_joint.xaxis[0],
    )  # fmt: skip
    plane = _select(
        "Plane", ["x and y", "x and z", "y and z"],
        "const [a, b] = this.value.split(' and '); glyph.x = {field: a}; "
        "glyph.y = {field: b}; across.axis_label = a + ', mm'; up.axis_label = b + ', mm'",
        glyph=places.glyph, across=space.xaxis[0], up=space.yaxis[0],
    )  # fmt: skip
    return column(over_file, joint, over_joint, plane, space, sizing_mode="stretch_width")


def accuracy_map(cells: pd.DataFrame, width_mm: float, height_mm: float) -> LayoutDOM:
    """Cells of the accuracy map, one slice at a time.

    Parameters
    ----------
    cells
        ``slice`` (text), ``radius`` and ``height`` in mm, ``position`` in mm, ``orientation`` in
        mrad, ``reached`` in %, ``pose`` and ``joints`` of the largest position difference (text).
    width_mm, height_mm
        Size of a cell.
    """
    data = ColumnDataSource(_small(cells))
    slices = list(cells["slice"].unique())
    shown = GroupFilter(column_name="slice", group=slices[0])
    tips = [
        ("", "@radius{0} mm out, @height{0} mm high"),
        ("position", "@position{0.000} mm"),
        ("orientation", "@orientation{0.000} mrad"),
        ("poses reached", "@reached{0} %"),
        ("pose", "@pose"),
        ("joints", "@joints"),
    ]
    plot = _figure("radius, mm", "height, mm", tips, height=420)
    mappers = {}
    for name in _QUANTITIES.values():
        low, high = (0.0, 100.0) if name == "reached" else colour_range(cells[name].to_numpy())
        mappers[name] = LinearColorMapper(
            palette="Viridis256", low=low, high=high, nan_color=_UNREACHED
        )
    drawn = plot.rect(
        "radius", "height", width_mm, height_mm, source=data, view=CDSView(filter=shown),
        fill_color={"field": "position", "transform": mappers["position"]}, line_color=None,
        nonselection_alpha=1.0,
    )  # fmt: skip
    bar = drawn.construct_color_bar(title="position, mm", width=10)
    plot.add_layout(bar, "right")
    plot.grid.visible = False
    piece = _select("Slice", slices, "shown.group = this.value; data.change.emit()",
                    shown=shown, data=data)  # fmt: skip
    quantity = _select(
        "Quantity", [*_QUANTITIES],
        "const name = names[this.value]; const mapper = mappers[name]; "
        "glyph.fill_color = {field: name, transform: mapper}; "
        "bar.color_mapper = mapper; bar.title = this.value",
        glyph=drawn.glyph, bar=bar, mappers=mappers, names=_QUANTITIES,
    )  # fmt: skip
    return column(row(piece, quantity), plot, sizing_mode="stretch_width")


def _select(title: str, options: Sequence[str], code: str, **values: object) -> Select:
    """A choice whose change runs ``code`` on the ``values``; the first option is chosen."""
    choices: list[str | tuple[Any, str]] = [*options]
    select = Select(title=title, options=choices, value=options[0], width=160)
    select.js_on_change("value", CustomJS(args=values, code=code))
    return select


def _small(table: pd.DataFrame) -> dict[str, np.ndarray | list[str]]:
    """Columns for the browser: numbers in single precision."""
    return {
        str(name): values.to_numpy(np.float32)
        if pd.api.types.is_numeric_dtype(values)
        else list(map(str, values))
        for name, values in table.items()
    }


def _figure(
    x_label: str, y_label: str, tips: Sequence[tuple[str, str]], height: int = 300, **more: Any
) -> Any:
    plot = bokeh_figure(
        height=height,
        sizing_mode="stretch_width",
        x_axis_label=x_label,
        y_axis_label=y_label,
        tools="pan,box_zoom,tap,reset,save",
        **more,
    )
    plot.toolbar.update(logo=None, autohide=True)
    plot.add_tools(HoverTool(tooltips=list(tips)))
    return plot
