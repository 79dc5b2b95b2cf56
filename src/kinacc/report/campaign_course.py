"""Pictures of a campaign's course: the bounds as they grew, and the noise as it was seen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from bokeh.models import CDSView, ColumnDataSource, HoverTool, IndexFilter

from kinacc.assess.statement import CANDIDATES, MEASURED, REGION
from kinacc.campaign import consistency, instrument, words
from kinacc.campaign.state import State
from kinacc.report import pictures
from kinacc.report.page import Block, Picture, Table, Text
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, VERMILION
from kinacc.tables.columns import Columns

_MOMENTS = 25  # of the course, in its table
_LOOKS = {
    MEASURED: (BLUE, "solid", "circle"),
    CANDIDATES: (ORANGE, "dashed", "diamond"),
    REGION: (GREEN, "dotted", "square"),
}
_BOUNDS = (("upper_mm", "at most"), ("value_mm", "estimate"), ("lower_mm", "at least"))
_RARE = 1.94  # root of chi-square over its 3 degrees of freedom: 1 in 100 is above


def course(state: State, tables: Mapping[str, Columns], key: str) -> tuple[Block, ...]:
    """The bounds over the readings, and the moments as a table."""
    bounds = tables["campaign_bounds"]
    plot = pictures.figure("readings used", "largest error, mm")
    sizes = np.stack([np.asarray(bounds[name], dtype=float) for name, _ in _BOUNDS])
    told = np.isfinite(sizes).any(axis=0)
    of_each = {about: rows[told[rows]] for about, rows in _statements(bounds) if told[rows].any()}
    if not of_each:
        said = "Nothing can be said of the largest error yet, so there is no course to draw."
        return (Text(said), _as_table(bounds))
    data = _moments(bounds, of_each, key)
    marks, first = [], 0
    for about, rows in of_each.items():
        part = slice(first, first := first + len(rows))
        marks.append(_curves(plot, data, part, bounds["target"][rows[0]], about))
    hover = [
        ("", "@about, after @readings readings at @points_measured points"),
        *((said, f"@{name}{{0.000}} mm") for name, said in _BOUNDS),
    ]
    plot.add_tools(HoverTool(tooltips=hover, renderers=marks))
    planned = len(state.campaign.visit())
    plot.vspan(x=planned, line_color=GREY, line_dash="dotted")
    tolerance(plot, state)
    plot.legend.click_policy = "hide"
    plot.legend.orientation = "horizontal"
    plot.add_layout(plot.legend[0], "above")
    pictures.from_zero(plot)
    caption = (
        "Upper and lower bounds, the estimate between them. Up to the dotted line at "
        f"{planned} readings, points of the first visit are measured whatever is "
        f"read.{of_tolerance(state)} A click in the legend hides one."
    )
    details = {
        "about": "{}",
        "readings": "after {} readings",
        "points_measured": "at {} points",
        **{name: f"{said} {{}} mm" for name, said in _BOUNDS},
        "right": "each bound is right in {}",
        "rests": "{}",
    }
    last = "; ".join(words.statement(each, state) for each in words.distinct(state))
    drawn = Picture(
        f"{key}-bounds", plot, f"Bounds over the readings. At the end: {last}", caption,
        details=details, invitation="Select a moment to see what could be said then.",
    )  # fmt: skip
    return (drawn, _as_table(bounds))


def _statements(bounds: Columns) -> Iterator[tuple[str, np.ndarray]]:
    """What statements are about at the end, in words, and their rows."""
    target, share = np.asarray(bounds["target"]), np.asarray(bounds["share"], dtype=float)
    for each, part in dict.fromkeys(zip(target, share, strict=True)):
        rows = np.flatnonzero((target == each) & (share == part))
        yield _about(bounds, int(rows[-1])), rows


def _about(bounds: Columns, row: int) -> str:
    """What a statement is about: how many candidates it leaves out changes with the readings."""
    target, share, excepted = (bounds[name][row] for name in ("target", "share", "excepted"))
    return words.target_of(str(target), float(share), int(excepted))


def _moments(bounds: Columns, of_each: Mapping[str, np.ndarray], name: str) -> ColumnDataSource:
    """What could be said at which moment, the statements one after another."""
    rows = np.concatenate([*of_each.values()])
    columns = {each: np.asarray(bounds[each])[rows] for each in ("readings", "points_measured")}
    columns |= {each: np.asarray(bounds[each], dtype=float)[rows] for each, _ in _BOUNDS}
    upper, value = columns["upper_mm"], columns["value_mm"]
    columns["mark_mm"] = np.where(np.isfinite(upper), upper, value)
    texts = {
        "about": [_about(bounds, int(row)) for row in rows],
        "right": [
            words.how_often(each) if np.isfinite(each) else "no campaign that is known"
            for each in np.asarray(bounds["confidence"], dtype=float)[rows]
        ],
        "rests": [_rests(bounds, int(row)) for row in rows],
    }
    columns |= {each: np.array(values, dtype=object) for each, values in texts.items()}
    return pictures.source(name, columns)


def _rests(bounds: Columns, row: int) -> str:
    """Why no bound was stated then, or what it rested on beside the noise."""
    withheld, assumption = bounds["withheld"][row], bounds["assumption"][row]
    if withheld:
        return f"no upper bound: {withheld}"
    return f"if {assumption}" if assumption else "no assumption but the noise"


def _curves(plot, data: ColumnDataSource, part: slice, target: str, label: str):
    """Draw the bounds of a target, ``part`` of the data; the marks of its moments."""
    colour, dashes, marker = _LOOKS[target]
    names = ("readings", *(name for name, _ in _BOUNDS))
    mine = {name: np.asarray(data.data[name])[part] for name in names}
    both = np.isfinite(mine["lower_mm"]) & np.isfinite(mine["upper_mm"])
    between = pictures.source("", {name: values[both] for name, values in mine.items()})
    plot.varea(
        "readings", "lower_mm", "upper_mm", source=between, color=colour, alpha=0.12,
        legend_label=label,
    )  # fmt: skip
    course_of = pictures.source("", mine)
    for name, _ in _BOUNDS:
        estimate = name == "value_mm"
        plot.line(
            "readings", name, source=course_of, legend_label=label, line_color=colour,
            line_dash="dotdash" if estimate else dashes, line_width=1.0 if estimate else 2.0,
            line_alpha=0.7 if estimate else 1.0,
        )  # fmt: skip
    return plot.scatter(
        "readings", "mark_mm", source=data, size=5, marker=marker, color=colour,
        view=CDSView(filter=IndexFilter([*range(part.start, part.stop)])), legend_label=label,
        nonselection_alpha=0.4, selection_line_color=VERMILION, selection_fill_color=VERMILION,
    )  # fmt: skip


def tolerance(plot, state: State) -> None:
    """Draw the largest error allowed, where one was stated."""
    if state.plan.limits.tolerance_mm is not None:
        plot.hspan(y=state.plan.limits.tolerance_mm, line_color=VERMILION, line_dash="dashed")


def of_tolerance(state: State) -> str:
    """What that line is, for a caption."""
    allowed = state.plan.limits.tolerance_mm
    return "" if allowed is None else f" Dashed across: the tolerance, {allowed:g} mm."


def _as_table(bounds: Columns) -> Table:
    """Moments of the course, evenly spread, with the last."""
    moments = np.unique(np.asarray(bounds["readings"]))
    spread = np.unique(np.linspace(0, len(moments) - 1, _MOMENTS).round().astype(int))
    kept = np.flatnonzero(np.isin(bounds["readings"], moments[spread]))
    return Table(
        "The course in numbers: the largest error, mm",
        ("readings", "points", "of", *(said for _, said in _BOUNDS), "remark"),
        tuple(
            (
                str(int(bounds["readings"][row])),
                str(int(bounds["points_measured"][row])),
                _about(bounds, int(row)),
                *(mm(bounds[name][row]) for name, _ in _BOUNDS),
                _rests(bounds, int(row)),
            )
            for row in kept
        ),
        numeric=frozenset({0, 1, 3, 4, 5}),
        folded=True,
    )


def scatter(state: State, key: str) -> tuple[Block, ...]:
    """Repeated readings against the noise stated: every one, by instrument, and the verdict."""
    found = consistency.scatter(state)
    if found is None:
        said = "No point was read twice in a row, so nothing holds the noise stated to readings."
        return (Text(said),)
    apart = consistency.deviations(state)
    known = {each.number: each.reading for each in (*state.told, *state.in_hand)}
    numbers = sorted(apart)
    label = state.plan.points.label
    data = pictures.source(
        f"{key}-scatter",
        {
            "number": np.array(numbers),
            "apart": np.array([apart[each] for each in numbers]),
            "called": np.array([label[known[each].point] for each in numbers], dtype=object),
            "instrument": np.array([known[each].instrument for each in numbers], dtype=object),
        },
    )
    hover = [("reading", "@number, @instrument"), ("point", "@called"), ("times", "@apart{0.00}")]
    plot = pictures.figure("reading, in the order taken", "times the noise stated", hover=hover)
    plot.scatter(
        "number", "apart", source=data, size=7, color=BLUE, fill_alpha=0.6,
        nonselection_alpha=0.3, selection_line_color=VERMILION, selection_fill_color=VERMILION,
    )  # fmt: skip
    plot.hspan(y=1.0, line_color=GREY)
    plot.hspan(y=_RARE, line_color=VERMILION, line_dash="dotted")
    pictures.from_zero(plot)
    caption = (
        f"In all: {consistency.in_words(found)}. Where the noise is as stated, one reading in a "
        "hundred lies above the dotted line."
    )
    details = {
        "number": "reading {}",
        "instrument": "{}",
        "called": "point {}",
        "apart": "{} times the noise stated from the mean of those before in its block",
    }
    words_of = "Distances of repeated readings from the mean of those before in their block."
    drawn = Picture(
        f"{key}-repeats", plot, f"{words_of} {caption}", caption, details=details,
        invitation="Select a reading to see which it is.",
    )  # fmt: skip
    return drawn, _by_instrument(state, apart)


def _by_instrument(state: State, apart: Mapping[int, float]) -> Table:
    known = {each.number: each.reading.instrument for each in (*state.told, *state.in_hand)}
    rows = []
    for each in state.plan.instruments:
        mine = np.array(
            [apart[n] for n, named in known.items() if named == each.name and n in apart]
        )
        rms = f"{np.sqrt(np.mean(mine**2)):.2f}" if mine.size else "-"
        rows.append((each.name, instrument.noise(each), str(len(mine)), rms))
    return Table(
        "Scatter of repeated readings by instrument, over what the noise stated brings",
        ("instrument", "noise stated", "readings", "root mean square"),
        tuple(rows),
        numeric=frozenset({2, 3}),
    )


def mm(value: float) -> str:
    """A length as the tables show it; a dash where there is none."""
    return f"{value:.3f}" if np.isfinite(value) else "-"
