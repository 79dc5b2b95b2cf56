"""Which model is selected and why, and which order the VEC model has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.error_models import PLAINEST, model_name
from kinacc.calibration import summary_words
from kinacc.calibration.model_comparison import STANDARD_ERRORS
from kinacc.calibration.summary import Fact
from kinacc.calibration.summary_words import counted
from kinacc.report import pictures
from kinacc.report.page import Block, Control, Option, Picture, Section, Table, Text, printed
from kinacc.report.pictures import BLUE, VERMILION

_NONE = "–"
_FIGURES = {  # of an order: what it is called, and its digits
    "held_out_rms_mm": ("held-out rms, mm", 4),
    "excess_mm2": ("squared error beyond the best, mm²", 5),
}

_PRIOR = {
    "prior, mm": "prior_std_mm",
    "prior, mrad": "prior_std_mrad",
    "decay": "prior_decay",
}


def section(tables: Mapping[str, Columns], facts: Sequence[Fact]) -> Section:
    """The section of a page on ``model_selection`` and ``vec_orders``; ``facts`` of ``summary``."""
    choice = tables["model_selection"]
    count = np.nanmax(np.asarray(choice["configurations"], dtype=float), initial=0.0)
    held_out = f"position errors at {counted(count, 'configuration')}, each held out of its fit"
    return Section(
        "selection",
        "Model selection",
        held_out if count else "no pose was held out: nothing to compare models by",
        "How the models do at poses that their fit has not seen, and which one the commands use "
        f"unless told otherwise. {model_name(PLAINEST)} is selected unless another takes off its "
        f"squared error more than {STANDARD_ERRORS:g} standard errors, and rms and mean of folds "
        "fall too.",
        "Good: the selected model gains many standard errors, and the order lies where the curve "
        "is flat. Bad: no model is nearer to held-out poses than the nominal; the highest order "
        "that was tried is the best, and a higher one may do more.",
        "Keep the selected model unless your controller takes DH parameters only (kinacc export "
        "--model dh). With order: auto the order is "
        "chosen anew by held-out errors, up to calibration.vec.order_highest (40 at most).",
        (
            *(Text(f"{each[:1].upper()}{each[1:]}.") for each in _why(facts)),
            _models(tables),
            *_orders(tables.get("vec_orders")),
        ),
    )


def _why(facts: Sequence[Fact]) -> list[str]:
    return [printed(each) for each in summary_words.selected(facts)]


def _models(tables: Mapping[str, Columns]) -> Table:
    choice = tables["model_selection"]
    rows, marked = [], {}
    for i, model in enumerate(map(str, choice["model"])):
        order = tables.get(f"{model}_model", {}).get("order")
        gain, error = (float(choice[name][i]) for name in ("gain_mm2", "gain_std_error_mm2"))
        plainest = model == PLAINEST or not np.isfinite(gain)
        rows.append(
            (
                model_name(model),
                _NONE if order is None else f"{int(np.max(order))}",
                _number(choice["held_out_rms_mm"][i], 3),
                _number(choice["mean_of_folds_mm"][i], 3),
                _NONE if plainest else f"{gain:+.4f}",
                _NONE if plainest else _number(error, 4),
                _NONE if plainest or not error > 0.0 else f"{gain / error:+.1f}",
            )
        )
        if choice["selected"][i]:
            marked[i] = "selected"
    plain = model_name(PLAINEST)
    heads = (
        "model",
        "order",
        "held-out rms, mm",
        "mean of folds, mm",
        f"squared error taken off that of {plain}, mm²",
        "standard error",
        "in standard errors",
    )
    return Table("Models at held-out poses", heads, tuple(rows), frozenset(range(1, 7)), marked)


def _number(value: float, digits: int) -> str:
    return f"{float(value):.{digits}f}" if np.isfinite(value) else _NONE


def _orders(table: Columns | None) -> list[Block]:
    """Orders tried by held-out errors; one that is stated is said."""
    if table is None:
        return []
    known = np.isfinite(np.asarray(table["held_out_rms_mm"], dtype=float))
    if not known.any():
        order = int(table["order"][np.flatnonzero(np.asarray(table["chosen"]) == 1)[0]])
        told = f"The order of the VEC model, {order}, is stated and no other was tried"
        return [Text(f"{told} (calibration.vec.order: auto tries several).")]
    final = np.flatnonzero(known & np.isnan(np.asarray(table["fold"], dtype=float)))
    tried = [_over_order(table, final), _tried(table, final)] if len(final) else []
    return [*tried, _chosen(table)]


def _over_order(table: Columns, rows: np.ndarray) -> Picture:
    """Held-out errors over the order, of the choice that has seen all rows."""
    rows = rows[np.argsort(np.asarray(table["order"])[rows], kind="stable")]
    columns = {name: np.asarray(table[name], dtype=float)[rows] for name in _FIGURES}
    spread = np.asarray(table["excess_std_error_mm2"], dtype=float)[rows]
    chosen = np.asarray(table["chosen"])[rows] == 1
    columns |= {
        "order": np.asarray(table["order"])[rows],
        "std_error": spread,
        "low": columns["excess_mm2"] - spread,
        "high": columns["excess_mm2"] + spread,
        "none": np.full(len(rows), np.nan),
        "chosen": np.where(chosen, 14.0, 0.0),
        "prior_std_mm": np.asarray(table["prior_std_mm"], dtype=float)[rows],
    }
    data = pictures.source("orders", columns)
    first, second = _FIGURES
    plot = pictures.figure(
        "order of the VEC model",
        _FIGURES[first][0],
        hover=[
            ("order", "@order"),
            *((name, f"@{each}{{0.{'0' * digits}}}") for each, (name, digits) in _FIGURES.items()),
            ("standard error", "@std_error{0.00000}"),
            ("prior, mm", "@prior_std_mm"),
        ],
    )
    line = plot.line("order", first, source=data, color=BLUE, line_width=1.5)
    bars = plot.segment("order", "none", "order", "none", source=data, color=BLUE, line_width=1.5)
    dots = plot.scatter("order", first, source=data, size=6, color=BLUE)
    ring = plot.scatter(
        "order",
        first,
        source=data,
        size="chosen",
        fill_color=None,
        line_color=VERMILION,
        line_width=2.5,
        legend_label="chosen",
    )
    for glyph, name in ((line, "line"), (bars, "bars"), (dots, "dots"), (ring, "ring")):
        glyph.glyph.name = f"orders-{name}"
    plot.yaxis[0].name = "orders-axis"
    options = tuple(
        Option(
            label,
            (
                *(
                    (f"orders-{part}", "y", pictures.field(name))
                    for part in ("line", "dots", "ring")
                ),
                ("orders-bars", "y0", pictures.field("low" if name == second else "none")),
                ("orders-bars", "y1", pictures.field("high" if name == second else "none")),
                ("orders-axis", "axis_label", label),
            ),
        )
        for name, (label, _) in _FIGURES.items()
    )
    caption = (
        "Errors of poses left out of a fit while the order was chosen (far ones count less), each "
        "order with its best prior. Chosen (ring) is the lowest order whose squared error exceeds "
        "the best by no more than one standard error, which the bars of the second view show."
    )
    best = int(columns["order"][np.nanargmin(columns[first])])
    picked = ", ".join(f"{each:.0f}" for each in columns["order"][chosen]) or "none"
    words = f"Held-out error over the order. Lowest at order {best}, chosen: {picked}. {caption}"
    control = Control("Shown", options)
    details = {"order": "order {}", "held_out_rms_mm": "held-out rms {} mm"}
    return Picture("orders", plot, words, caption, (control,), details=details)


def _tried(table: Columns, rows: np.ndarray) -> Table:
    """What the picture shows."""
    rows = rows[np.argsort(np.asarray(table["order"])[rows], kind="stable")]
    figures = [(name, digits) for name, (_, digits) in _FIGURES.items()]
    figures.append(("excess_std_error_mm2", 5))
    cells = tuple(
        (
            f"{int(table['order'][i])}",
            *_prior(table, i),
            *(_number(table[name][i], digits) for name, digits in figures),
        )
        for i in rows
    )
    chosen = {n: "← chosen" for n, i in enumerate(rows) if table["chosen"][i] == 1}
    labels = (*(label for label, _ in _FIGURES.values()), "standard error of it")
    heads = ("order", *_PRIOR, *labels)
    return Table("Orders tried", heads, cells, frozenset(range(len(heads))), chosen, folded=True)


def _prior(table: Columns, row: int) -> tuple[str, ...]:
    return tuple(f"{float(table[name][row]):g}" for name in _PRIOR.values())


def _chosen(table: Columns) -> Table:
    """The order of the delivered model, and those chosen without a fold."""
    fold = np.asarray(table["fold"], dtype=float)
    rows = []
    for i in np.flatnonzero(np.asarray(table["chosen"]) == 1):
        rows.append(
            (
                f"without fold {fold[i]:.0f}" if np.isfinite(fold[i]) else "all, delivered",
                f"{int(table['order'][i])}",
                *_prior(table, i),
                _number(table["held_out_rms_mm"][i], 4),
            )
        )
    heads = ("poses seen", "order", *_PRIOR, "held-out rms, mm")
    caption = "Orders chosen: held-out errors contain the cost of choosing"
    return Table(caption, heads, tuple(rows), frozenset(range(1, 6)), folded=len(rows) > 1)
