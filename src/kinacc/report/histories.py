"""Model invalidation step by step (Figs. 5 and 6): what was measured, and when it rejected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from bokeh.models import CDSView, ColumnDataSource, GroupFilter
from bokeh.plotting import figure as BokehFigure

from kinacc.kinematics.robot import Robot
from kinacc.report import pictures
from kinacc.report.page import Control, Option, Part, Picture, records
from kinacc.report.pictures import BLUE, GREY, ORANGE, VERMILION
from kinacc.report.study import TRUE, Truth, truth
from kinacc.tables.columns import Columns

_CALLED = {
    "rejected": "Fig. 5: the bound is rejected",
    "rejected_larger_eta": "the same readings, a slightly larger bound",
    "not_rejected": "Fig. 6: the bound is not rejected",
}
_SHOWN = "history-example"
_DETAILS = {
    "iteration": "iteration {}",
    "point": "point {}",
    "repeat": "reading {} of it",
    "measured": "read {} mm",
    "averaged": "average {} mm",
    "true": "error of the point {} mm",
    "eta": "bound {} mm",
    "probability": "rejection probability {}",
}


def section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on ``histories``, whose truth is that of ``study.truth``."""
    rows, held_to = records(tables["histories"]), truth(tables)
    names = list(dict.fromkeys([*_CALLED, *(str(each["example"]) for each in rows)]))
    rows.sort(key=lambda each: (names.index(each["example"]), each["iteration"]))
    examples: dict[str, list[dict]] = {}
    for number, row in enumerate(rows):
        examples.setdefault(row["example"], []).append(row | {"pick": number})
    called = {each: _CALLED.get(each, each.replace("_", " ")) for each in examples}
    data = _data(rows, list(examples))
    shown = GroupFilter("example", 0, name=_SHOWN)
    options = tuple(
        Option(label, ((_SHOWN, "group", number),)) for number, label in enumerate(called.values())
    )
    errors = _magnitudes(data, shown, held_to, Control("Example", options))
    values = {
        "truth": held_to,
        "outcomes": [_outcome(called[name], each) for name, each in examples.items()],
        "again": {called[name]: _again(each) for name, each in examples.items()},
        "readings": len(next(iter(examples.values()))),
        "noise_mm": rows[0]["noise_mm"],
    }
    return Part("histories", values, (errors, _probability(data, shown, errors)))


def _data(rows: Sequence[Mapping], examples: Sequence[str]) -> ColumnDataSource:
    columns = {name: np.array([each[name] for each in rows]) for name in rows[0]}
    data = {"example": np.array([examples.index(each["example"]) for each in rows], np.int8)}
    data |= {name: columns[name].astype(np.int32) for name in ("iteration", "point", "repeat")}
    for name in ("measured", "averaged", "true", "eta"):
        data[name] = columns[f"{name}_mm"]
    data |= {"probability": columns["rejection_probability"], "alpha": columns["alpha"]}
    data["again"] = (columns["repeat"] > 1).astype(np.int8)
    data |= {"from": columns["iteration"] - 0.5, "to": columns["iteration"] + 0.5}
    return pictures.source("histories", data)


def _outcome(called: str, rows: Sequence[Mapping]) -> dict:
    """What became of the bound of an example."""
    final = rows[-1]
    beyond = final["rejection_probability"] > final["alpha"]
    found = {
        "called": called,
        "outcome": "rejected" if beyond else "not rejected",
        "points": len({each["point"] for each in rows}),
        "repeats": sum(each["repeat"] > 1 for each in rows),
    }
    if not final["rule_met"]:
        found["remark"] = f"the nearest there is: {final['rule']}"
    return {**final, **found}


def _again(rows: Sequence[Mapping]) -> list[dict]:
    """The last reading of every point that was measured more than once, most readings first."""
    first: dict[int, int] = {}
    for row in rows:
        first.setdefault(row["point"], row["iteration"])
    last = {row["point"]: {**row, "first": first[row["point"]]} for row in rows}
    again = [each for each in last.values() if each["repeat"] > 1]
    return sorted(again, key=lambda each: (-each["repeat"], each["point"]))


def _parts(
    plot: BokehFigure, data: ColumnDataSource, shown: GroupFilter, y: Mapping[int, str]
) -> None:
    """Points of the iterations: at new points of the study, and at those measured again."""
    looks = {
        0: ("first reading", "circle", BLUE),
        1: ("average, read again", "diamond", ORANGE),
    }
    for again, (label, marker, colour) in looks.items():
        part = plot.scatter(
            "iteration", y[again], source=data, marker=marker, color=colour, size=6 + 2 * again,
            view=CDSView(filter=shown & GroupFilter("again", again)), legend_label=label,
            nonselection_alpha=0.5, selection_color=VERMILION,
        )  # fmt: skip
        told = [
            ("", "iteration @iteration: reading @repeat of point @point"),
            ("read, mm", "@measured{0.000}"),
            ("average, mm", "@averaged{0.000}"),
            ("error of the point, mm", "@true{0.000}"),
            ("rejection probability", "@probability{0.000}"),
        ]
        pictures.hover(plot, told, part)


def _level(
    plot: BokehFigure, data: ColumnDataSource, shown: GroupFilter, y: str, **look: object
) -> None:
    """A value of every iteration as a short line of its own."""
    part = plot.segment("from", y, "to", y, source=data, view=CDSView(filter=shown), **look)
    part.nonselection_glyph = None


def _magnitudes(
    data: ColumnDataSource, shown: GroupFilter, held_to: Truth, control: Control
) -> Picture:
    plot = pictures.figure("iteration", "size of the error, mm", height_px=360)
    _level(plot, data, shown, "true", color=GREY, line_width=2, legend_label="error of the point")
    _parts(plot, data, shown, {0: "measured", 1: "averaged"})
    _level(plot, data, shown, "eta", color=VERMILION, line_width=2, legend_label="bound tested")
    ends = np.array([0.5, np.max(data.data["to"])])
    plot.line(ends, held_to.largest_mm, **TRUE, legend_label=held_to.called)
    pictures.from_zero(plot)
    pictures.legend_above(plot)
    return Picture("history-errors", plot, controls=(control,), details=_DETAILS)


def _probability(data: ColumnDataSource, shown: GroupFilter, beside: Picture) -> Picture:
    plot = pictures.figure("iteration", "rejection probability", height_px=260)
    plot.x_range = beside.plot.x_range
    _level(plot, data, shown, "alpha", color=GREY, line_width=2, legend_label="alpha")
    _parts(plot, data, shown, {0: "probability", 1: "probability"})
    plot.y_range.update(start=-0.03, end=1.03)
    pictures.legend_above(plot)
    return Picture("history-probability", plot, details=_DETAILS)
