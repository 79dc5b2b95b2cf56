"""Model invalidation step by step (Figs. 5 and 6): what was measured, and when it rejected."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from bokeh.models import CDSView, ColumnDataSource, GroupFilter
from bokeh.plotting import figure as BokehFigure

from kinacc.artifacts.columns import Columns
from kinacc.kinematics.robot import Robot
from kinacc.report import pictures
from kinacc.report.page import Control, Option, Picture, Section, Table
from kinacc.report.pictures import BLUE, GREY, ORANGE, VERMILION
from kinacc.report.study import Truth, truth

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


class _Example(NamedTuple):
    """Rows (n,) of one example by iteration, and what is the same in all of them."""

    name: str
    rows: np.ndarray
    eta_mm: float
    alpha: float
    noise_mm: float
    simulation: int

    @property
    def called(self) -> str:
        return _CALLED.get(self.name, self.name.replace("_", " "))


def _examples(histories: Columns) -> list[_Example]:
    there = list(dict.fromkeys(map(str, histories["example"])))
    found = []
    for name in sorted(there, key=lambda each: [*_CALLED, each].index(each)):
        mine = np.flatnonzero(np.asarray(histories["example"]) == name)
        mine = mine[np.argsort(histories["iteration"][mine], kind="stable")]
        first = mine[0]
        eta, alpha, noise = (float(histories[c][first]) for c in ("eta_mm", "alpha", "noise_mm"))
        found.append(_Example(name, mine, eta, alpha, noise, int(histories["simulation"][first])))
    return found


def section(tables: Mapping[str, Columns], robot: Robot) -> Section:
    """The section of a page on ``histories``, whose truth is that of ``study.truth``."""
    histories, held_to = tables["histories"], truth(tables)
    examples = _examples(histories)
    data = _data(histories, examples)
    shown = GroupFilter("example", 0, name=_SHOWN)
    errors = _magnitudes(examples, data, shown, held_to)
    starts = np.cumsum([0, *(len(each.rows) for each in examples[:-1])]).tolist()
    first = examples[0]
    return Section(
        "histories",
        "Model invalidation, reading by reading (Figs. 5 and 6)",
        f"{len(examples)} simulations of the study, {len(first.rows)} readings each, noise "
        f"{first.noise_mm:g} mm per axis; errors of the points: {held_to.what}",
        "Model invalidation tests one bound on the largest error. It measures a new point while "
        "the rejection probability is at most alpha, else the worst point again, whose readings "
        "it averages. If the probability is above alpha at the end, the bound is rejected.",
        "Good: a bound below the largest error is rejected, and the readings go to the points "
        "beyond it. Bad: a bound that is too small is not rejected, because the worst point was "
        "not reached or noise hid it.",
        "Nothing is to be done: this is how the paper's method works. For a bound with a "
        "confidence run a campaign (kinacc campaign start).",
        (
            errors,
            _probability(data, shown, errors),
            _outcomes(histories, examples, held_to),
            *(_again(histories, *each) for each in zip(examples, starts, strict=True)),
        ),
    )


def _data(histories: Columns, examples: list[_Example]) -> ColumnDataSource:
    rows = np.concatenate([each.rows for each in examples])
    number = np.repeat(np.arange(len(examples), dtype=np.int8), [len(e.rows) for e in examples])
    columns: dict[str, np.ndarray] = {"example": number}
    for name in ("iteration", "point", "repeat"):
        columns[name] = np.asarray(histories[name])[rows].astype(np.int32)
    for name in ("measured", "averaged", "true"):
        columns[name] = np.asarray(histories[f"{name}_mm"])[rows]
    columns["probability"] = np.asarray(histories["rejection_probability"])[rows]
    columns["eta"] = np.asarray(histories["eta_mm"])[rows]
    columns["alpha"] = np.asarray(histories["alpha"])[rows]
    columns["again"] = (columns["repeat"] > 1).astype(np.int8)
    columns["from"], columns["to"] = columns["iteration"] - 0.5, columns["iteration"] + 0.5
    return pictures.source("histories", columns)


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
    examples: list[_Example], data: ColumnDataSource, shown: GroupFilter, held_to: Truth
) -> Picture:
    plot = pictures.figure("iteration", "size of the error, mm", height_px=360)
    _level(plot, data, shown, "true", color=GREY, line_width=2, legend_label="error of the point")
    _parts(plot, data, shown, {0: "measured", 1: "averaged"})
    _level(plot, data, shown, "eta", color=VERMILION, line_width=2, legend_label="bound tested")
    ends = np.array([0.5, max(len(each.rows) for each in examples) + 0.5])
    plot.line(
        ends,
        held_to.largest_mm,
        color=GREY,
        line_width=2.5,
        line_dash="8 4",
        legend_label=held_to.called,
    )
    pictures.from_zero(plot)
    pictures.legend_above(plot)
    caption = "Each reading in the order taken. Diamonds: a point read again, and the average."
    options = tuple(
        Option(each.called, ((_SHOWN, "group", number),)) for number, each in enumerate(examples)
    )
    control = Control("Example", options)
    return Picture(
        "history-errors", plot, f"Errors over the readings of one simulation. {caption}", caption,
        (control,), _DETAILS,
    )  # fmt: skip


def _probability(data: ColumnDataSource, shown: GroupFilter, beside: Picture) -> Picture:
    plot = pictures.figure("iteration", "rejection probability", height_px=260)
    plot.x_range = beside.plot.x_range
    _level(plot, data, shown, "alpha", color=GREY, line_width=2, legend_label="alpha")
    _parts(plot, data, shown, {0: "probability", 1: "probability"})
    plot.y_range.update(start=-0.03, end=1.03)
    pictures.legend_above(plot)
    caption = (
        "The probability after each reading. Above alpha the next reading is at the worst point "
        "again. Example, selection and range are those of the picture above."
    )
    return Picture(
        "history-probability", plot, f"Rejection probability over the readings. {caption}", caption,
        details=_DETAILS,
    )  # fmt: skip


def _outcomes(histories: Columns, examples: list[_Example], held_to: Truth) -> Table:
    rows, remarks = [], {}
    for number, each in enumerate(examples):
        final = float(histories["rejection_probability"][each.rows[-1]])
        repeats = int((np.asarray(histories["repeat"])[each.rows] > 1).sum())
        rows.append(
            (
                each.called,
                str(each.simulation),
                f"{each.eta_mm:.3f}",
                f"{each.alpha:g}",
                f"{final:.3f}",
                "rejected" if final > each.alpha else "not rejected",
                str(len(np.unique(np.asarray(histories["point"])[each.rows]))),
                str(repeats),
            )
        )
        if not histories["rule_met"][each.rows[0]]:
            remarks[number] = f"the nearest there is: {histories['rule'][each.rows[0]]}"
    heads = (
        *("example", "simulation", "bound, mm", "alpha", "probability at the end", "outcome"),
        *("points", "readings again"),
    )
    caption = f"What became of the bounds; {held_to.called}: {held_to.largest_mm:.3f} mm"
    return Table(caption, heads, tuple(rows), frozenset({1, 2, 3, 4, 6, 7}), remarks)


def _again(histories: Columns, each: _Example, first_row: int) -> Table:
    """Points that were measured more than once, those of most readings first."""
    point, repeat = (np.asarray(histories[name])[each.rows] for name in ("point", "repeat"))
    last = {int(p): i for i, p in enumerate(point)}
    known = sorted(
        (p for p, i in last.items() if repeat[i] > 1), key=lambda p: (-repeat[last[p]], p)
    )
    rows = []
    for p in known:
        row = each.rows[last[p]]
        true = float(histories["true_mm"][row])
        rows.append(
            (
                str(p),
                str(int(np.flatnonzero(point == p)[0]) + 1),
                str(repeat[last[p]]),
                f"{histories['averaged_mm'][row]:.3f}",
                f"{true:.3f}",
                "yes" if true > each.eta_mm else "no: noise alone",
            )
        )
    heads = (
        *("point", "first at iteration", "readings", "average, mm", "error of the point, mm"),
        "beyond the bound",
    )
    return Table(
        f"{each.called[0].upper()}{each.called[1:]}: points measured again",
        heads,
        tuple(rows),
        frozenset(range(5)),
        folded=True,
        picked_in="history-errors",
        picks=tuple(first_row + last[p] for p in known),
        choices=((("Example", each.called),),) * len(rows),
    )
