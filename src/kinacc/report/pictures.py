"""Pictures of a page, drawn by Bokeh in the reader's browser: one style, one way of embedding."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import bokeh
import numpy as np
from bokeh.core.serialization import Serializer
from bokeh.document import Document
from bokeh.models import ColumnDataSource, HoverTool, Plot
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import figure as bokeh_figure
from bokeh.transform import linear_cmap

from kinacc.report.page import Control, Option

# Okabe and Ito's colours, of which those too light on one of the two backgrounds are left out.
BLUE, ORANGE, GREEN, VERMILION, PURPLE, GREY = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#8a8a8a",
)  # fmt: skip
COLOURMAP = "Viridis256"
_PLANES = (("x", "y"), ("x", "z"), ("y", "z"))
_HEIGHT_PX = 300
_ID = re.compile(r'"(p\d+)"')


def library() -> str:
    """The drawing library as text, as it comes with the package."""
    return (Path(bokeh.__file__).parent / "server/static/js/bokeh.min.js").read_text("utf-8")


def source(name: str, columns: Mapping[str, np.ndarray]) -> ColumnDataSource:
    """Columns of a picture's data under a name; numbers in single precision, as a screen needs."""
    small = {
        key: np.asarray(values, dtype=np.float32)
        if np.asarray(values).dtype.kind == "f"
        else np.asarray(values)
        for key, values in columns.items()
    }
    plain = {
        key: values.tolist() if values.dtype.kind in "OUS" else values
        for key, values in small.items()
    }
    return ColumnDataSource(plain, name=name)


def field(name: str) -> dict[str, str]:
    """What an option of a control sets where a glyph takes its values from a column."""
    return {"field": name}  # with a "type" beside it, as Python sends it, the browser draws nothing


def figure(
    x_label: str,
    y_label: str,
    title: str = "",
    height_px: int = _HEIGHT_PX,
    hover: Sequence[tuple[str, str]] = (),
    tools: str = "pan,box_zoom,tap,reset,save",
    **more: object,
) -> bokeh_figure:
    """An empty picture as wide as its place, with what hovering over a point says."""
    plot = bokeh_figure(
        height=height_px,
        sizing_mode="stretch_width",
        title=title or None,
        x_axis_label=x_label,
        y_axis_label=y_label,
        tools=tools,
        toolbar_location="right",
        **more,
    )
    plot.toolbar.logo = None
    plot.toolbar.autohide = True
    plot.background_fill_color = plot.border_fill_color = None
    plot.outline_line_color = None
    plot.min_border_right = 12
    if hover:
        plot.add_tools(HoverTool(tooltips=list(hover)))
    return plot


def hover(plot: bokeh_figure, said: Sequence[tuple[str, str]], *parts: GlyphRenderer) -> None:
    """What hovering over these ``parts`` of a picture says, where others say something else."""
    plot.add_tools(HoverTool(tooltips=list(said), renderers=list(parts), visible=False))


def legend_above(plot: bokeh_figure, columns: int = 2) -> None:
    """Put the legend where it covers nothing, in few columns; a click in it hides what it names."""
    (legend,) = plot.legend
    legend.update(click_policy="hide", orientation="horizontal", ncols=columns, nrows="auto")
    legend.label_text_font_size = "12px"
    plot.add_layout(legend, "above")


def from_zero(plot: bokeh_figure) -> None:
    """Let the axis of values begin at zero, so that sizes can be compared by eye."""
    plot.y_range.update(start=0.0)


def choice(
    label: str,
    choices: Sequence[tuple[str, str, str]],
    glyphs: Mapping[str, Sequence[str]],
    axis: str,
) -> Control:
    """A control of which column is drawn: ``choices`` are label, column, words of the axis.

    ``glyphs``: by name of a glyph the properties that are given the column; ``axis``: its name.
    """
    return Control(
        label,
        tuple(
            Option(
                said,
                (
                    *(
                        (name, each, field(column))
                        for name, properties in glyphs.items()
                        for each in properties
                    ),
                    (axis, "axis_label", words),
                ),
            )
            for said, column, words in choices
        ),
    )


