"""What became of an arm over the lines of its series: errors, what moved, and the verdicts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from bokeh.models import CDSView, ColumnDataSource, IndexFilter

from kinacc.config.error_models import model_name
from kinacc.deployment.history_words import sentence
from kinacc.kinematics.robot import Robot
from kinacc.report import pictures
from kinacc.report.page import Part, Picture, records
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, VERMILION
from kinacc.tables.allowed import FIRST, HOLDS, OPEN, RECALIBRATE
from kinacc.tables.columns import Columns

_LOOKS = {
    FIRST: ("square", BLUE),
    HOLDS: ("circle", GREEN),
    RECALIBRATE: ("diamond", VERMILION),
    OPEN: ("x", GREY),
}
_WHOSE = {
    "held_out": ("calibrated on this line, held out", BLUE, "circle"),
    "in_force": ("calibration in force before", ORANGE, "triangle"),
}
_BELOW = 0.05  # of the highest: room for marks at zero
_STATISTICS = {"mean": "mean", "quantile_99": "99 %", "largest": "largest"}
_NUMBERS = (
    *(f"{whose}_{name}_mm" for whose in _WHOSE for name in _STATISTICS),
    *("moved_mm", "chance_mm", "beyond_mm", "probability", "tolerance_mm", "temperature_c"),
)
_DETAILS = {
    "date": "{}",
    "verdict": "{}",
    "held_out_mean_mm": "calibrated on it, held out: mean {} mm",
    "in_force_mean_mm": "calibration in force: mean {} mm",
    "in_force_largest_mm": "largest {} mm",
    "moved_mm": "moved {} mm rms",
    "chance_mm": "chance shows up to {} mm",
    "joint_said": "{}",
    "temperature_c": "{} °C",
    "reason_said": "{}",
}


def section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on ``history``, one row a line by date."""
    history = tables["history"]
    data = _data(history)
    errors = _errors(history, data)
    drawn = [errors]
    if np.isfinite(np.asarray(history["chance_mm"], dtype=float)).any():
        drawn.append(_moved(history, data, errors.plot.x_range))
    rows = [
        each | {"called": model_name(str(each["model"]))}
        | ({"remark": each["reason"]} if each["reason"] else {})
        for each in records(history)
    ]  # fmt: skip
    return Part("history", {"rows": rows, "sentence": sentence(history)}, tuple(drawn))


def _data(history: Columns) -> ColumnDataSource:
    columns = {name: np.asarray(history[name], dtype=float) for name in _NUMBERS}
    day = np.array([str(each) for each in history["date"]], dtype="datetime64[ms]")
    columns["day"] = day.astype(float)
    columns["mark_mm"] = np.nan_to_num(columns["moved_mm"])
    joints = np.asarray(history["joint"], dtype=float)
    columns["date"] = np.array([str(each) for each in history["date"]], dtype=object)
    columns["verdict"] = np.array([str(each) for each in history["verdict"]], dtype=object)
    columns["joint_said"] = np.array(
        [f"joint {each:.0f}" if np.isfinite(each) else "" for each in joints], dtype=object
    )
    columns["reason_said"] = np.array([each or "" for each in history["reason"]], dtype=object)
    return pictures.source("history", columns)


def _errors(history: Columns, data: ColumnDataSource) -> Picture:
    """Mean and 99 % of both calibrations; the largest as marks."""
    plot = pictures.figure("date", "position error, mm", height_px=340, x_axis_type="datetime")
    for whose, (label, colour, marker) in _WHOSE.items():
        if not np.isfinite(np.asarray(history[f"{whose}_mean_mm"], dtype=float)).any():
            continue
        for name, dash in (("mean", "solid"), ("quantile_99", "dashed")):
            column = f"{whose}_{name}_mm"
            line = plot.line(
                "day", column, source=data, color=colour, line_dash=dash, line_width=2,
                legend_label=f"{label}, {_STATISTICS[name]}",
            )  # fmt: skip
            line.nonselection_glyph = None
            marks = plot.scatter(
                "day", column, source=data, marker=marker, color=colour, size=7,
                nonselection_alpha=0.5, selection_color=VERMILION,
            )  # fmt: skip
            pictures.hover(plot, _told(whose, label), marks)
        plot.scatter(
            "day", f"{whose}_largest_mm", source=data, marker="x", color=colour, size=7,
            nonselection_alpha=0.5, legend_label=f"{label}, largest",
        )  # fmt: skip
    limits = np.asarray(history["tolerance_mm"], dtype=float)
    if np.isfinite(limits).any():
        plot.line(
            "day", "tolerance_mm", source=data, color=GREY, line_dash="8 4", line_width=2,
            legend_label="tolerance",
        )  # fmt: skip
    pictures.from_zero(plot)
    pictures.legend_above(plot, 3)
    invitation = "Select a line to see its numbers."
    return Picture("robot-history-errors", plot, details=_DETAILS, invitation=invitation)


def _told(whose: str, label: str) -> list[tuple[str, str]]:
    numbers = [
        (f"{words}, mm", f"@{whose}_{name}_mm{{0.000}}") for name, words in _STATISTICS.items()
    ]
    return [("", f"@date: {label}"), *numbers]


def _moved(history: Columns, data: ColumnDataSource, days: object) -> Picture:
    """What moved since the calibration in force, marked by verdict, over what chance shows."""
    plot = pictures.figure("date", "moved, mm rms", height_px=280, x_axis_type="datetime")
    plot.x_range = days
    bars = plot.segment(
        "day", 0.0, "day", "chance_mm", source=data, color=GREY, line_width=6, alpha=0.35,
        legend_label="up to here chance shows it",
    )  # fmt: skip
    bars.nonselection_glyph = None
    verdicts = np.array([str(each) for each in history["verdict"]])
    told = [
        ("", "@date: @verdict @joint_said"),
        ("moved, mm rms", "@moved_mm{0.000}"),
        ("chance, mm", "@chance_mm{0.000}"),
        ("beyond chance, mm", "@beyond_mm{0.000}"),
        ("probability", "@probability{0.0000}"),
    ]
    for name, (marker, colour) in _LOOKS.items():
        mine = np.flatnonzero(verdicts == name)
        if len(mine):
            marks = plot.scatter(
                "day", "mark_mm", source=data, marker=marker, color=colour, size=9,
                view=CDSView(filter=IndexFilter(mine.tolist())), legend_label=name,
                nonselection_alpha=0.5, selection_color=VERMILION,
            )  # fmt: skip
            pictures.hover(plot, told, marks)
    highest = np.nanmax([*history["moved_mm"], *history["chance_mm"]])
    plot.y_range.update(start=-_BELOW * float(highest))
    pictures.legend_above(plot, 5)
    return Picture("robot-history-moved", plot, details=_DETAILS)
