"""Where two models differ most over the evaluation space: a map to explore, cell by cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from bokeh.models import (
    CDSView,
    ColumnDataSource,
    Filter,
    GroupFilter,
    LinearColorMapper,
)
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import figure as BokehFigure

from kinacc.figures.fig3 import colour_range
from kinacc.kinematics.robot import Robot
from kinacc.report import pictures
from kinacc.report.map_cells import Cells, cells, largest_of
from kinacc.report.page import Control, Option, Part, Picture, records
from kinacc.report.pictures import GREY, VERMILION
from kinacc.tables.columns import Columns

_KEY = "map"
_LARGEST = 10
_UNREACHED = "#b9b9bd"


class _Quantity(NamedTuple):
    """A column of the picture's data, what a control calls it, and its unit."""

    column: str
    label: str
    unit: str


_POSITION = _Quantity("position", "position", "mm")
_ORIENTATION = _Quantity("orientation", "orientation", "mrad")
_REACHED = _Quantity("reached", "share of poses reached", "%")
_QUANTITIES = (_POSITION, _ORIENTATION, _REACHED)


def section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on the cells of ``accuracy_map``."""
    table = tables["accuracy_map"]
    drawn = cells(table)
    none = np.asarray(table["solutions"]) == 0
    values = {
        "cells": len(none),
        "slices": [_degrees(each) for each in np.unique(table["slice_deg"])],
        "spans": {
            name: (np.min(table[f"{name}_mm"]), np.max(table[f"{name}_mm"]))
            for name in ("radius", "height")
        },
        "wanted": int(table["wanted"].max()),
        "unreached": int(none.sum()),
        "beyond": int((none & (np.asarray(table["extrapolating"]) > 0)).sum()),
        "whole": bool((drawn.reached == 1).all()),
        "partly": bool(((drawn.reached > 0) & (drawn.reached < 1)).any()),
        "merged": drawn.merged,
        "slides": any(robot.dh.prismatic),
        "largest": _largest(table, drawn, robot),
    }
    return Part(_KEY, values, (_picture(table, drawn, robot),))


def _degrees(angle: float) -> str:
    return f"{angle:g}\u00a0deg"


def _joints(table: Columns) -> list[str]:
    """Columns of the joints, none in tables that were made before there were any."""
    return [name for name in table if name[:1] == "q" and name[1:].isdigit()]


def _data(table: Columns, drawn: Cells, robot: Robot) -> tuple[ColumnDataSource, dict[str, Any]]:
    """What all parts of the picture share, and what numbers in it stand for."""
    poses = _poses(table)
    slices = np.unique(drawn.slice_deg)
    columns = {
        "slice": np.searchsorted(slices, drawn.slice_deg).astype(np.int8),
        "radius": drawn.radius_mm,
        "height": drawn.height_mm,
        "position": np.asarray(table["position_max_mm"])[drawn.farthest],
        "orientation": np.asarray(table["orientation_max_mrad"])[drawn.most_turned],
        "reached": 100.0 * drawn.reached,
        "some": (drawn.reached > 0).astype(np.int8),
        "partly": ((drawn.reached > 0) & (drawn.reached < 1)).astype(np.int8),
    }
    if drawn.merged:
        columns |= {"wide": drawn.wide_mm, "high": drawn.high_mm}
    for quantity in (_POSITION, _ORIENTATION):
        columns[f"top_{quantity.column}"] = _tops(columns["slice"], columns[quantity.column])
    names = {"slice": tuple(map(_degrees, slices))}
    for name, rows, of in (
        ("pose", drawn.farthest, "worst_branch"),
        ("turned", drawn.most_turned, "orientation_worst_branch"),
    ):
        columns[name] = np.array([poses.get(each, -1) for each in table[of][rows]], dtype=np.int16)
        names[name] = tuple(poses)
    for joint, name in enumerate(_joints(table)):
        values = np.asarray(table[name])[drawn.farthest]
        columns[name] = values if robot.dh.prismatic[joint] else np.rad2deg(values)
    return pictures.source(_KEY, columns), names


def _poses(table: Columns) -> dict[str, int]:
    """Every turn and branch that is the worst of some cell, numbered."""
    found = {*table["worst_branch"], *table["orientation_worst_branch"]} - {None}
    return {name: number for number, name in enumerate(sorted(map(str, found)))}


def _tops(of_slice: np.ndarray, values: np.ndarray) -> np.ndarray:
    """1 at the largest value of every slice, 0 elsewhere."""
    top = np.zeros(len(values), dtype=np.int8)
    top[largest_of(values, of_slice)] = 1
    return np.where(np.isnan(values), 0, top).astype(np.int8)


def _picture(table: Columns, drawn: Cells, robot: Robot) -> Picture:
    data, names = _data(table, drawn, robot)
    plot = pictures.figure("radius, mm", "height, mm", height_px=400)
    plot.grid.visible = False
    for along in (plot.x_range, plot.y_range):
        along.update(range_padding=0.02)
    shown = GroupFilter("slice", 0, name=f"{_KEY}-slice")
    _cells(
        plot, data, drawn, shown & GroupFilter("some", 0),
        [("", "@radius{0} mm out, @height{0} mm high: no pose reached")],
        fill_color=_UNREACHED, line_color=None, fill_alpha=0.5,
        hatch_pattern="/", hatch_color=GREY, hatch_scale=8.0,
    )  # fmt: skip
    parts = {each: _coloured(plot, data, drawn, shown, each) for each in _QUANTITIES}
    dots = shown & GroupFilter("partly", 1)
    _marks(plot, data, dots, size=3, color="#ffffff", line_color=None)
    for quantity in (_POSITION, _ORIENTATION):
        top = shown & GroupFilter(f"top_{quantity.column}", 1)
        for colour, width in (("#ffffff", 5), ("#1d1d1f", 2)):  # to be seen on every colour
            name = f"{_KEY}-{quantity.column}-ring-{width}"
            look = {"size": 18, "fill_color": None, "line_color": colour, "line_width": width}
            parts[quantity].append(_marks(plot, data, top, **look, name=name))
    for quantity, models in parts.items():
        for model in models:
            model.visible = quantity == _POSITION
    slices = tuple(
        Option(name, ((f"{_KEY}-slice", "group", number),))
        for number, name in enumerate(names["slice"])
    )
    quantities = tuple(
        Option(
            each.label,
            tuple(
                (model.name, "visible", quantity == each)
                for quantity, models in parts.items()
                for model in models
            ),
        )
        for each in _QUANTITIES
    )
    return Picture(
        _KEY,
        plot,
        controls=(Control("Slice", slices), Control("Quantity", quantities)),
        details=_details(data, robot),
        names=names,
        invitation="Select a cell to see its values, and the pose and joints of its largest "
        "difference.",
    )


def _cells(
    plot: BokehFigure, data: ColumnDataSource, drawn: Cells, filters: Filter,
    told: Sequence[tuple[str, str]], **look: object,
) -> GlyphRenderer:  # fmt: skip
    """Cells of a slice, and what hovering over them says."""
    width: float | str = "wide" if drawn.merged else float(drawn.wide_mm[0])
    height: float | str = "high" if drawn.merged else float(drawn.high_mm[0])
    view = CDSView(filter=filters)
    part = plot.rect("radius", "height", width, height, source=data, view=view, **look)
    part.selection_glyph = part.glyph.clone(line_color=VERMILION, line_width=3)
    part.nonselection_glyph = None  # what is not selected looks as before
    pictures.hover(plot, told, part)
    return part


def _coloured(
    plot: BokehFigure, data: ColumnDataSource, drawn: Cells, shown: Filter, quantity: _Quantity
) -> list[Any]:
    """The cells in the colours of a quantity, and their scale: one for all slices."""
    values = np.asarray(data.data[quantity.column], dtype=float)
    low, high = colour_range(values) if quantity != _REACHED else (0.0, 100.0)
    colour = {
        "field": quantity.column,
        "transform": LinearColorMapper(palette=pictures.COLOURMAP, low=low, high=high),
    }
    told = [
        ("", "@radius{0} mm out, @height{0} mm high"),
        ("position, mm", "@position{0.000}"),
        ("orientation, mrad", "@orientation{0.000}"),
        ("poses reached, %", "@reached{0}"),
    ]
    name = f"{_KEY}-{quantity.column}"
    part = _cells(
        plot, data, drawn, shown & GroupFilter("some", 1), told,
        fill_color=colour, line_color=colour, line_width=0.6, name=name,  # no gap between cells
    )  # fmt: skip
    bar = part.construct_color_bar(title=quantity.unit, width=10, name=f"{name}-scale")
    plot.add_layout(bar, "right")
    return [part, bar]


def _marks(
    plot: BokehFigure, data: ColumnDataSource, filters: Filter, **look: object
) -> GlyphRenderer:
    view = CDSView(filter=filters)
    mark = plot.scatter("radius", "height", source=data, view=view, **look)
    mark.nonselection_glyph = None
    return mark


def _details(data: ColumnDataSource, robot: Robot) -> dict[str, str]:
    joints = {
        name: f"J{name[1:]} {{}} {'mm' if robot.dh.prismatic[int(name[1:]) - 1] else 'deg'}"
        for name in data.data
        if name[:1] == "q" and name[1:].isdigit()
    }
    return {
        "slice": "slice {}",
        "radius": "radius {} mm",
        "height": "height {} mm",
        "reached": "{} % of its poses reached",
        "position": "largest position difference {} mm",
        "pose": "in pose {}",
        **joints,
        "orientation": "largest orientation difference {} mrad",
        "turned": "in pose {}",
    }


def _largest(table: Columns, drawn: Cells, robot: Robot) -> list[dict]:
    """The cells of the largest position differences, to be shown in the picture."""
    size = np.asarray(table["position_max_mm"], dtype=float)
    order = np.argsort(np.where(np.isnan(size), np.inf, -size), kind="stable")
    order = order[: min(_LARGEST, int(np.isfinite(size).sum()))]
    return [
        each
        | {
            "slice": _degrees(each["slice_deg"]),
            "pose": _in_one_piece(", ", str(each["worst_branch"]).split(", ")),
            "joints": _in_one_piece(",\u00a0", _worst_joints(table, row, robot)),
            "pick": int(drawn.of_row[row]),
            "choices": (("Slice", _degrees(each["slice_deg"])), ("Quantity", _POSITION.label)),
        }
        for row, each in zip(order, records(table, order), strict=True)
    ]


def _worst_joints(table: Columns, row: int, robot: Robot) -> list[str]:
    """Joints of the largest position difference of a cell, as a person types them."""
    values = [float(table[name][row]) for name in _joints(table)]
    return [
        f"{value if slides else np.rad2deg(value):.1f}"
        for value, slides in zip(values, robot.dh.prismatic, strict=False)
    ]


def _in_one_piece(between: str, words: Sequence[str]) -> str:
    """Words with nothing in them that a line could be broken at."""
    solid = (word.replace(" ", "\u00a0").replace("-", "\u2011") for word in words)
    return between.join(solid)
