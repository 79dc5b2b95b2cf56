"""Which model is selected and why, and which order the VEC model has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kinacc.calibration.model_comparison import STANDARD_ERRORS
from kinacc.config.error_models import PLAINEST, model_name
from kinacc.report import pictures
from kinacc.report.page import Control, Option, Part, Picture, records
from kinacc.report.pictures import BLUE, VERMILION
from kinacc.tables.columns import Columns

_SHOWN = {
    "held_out_rms_mm": "held-out rms, mm",
    "excess_mm2": "squared error beyond the best, mm²",
}


def section(tables: Mapping[str, Columns], why: str) -> Part:
    """The section of a page on ``model_selection`` and ``vec_orders``; ``why`` one is selected."""
    choice = tables["model_selection"]
    chosen = [each for each in records(tables.get("vec_orders", {})) if each["chosen"] == 1]
    tried = [
        each
        for each in records(tables.get("vec_orders", {}))
        if np.isnan(each["fold"]) and np.isfinite(each["held_out_rms_mm"])
    ]
    tried.sort(key=lambda each: each["order"])
    values = {
        "configurations": np.nanmax(np.asarray(choice["configurations"], float), initial=0.0),
        "why": why,
        "standard_errors": STANDARD_ERRORS,
        "plainest": model_name(PLAINEST),
        "models": [_model(each, tables) for each in records(choice)],
        "stated": not any(np.isfinite(each["held_out_rms_mm"]) for each in chosen),
        "tried": [each | {"remark": "← chosen"} if each["chosen"] else each for each in tried],
        "chosen": chosen,
    }
    return Part("selection", values, (_over_order(tried),) if tried else ())


def _model(row: dict, tables: Mapping[str, Columns]) -> dict:
    order = tables.get(f"{row['model']}_model", {}).get("order")
    gain = np.nan if row["model"] == PLAINEST else row["gain_mm2"]
    error = row["gain_std_error_mm2"] if np.isfinite(gain) else np.nan
    shown = {
        "name": model_name(str(row["model"])),
        "order": None if order is None else np.max(order),
        "gain": gain,
        "error": error,
        "times": gain / error if error > 0.0 else np.nan,
    }
    return row | shown | ({"remark": "selected"} if row["selected"] else {})


def _over_order(tried: Sequence[Mapping]) -> Picture:
    """Held-out errors over the order, of the choice that used all rows."""
    names = ("order", *_SHOWN, "excess_std_error_mm2", "prior_std_mm")
    columns = {name: np.array([each[name] for each in tried], dtype=float) for name in names}
    spread = columns["excess_std_error_mm2"]
    columns |= {
        "low": columns["excess_mm2"] - spread,
        "high": columns["excess_mm2"] + spread,
        "none": np.full(len(tried), np.nan),
        "chosen": np.array([14.0 * each["chosen"] for each in tried]),
    }
    data = pictures.source("orders", columns)
    plot = pictures.figure(
        "order of the VEC model",
        _SHOWN["held_out_rms_mm"],
        hover=[
            ("order", "@order"),
            ("held-out rms, mm", "@held_out_rms_mm{0.0000}"),
            ("squared error beyond the best, mm²", "@excess_mm2{0.00000}"),
            ("standard error", "@excess_std_error_mm2{0.00000}"),
            ("prior, mm", "@prior_std_mm"),
        ],
    )
    at = {"x": "order", "y": "held_out_rms_mm", "source": data}
    ring = {"fill_color": None, "line_color": VERMILION, "line_width": 2.5}
    parts: dict[str, Any] = {
        "line": plot.line(**at, color=BLUE, line_width=1.5),
        "bars": plot.segment("order", "none", "order", "none", source=data, color=BLUE),
        "dots": plot.scatter(**at, size=6, color=BLUE),
        "ring": plot.scatter(**at, size="chosen", **ring, legend_label="chosen"),
    }
    for name, glyph in parts.items():
        glyph.glyph.name = f"orders-{name}"
    plot.yaxis[0].name = "orders-axis"
    options = []
    for name, label in _SHOWN.items():
        sets = [(f"orders-{part}", "y", pictures.field(name)) for part in ("line", "dots", "ring")]
        ends = ("low", "high") if name == "excess_mm2" else ("none", "none")
        sets += [("orders-bars", f"y{i}", pictures.field(end)) for i, end in enumerate(ends)]
        options.append(Option(label, (*sets, ("orders-axis", "axis_label", label))))
    details = {"order": "order {}", "held_out_rms_mm": "held-out rms {} mm"}
    return Picture("orders", plot, controls=(Control("Shown", tuple(options)),), details=details)
