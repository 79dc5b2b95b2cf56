"""What is left between model and measurement: how large, at which joints, where in the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from bokeh.models import ColumnDataSource

from kinacc.calibration import summary
from kinacc.config.error_models import MEASURED, NOMINAL, Comparison, model_name
from kinacc.kinematics.robot import Robot
from kinacc.measurements.row_names import RowNames
from kinacc.report import pictures
from kinacc.report.page import Part, Picture
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, PURPLE
from kinacc.tables.columns import Columns

_MOST_POINTS = 12_000  # drawn one by one; of more rows every n-th is, and all of the largest
_WORST = 10
_BINS = 40
_COLOURS = {NOMINAL: GREY, "dh": ORANGE, "compliance": PURPLE, "vec": BLUE}


@dataclass(frozen=True)
class Errors:
    """Position errors (n,) in mm of every model at the same rows of the measurements.

    ``selected`` names the model that is; ``held_out`` says whether no fit has seen the rows.
    """

    rows: np.ndarray
    sizes: Mapping[str, np.ndarray]
    selected: str
    held_out: bool


def errors(tables: Mapping[str, Columns]) -> Errors:
    """Errors at rows that every model was tried on, held out where rows were."""
    table = tables["pose_errors"]
    estimate, comparison = (np.asarray(table[each]) for each in ("estimate", "comparison"))
    held_out = bool((estimate == "cross_validated").any())
    of_kind = estimate == ("cross_validated" if held_out else "train")
    size = np.linalg.norm([table[f"e{axis}_mm"] for axis in "xyz"], axis=0)
    selected = summary.selected(tables["model_selection"])
    found = {}
    for model in (NOMINAL, *map(str, tables["model_selection"]["model"])):
        mine = of_kind & (comparison == Comparison(MEASURED, model).name)
        found[model] = dict(zip(np.asarray(table["row"])[mine], size[mine], strict=True))
    common = sorted(set.intersection(*(set(each) for each in found.values())))
    sizes = {model: np.array([each[row] for row in common]) for model, each in found.items()}
    return Errors(np.array(common, dtype=int), sizes, selected, held_out)


def section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on the errors of ``pose_errors``."""
    found, measurements = errors(tables), tables["measurements"]
    size = found.sizes[found.selected]
    large = float(np.quantile(size, summary.LARGE_SHARE))
    worst = np.argsort(-size, kind="stable")[:_WORST]
    drawn = np.union1d(np.arange(0, len(size), -(-len(size) // _MOST_POINTS)), worst)
    data = _data(found, drawn, measurements, robot)
    labels = {
        model: model_name(model) + (", selected" if model == found.selected else "")
        for model in found.sizes
    }
    rows = [
        {"called": name, **{m: each[i] for m, each in found.sizes.items()}, "pick": pick}
        for name, i, pick in zip(
            _names(measurements, found.rows[worst]), worst, np.searchsorted(drawn, worst).tolist(),
            strict=True,
        )
    ]  # fmt: skip
    values = {
        "count": len(size),
        "held_out": found.held_out,
        "selected": model_name(found.selected),
        "share": summary.LARGE_SHARE,
        "large_mm": large,
        "labels": labels,
        "sizes": {model_name(m): (each.mean(), each.max()) for m, each in found.sizes.items()},
        "worst": rows,
    }
    return Part(
        "residuals",
        values,
        (_histogram(found, labels), *_of_rows(found, labels, data, robot, large)),
    )


def _data(found: Errors, at: np.ndarray, measurements: Columns, robot: Robot) -> ColumnDataSource:
    """What the pictures of single rows share."""
    rows = found.rows[at]
    columns = {f"{model}_mm": size[at] for model, size in found.sizes.items()}
    for n, slides in enumerate(robot.dh.prismatic, start=1):
        joint = np.asarray(measurements[f"q{n}"])[rows]
        columns[f"q{n}"] = joint if slides else np.rad2deg(joint)
    columns |= {axis: np.asarray(measurements[f"{axis}_mm"])[rows] for axis in "xyz"}
    columns |= {"order": at, "called": np.array(_names(measurements, rows), dtype=object)}
    return pictures.source("residuals", columns)


def _names(measurements: Columns, rows: np.ndarray) -> list[str]:
    """What a person calls rows: by the line of the file, else by the pose."""
    names = RowNames.of_columns(measurements)
    lines, poses = (np.asarray(measurements[each], dtype=float) for each in ("row", "pose"))
    targets = np.asarray(measurements["target"]).astype(str)
    several = len(set(targets)) > 1
    return [
        (names.one(int(lines[i])) if np.isfinite(lines[i]) else f"pose {poses[i]:.0f}")
        + (f", {targets[i]}" if several else "")
        for i in rows
    ]


def _histogram(found: Errors, labels: Mapping[str, str]) -> Picture:
    largest = max(size.max() for size in found.sizes.values())
    edges = np.linspace(0.0, largest * (1 + 1e-9), _BINS + 1)
    plot = pictures.figure("position error, mm", "rows", height_px=280, tools="box_zoom,reset,save")
    columns = {"from": edges[:-1], "to": edges[1:]}
    columns |= {m: np.histogram(size, edges)[0] for m, size in found.sizes.items()}
    data = pictures.source("histogram", columns)
    for model, label in labels.items():
        mine, colour = model == found.selected, _COLOURS.get(model, GREEN)
        plot.quad(
            "from", "to", model, 0, source=data, legend_label=label, fill_color=colour,
            fill_alpha=0.45 if mine else 0.08, line_color=colour, line_width=2 if mine else 1.2,
            line_dash="solid" if mine or model == NOMINAL else "dashed",
        )  # fmt: skip
    pictures.from_zero(plot)
    plot.legend.click_policy = "hide"
    return Picture("histogram", plot)


def _of_rows(
    found: Errors, labels: Mapping[str, str], data: ColumnDataSource, robot: Robot, large: float
) -> tuple[Picture, ...]:
    """Errors of single rows before and after calibration: over the file, a joint, in space."""
    series = [
        (f"{m}_mm", labels[m], _COLOURS.get(m, GREEN), marker, filled)
        for m, marker, filled in ((NOMINAL, "triangle", 0.0), (found.selected, "circle", 0.6))
    ]
    hover = [("", "@called"), *((f"{label}, mm", f"@{c}{{0.000}}") for c, label, *_ in series)]
    details = {
        "called": "{}",
        **{f"{m}_mm": f"{label} {{}} mm" for m, label in labels.items()},
        **{f"q{n + 1}": f"J{n + 1} {{}}" for n in range(robot.dh.joints)},
    }
    error = "position error, mm"
    over_file = pictures.figure("row, in the order of the file", error, hover=hover)
    pictures.points(over_file, data, "order", series, "over-file")
    over_file.hspan(y=large, line_color=BLUE)
    joint = pictures.over_joint("over-joint", data, robot.dh.prismatic, series, error, hover)
    space = pictures.in_space("in-space", data, series[1][0], large, "error, mm", hover)
    drawn = {"over-file": (over_file, None), "over-joint": joint, "in-space": space}
    return tuple(
        Picture(key, plot, controls=(control,) if control else (), details=details)
        for key, (plot, control) in drawn.items()
    )
