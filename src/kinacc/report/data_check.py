"""What was measured, and what the check of the file found before anything was fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from bokeh.palettes import Viridis256
from bokeh.transform import log_cmap

from kinacc.calibration import noise, summary
from kinacc.config.error_models import model_name
from kinacc.kinematics.robot import Robot
from kinacc.measurements.row_names import RowNames
from kinacc.report import pictures
from kinacc.report.page import Part, Picture, records
from kinacc.tables.allowed import FINDING_LEVELS, LEFT_OUT, SUBSETS
from kinacc.tables.columns import Columns

_BINS = 60  # of a joint's travel
_ROW_PX, _FRAME_PX = 34, 110
_SEEN = Viridis256[64:]  # its darkest part is not seen on a dark page


def section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on the measured file: ``data_check``, ``measurements`` and the like."""
    measurements, check = tables["measurements"], tables.get("data_check")
    joints = [_travel(measurements, robot, n) for n in range(robot.dh.joints)]
    findings = [each for each in records(check or {}) if each["finding"] != LEFT_OUT]
    values = {
        "arm": robot,
        "measured": bool(np.isfinite(np.asarray(measurements["row"], dtype=float)).any()),
        "checked": check is not None,
        "findings": sorted(findings, key=lambda each: FINDING_LEVELS.index(each["level"])),
        "excluded": _excluded(tables),
        "selected": model_name(summary.selected(tables["model_selection"])),
        "left_out": summary.left_out(check),
        "readings": len(measurements["pose"]),
        "poses": len(np.unique(measurements["pose"])),
        "fitted": int(np.sum(np.asarray(measurements["subset"]) == SUBSETS[0])),
        "turned": int(np.isfinite(np.asarray(measurements["qw"], dtype=float)).sum()),
        "targets": _numbers(measurements["target"]),
        "sessions": _numbers(measurements["session"]),
        "noise": noise.of_measurements(measurements, robot),
        "stated": _stated(measurements),
        "joints": joints,
    }
    return Part("data", values, (_coverage(joints),))


def _numbers(column: np.ndarray) -> dict[str, int]:
    """Number of readings by name."""
    names, counts = np.unique([str(each or "") for each in column], return_counts=True)
    return dict(zip(names.tolist(), counts.tolist(), strict=True))


def _excluded(tables: Mapping[str, Columns]) -> list[dict]:
    """Rows that the configuration leaves out, with the errors of a model not fitted to them."""
    table = tables.get("excluded_rows")
    if table is None:
        return []
    model = summary.selected(tables["model_selection"])
    names = RowNames.of_columns({**table, "row": table["line"]})
    return [
        {"row": names.one(line), "reason": reason, "size": size}
        for line, reason, size in summary.excluded_errors(table, model)
    ]


def _stated(measurements: Columns) -> tuple[int, np.ndarray] | None:
    """Number of readings whose noise the file states, and the median along x, y and z, mm."""
    std = np.array([measurements[f"std_{axis}_mm"] for axis in "xyz"], dtype=float)
    known = np.isfinite(std).all(axis=0)
    return (int(known.sum()), np.median(std[:, known], axis=1)) if known.any() else None


def _travel(measurements: Columns, robot: Robot, joint: int) -> dict:
    """Positions of a joint at every pose once, their range and its limits, deg or mm."""
    first = np.unique(measurements["pose"], return_index=True)[1]
    slides = robot.dh.prismatic[joint]
    position = np.asarray(measurements[f"q{joint + 1}"], dtype=float)[first]
    every = np.array([*position, robot.q_min_rad[joint], robot.q_max_rad[joint]])
    *position, least, most = every if slides else np.rad2deg(every)
    low, high = min(position), max(position)
    return {
        "joint": f"J{joint + 1}, {'mm' if slides else 'deg'}",
        "position": np.array(position),
        "low": low,
        "high": high,
        "least": least,
        "most": most,
        "share": (high - low) / (most - least),
    }


def _coverage(joints: Sequence[Mapping]) -> Picture:
    """Where in the travel of every joint there are poses: a bar a joint, a cell a sixtieth."""
    rows = []
    for each in joints:
        width = (each["most"] - each["least"]) / _BINS
        place = (each["position"] - each["least"]) / width
        cell = np.where(place == _BINS, _BINS - 1, np.floor(place)).astype(int)
        for number, poses in zip(*np.unique(cell, return_counts=True), strict=True):
            low, high = (each["least"] + width * n + 0.0 for n in (number, number + 1))
            ends = 100.0 * number / _BINS, 100.0 * (number + 1) / _BINS
            rows.append((each["joint"], *ends, f"{low:z.0f} to {high:z.0f}", int(poses)))
    names = ("joint", "left", "right", "where", "poses")
    columns = dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))
    labels = [each["joint"] for each in joints]
    plot = pictures.figure(
        "share of the joint's travel, %",
        "",
        height_px=_FRAME_PX + _ROW_PX * len(labels),
        tools="reset,save",
        hover=[("", "@joint: @where"), ("poses", "@poses")],
        y_range=labels[::-1],
    )
    colour = log_cmap("poses", _SEEN, 1, max(columns["poses"].max(), 2))
    filled = plot.hbar(
        y="joint", left="left", right="right", height=0.6, line_color=None, fill_color=colour,
        source=pictures.source("coverage", columns),
    )  # fmt: skip
    plot.hbar(y=labels, left=0.0, right=100.0, height=0.75, fill_color=None, line_color="grey")
    plot.add_layout(filled.construct_color_bar(title="poses", width=10), "right")
    plot.ygrid.grid_line_color = None
    return Picture("coverage", plot)