def points(
    plot: bokeh_figure,
    data: ColumnDataSource,
    x: str,
    series: Sequence[tuple[str, str, str, str, float]],
    key: str,
) -> None:
    """Points of sizes over ``x``; ``series``: column, label, colour, marker and opacity of each."""
    for column, label, colour, marker, filled in series:
        drawn = plot.scatter(
            x, column, source=data, size=5, marker=marker, color=colour, fill_alpha=filled,
            line_alpha=0.6, legend_label=label, nonselection_alpha=0.25,
            selection_line_color=VERMILION, selection_fill_color=VERMILION,
        )  # fmt: skip
        drawn.glyph.name = f"{key}-{column}"
    legend_above(plot)
    from_zero(plot)


def over_joint(
    key: str,
    data: ColumnDataSource,
    slides: np.ndarray,
    series: Sequence[tuple[str, str, str, str, float]],
    y_label: str,
    hover: Sequence[tuple[str, str]],
) -> tuple[bokeh_figure, Control]:
    """Points of sizes over one of the joints ``q1`` to ``qk`` of the data, and which joint."""
    axes = [
        (f"{n}", f"q{n}", f"joint {n}, {'mm' if slide else 'deg'}")
        for n, slide in enumerate(slides, start=1)
    ]
    plot = figure(axes[0][2], y_label, hover=hover)
    points(plot, data, "q1", series, key)
    plot.xaxis[0].name = f"{key}-axis"
    glyphs = {f"{key}-{column}": ("x",) for column, *_ in series}
    return plot, choice("Joint", axes, glyphs, f"{key}-axis")


def in_space(
    name: str,
    data: ColumnDataSource,
    colour: str,
    top: float,
    title: str,
    hover: Sequence[tuple[str, str]],
) -> tuple[bokeh_figure, Control]:
    """Points at ``x``, ``y``, ``z`` of the data, mm, seen along an axis; the colour is a column's.

    All above ``top`` have the last colour; ``title`` is that of the colours.
    """
    plot = figure("x, mm", "y, mm", hover=hover, height_px=380, match_aspect=True)
    drawn = plot.scatter(
        "x",
        "y",
        source=data,
        size=6,
        color=linear_cmap(colour, COLOURMAP, 0.0, top),
        line_color=None,
        fill_alpha=0.9,
        nonselection_alpha=0.3,
        selection_line_color=VERMILION,
    )
    drawn.glyph.name = f"{name}-glyph"
    plot.xaxis[0].name, plot.yaxis[0].name = f"{name}-across", f"{name}-up"
    plot.add_layout(drawn.construct_color_bar(title=title, width=10), "right")
    axes = {"x": f"{name}-across", "y": f"{name}-up"}
    return plot, Control(
        "Axes",
        tuple(
            Option(
                f"{across} and {up}",
                (
                    *(
                        (f"{name}-glyph", side, field(column))
                        for side, column in (("x", across), ("y", up))
                    ),
                    *(
                        (axes[side], "axis_label", f"{column}, mm")
                        for side, column in (("x", across), ("y", up))
                    ),
                ),
            )
            for across, up in _PLANES
        ),
    )


def documents(
    plots: Sequence[Plot],
) -> tuple[dict[str, object], list[tuple[str, str]]]:
    """Documents as plain values by name, and for each plot its document and its root there.

    Plots that share data stand in one document, so that data is embedded once and a point that is
    selected in one is selected in all. Names count from 1 whatever was drawn before.
    """
    groups: list[tuple[set[str], list[Plot]]] = []
    for plot in plots:
        own = {each.data_source.id for each in plot.renderers if hasattr(each, "data_source")}
        near = [group for group in groups if group[0] & own]
        groups = [group for group in groups if group not in near]
        together = [each for group in near for each in group[1]]
        groups.append((own.union(*(group[0] for group in near)), [*together, plot]))
    # A document would look for the models of all its plots again for each that joins or leaves it.
    empty = Document().to_json(deferred=False)
    found: dict[str, object] = {}
    place: dict[str, tuple[str, str]] = {}
    for number, (_, group) in enumerate(groups, start=1):
        for plot in group:
            plot.references()  # makes models that are there by default, which are written too
        text = json.dumps({**empty, "roots": Serializer(deferred=False).encode(group)})
        names = {name: f"k{number}-{i}" for i, name in enumerate(dict.fromkeys(_ID.findall(text)))}
        text = _ID.sub(lambda match, names=names: f'"{names[match[1]]}"', text)
        found[f"d{number}"] = json.loads(text)
        place |= {plot.id: (f"d{number}", names[plot.id]) for plot in group}
    return found, [place[plot.id] for plot in plots]
