"""Pictures and tables of what a campaign measured: every point, every reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from bokeh.models import CDSView, ColumnDataSource, HoverTool, IndexFilter

from kinacc.campaign import instrument
from kinacc.campaign.report import beyond_limits, largest_read
from kinacc.campaign.state import State
from kinacc.report import pictures
from kinacc.report.campaign_course import mm, of_tolerance, tolerance
from kinacc.report.page import Block, Picture, Table, Text
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION
from kinacc.tables.columns import Columns

_MOST_POINTS = 4_000  # drawn one by one; of more every n-th is, and all of the largest
_MOST_ROWS = 300  # of a folded table
_INSTRUMENTS = ((BLUE, "circle"), (ORANGE, "triangle"), (GREEN, "square"), (PURPLE, "diamond"))


def points(state: State, tables: Mapping[str, Columns], key: str) -> tuple[Block, ...]:
    """The measured points with their limits, over size, visit and joints, and in space."""
    table = tables["campaign_points"]
    size = np.asarray(table["error_mm"], dtype=float)
    order = np.argsort(-size, kind="stable")
    order = order[np.isfinite(size[order])]
    if not order.size:
        return (Text("No point was measured and used yet."), *_not_measured(table))
    step = -(-len(order) // _MOST_POINTS)
    largest = largest_read(table)
    drawn = order[np.unique([*range(0, len(order), step), *range(len(largest))])]
    data = _point_data(state, table, order, drawn, key)
    hover = [
        ("point", "@called"),
        ("read", "@error_mm{0.000} mm, @how"),
        ("limits", "@lower_mm{0.000} to @upper_mm{0.000} mm"),
    ]
    place = {int(row): number for number, row in enumerate(drawn)}
    return (
        _sizes(state, data, hover, key),
        _in_space(state, table, data, hover, key),
        _table_of_points(table, largest, f"{key}-sizes", [place[int(row)] for row in largest]),
        *(Text(each) for each in _beyond(state, table, largest)),
        *([_all_points(table, order)] if len(order) > len(largest) else []),
        *_not_measured(table),
    )


def _beyond(state: State, table: Columns, largest: np.ndarray) -> list[str]:
    return [each for each in beyond_limits(table, largest, str) if each]


def _point_data(
    state: State, table: Columns, order: np.ndarray, drawn: np.ndarray, key: str
) -> ColumnDataSource:
    place = np.empty(len(table["point"]), dtype=int)
    place[order] = np.arange(1, len(order) + 1)
    count = np.asarray(table["readings"], dtype=int)[drawn]
    columns: dict[str, np.ndarray] = {
        name: np.asarray(table[name], dtype=float)[drawn]
        for name in ("error_mm", "lower_mm", "upper_mm", "visit")
    }
    columns |= {axis: np.asarray(table[f"{axis}_mm"], dtype=float)[drawn] for axis in "xyz"}
    for n, slides in enumerate(state.plan.slides):
        joint = np.asarray(table[f"q{n + 1}"], dtype=float)[drawn]
        columns[f"q{n + 1}"] = joint if slides else np.rad2deg(joint)
    columns |= {"place": place[drawn], "count": count}
    columns["called"] = np.asarray(table["point"]).astype(str).astype(object)[drawn]
    columns["how"] = np.array([_times(int(each)) for each in count], dtype=object)
    return pictures.source(key, columns)


def _times(count: int) -> str:
    return "read once" if count == 1 else f"mean of {count} readings"


def _sizes(state: State, data: ColumnDataSource, hover: list[tuple[str, str]], key: str) -> Picture:
    plot = pictures.figure("measured points, largest first", "error, mm")
    tolerance(plot, state)
    again = np.asarray(data.data["count"]) > 1
    limits = plot.segment(
        "place", "lower_mm", "place", "upper_mm", source=data, line_color=GREY, line_alpha=0.7,
        selection_line_color=VERMILION, legend_label="limits",
    )  # fmt: skip
    limits.glyph.name = f"{key}-limits"
    named = {f"{key}-limits": ("x0", "x1")}
    over = []
    for which, colour, marker, label in (
        (~again, BLUE, "circle", "read once"),
        (again, ORANGE, "diamond", "read again: the mean"),
    ):
        if not which.any():
            continue
        glyph = plot.scatter(
            "place", "error_mm", source=data, size=7, marker=marker, color=colour,
            view=CDSView(filter=IndexFilter(np.flatnonzero(which).tolist())), legend_label=label,
            nonselection_alpha=0.3, selection_line_color=VERMILION,
            selection_fill_color=VERMILION,
        )  # fmt: skip
        glyph.glyph.name = f"{key}-{marker}"
        named[f"{key}-{marker}"] = ("x",)
        over.append(glyph)
    plot.add_tools(HoverTool(tooltips=hover, renderers=over))
    plot.xaxis[0].name = f"{key}-axis"
    plot.legend.orientation = "horizontal"
    plot.add_layout(plot.legend[0], "above")
    pictures.from_zero(plot)
    joints = [
        (f"joint {n + 1}", f"q{n + 1}", f"joint {n + 1}, {'mm' if slides else 'deg'}")
        for n, slides in enumerate(state.plan.slides)
    ]
    control = pictures.choice(
        "Over",
        [
            ("size", "place", "measured points, largest first"),
            ("visit", "visit", "place in the order of the visit"),
            *joints,
        ],
        named,
        f"{key}-axis",
    )
    caption = (
        "What was read at each point, and the limits on what stays when it is measured again."
        f"{of_tolerance(state)}"
    )
    return Picture(
        f"{key}-sizes", plot, f"Errors of the measured points. {caption}", caption, (control,),
        details=_of_point(data),
    )  # fmt: skip


def _of_point(data: ColumnDataSource) -> dict[str, str]:
    joints = [name for name in data.data if name[:1] == "q" and name[1:].isdigit()]
    return {
        "called": "point {}",
        "error_mm": "{} mm",
        "how": "{}",
        "lower_mm": "at least {} mm",
        "upper_mm": "at most {} mm",
        **{name: f"J{name[1:]} {{}}" for name in joints},
        **{axis: f"{axis} {{}} mm" for axis in "xyz"},
    }


def _in_space(
    state: State, table: Columns, data: ColumnDataSource, hover: list[tuple[str, str]], key: str
) -> Picture:
    top = float(np.max(data.data["error_mm"])) or 1.0
    plot, control = pictures.in_space(f"{key}-space", data, "error_mm", top, "error, mm", hover)
    caption = (
        f"Where the model places the {state.plan.about['point']}, in the robot's base. Large "
        "errors together in one place are that region's, not chance."
    )
    unread = int(np.isnan(np.asarray(table["error_mm"], dtype=float)).sum())
    if unread:
        caption += f" {unread} candidates that were not measured are not shown."
    return Picture(
        f"{key}-space", plot, f"Errors in space. {caption}", caption, (control,),
        details=_of_point(data),
    )  # fmt: skip


def _table_of_points(
    table: Columns, rows: np.ndarray, picture: str = "", picks: list[int] | None = None
) -> Table:
    many = picks is None
    return Table(
        "All measured points, mm" if many else f"The {len(rows)} largest errors read, mm",
        ("point", "readings", "error read", "at least", "at most"),
        tuple(
            (
                str(table["point"][row]),
                str(int(table["readings"][row])),
                *(mm(table[f"{name}_mm"][row]) for name in ("error", "lower", "upper")),
            )
            for row in rows
        ),
        numeric=frozenset({1, 2, 3, 4}),
        folded=many,
        picked_in=picture,
        picks=tuple(picks or ()),
    )


def _all_points(table: Columns, order: np.ndarray) -> Table:
    return _shortened(_table_of_points(table, order[:_MOST_ROWS]), len(order), "points")


def _shortened(table: Table, count: int, what: str) -> Table:
    """A table whose caption says how many rows there would be."""
    if count <= len(table.rows):
        return table
    said = f"{table.caption}; the first {len(table.rows)} of {count} {what}"
    return replace(table, caption=said)


def _not_measured(table: Columns) -> tuple[Block, ...]:
    """Points left out, with the reason given."""
    left = [row for row, reason in enumerate(table["left_out"]) if reason]
    if not left:
        return ()
    return (
        Table(
            "Points left out, of which nothing is said",
            ("point", "reason given"),
            tuple((str(table["point"][row]), str(table["left_out"][row])) for row in left),
        ),
    )


def readings(state: State, tables: Mapping[str, Columns], key: str) -> tuple[Block, ...]:
    """Every reading in the order taken, what each instrument read, and what was struck."""
    table = tables["campaign_readings"]
    if not len(table["reading"]):
        return (Text("No reading was taken yet."),)
    void = np.array([bool(each) for each in table["struck"]])
    waiting = np.isnan(np.asarray(table["used"], dtype=float)) & ~void
    data = _reading_data(table, void, waiting, key)
    plot = pictures.figure("reading, in the order taken", "distance from the model, mm")
    tolerance(plot, state)
    names = np.asarray(table["instrument"]).astype(str)
    drawn = []
    for number, each in enumerate(state.plan.instruments):
        colour, marker = _INSTRUMENTS[number % len(_INSTRUMENTS)]
        mine = names == each.name
        for which, label, filled in (
            (mine & ~void & ~waiting, each.name, 0.6),
            (mine & waiting, f"{each.name}, not asked for yet", 0.0),
        ):
            if which.any():
                drawn.append(_marks(plot, data, which, marker, colour, label, filled))
    if void.any():
        drawn.append(_marks(plot, data, void, "x", VERMILION, "struck", 1.0))
    hover = [
        ("reading", "@number, @instrument"),
        ("point", "@called"),
        ("distance", "@error_mm{0.000} mm"),
        ("", "@standing"),
    ]
    plot.add_tools(HoverTool(tooltips=hover, renderers=drawn))
    plot.legend.orientation = "horizontal"
    plot.add_layout(plot.legend[0], "above")
    pictures.from_zero(plot)
    caption = f"How far every reading was from where the model has the point.{of_tolerance(state)}"
    details = {
        "number": "reading {}",
        "called": "point {}",
        "instrument": "{}",
        "error_mm": "{} mm from the model",
        **{f"e{axis}_mm": f"{axis} {{}}" for axis in "xyz"},
        "noise_mm": "noise stated {} mm",
        "standing": "{}",
    }
    picture = Picture(
        f"{key}-order", plot, f"Readings in the order taken. {caption}", caption, details=details,
        invitation="Select a reading to see what it is.",
    )  # fmt: skip
    return picture, _by_instrument(state, table, void, waiting), *_struck(table, void)


def _reading_data(
    table: Columns, void: np.ndarray, waiting: np.ndarray, key: str
) -> ColumnDataSource:
    standing = np.where(waiting, "taken, not asked for yet: not used", "used").astype(object)
    standing[void] = [f"struck: {each}" for each in np.asarray(table["struck"])[void]]
    columns = {name: np.asarray(table[name], dtype=float) for name in
               ("error_mm", "noise_mm", "ex_mm", "ey_mm", "ez_mm")}  # fmt: skip
    columns["number"] = np.asarray(table["reading"], dtype=int)
    columns["called"] = np.asarray(table["point"]).astype(str).astype(object)
    columns["instrument"] = np.asarray(table["instrument"]).astype(str).astype(object)
    return pictures.source(f"{key}-readings", {**columns, "standing": standing})


def _marks(plot, data, which: np.ndarray, marker: str, colour: str, label: str, filled: float):
    return plot.scatter(
        "number", "error_mm", source=data, size=7, marker=marker, color=colour, fill_alpha=filled,
        view=CDSView(filter=IndexFilter(np.flatnonzero(which).tolist())), legend_label=label,
        nonselection_alpha=0.3, selection_line_color=VERMILION,
        selection_fill_color=VERMILION,
    )  # fmt: skip


def _by_instrument(state: State, table: Columns, void: np.ndarray, waiting: np.ndarray) -> Table:
    names, size = np.asarray(table["instrument"]).astype(str), np.asarray(table["error_mm"])
    rows = []
    for each in state.plan.instruments:
        mine = names == each.name
        used = mine & ~void & ~waiting
        mean, most = (mm(how(size[used])) if used.any() else "-" for how in (np.mean, np.max))
        counts = (used, mine & waiting, mine & void)
        rows.append((each.name, instrument.noise(each), *(str(int(n.sum())) for n in counts),
                     mean, most))  # fmt: skip
    return Table(
        "By instrument; distances from the model, mm",
        ("instrument", "noise stated", "used", "not asked for", "struck", "mean", "largest"),
        tuple(rows),
        numeric=frozenset(range(2, 7)),
    )


def _struck(table: Columns, void: np.ndarray) -> tuple[Block, ...]:
    if not void.any():
        return ()
    rows = np.flatnonzero(void)
    return (
        Table(
            "Readings declared void",
            ("reading", "point", "distance, mm", "reason given"),
            tuple(
                (
                    str(int(table["reading"][row])),
                    str(table["point"][row]),
                    mm(table["error_mm"][row]),
                    str(table["struck"][row]),
                )
                for row in rows
            ),
            numeric=frozenset({0, 2}),
        ),
    )
