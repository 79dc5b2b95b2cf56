"""What is left between model and measurement: how large, at which joints, where in the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from bokeh.models import ColumnDataSource

from kinacc.artifacts.columns import Columns
from kinacc.artifacts.error_models import MEASURED, NOMINAL, Comparison, model_name
from kinacc.calibration import summary
from kinacc.kinematics.robot import Robot
from kinacc.measurements.row_names import RowNames
from kinacc.report import pictures
from kinacc.report.page import Picture, Section, Table
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, PURPLE

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


def section(tables: Mapping[str, Columns], robot: Robot) -> Section:
    """The section of a page on the errors of ``pose_errors``."""
    found = errors(tables)
    whose = model_name(found.selected)
    data = _data(found, tables["measurements"], robot)
    where = "held out: no fit saw them" if found.held_out else "fitted: errors elsewhere are larger"
    return Section(
        "residuals",
        "Residuals",
        f"{len(found.rows)} rows of the measured file, {where}; position errors, mm",
        "The distance between where the model says the target is and where it was measured, "
        f"before calibration (nominal) and after ({whose}).",
        "Good: a narrow heap near zero, the same height at every joint angle and from the first "
        "to the last row. Bad: a slope or a wave over a joint (the model lacks something), a step "
        "or a slope over the file (something moved or warmed up), single points far above all.",
        "Look up the rows that stand out, remeasure or exclude them with a reason "
        "(measurements.file.exclude); where a wave is left, measure more poses over that joint.",
        (
            _histogram(found),
            _over_file(found, data),
            _over_joint(found, data, robot),
            _in_space(found, data),
            _worst(found, tables["measurements"], data),
        ),
    )


def _drawn(found: Errors) -> np.ndarray:
    """Which rows are drawn: all, or every n-th and the largest."""
    count = len(found.rows)
    step = -(-count // _MOST_POINTS)
    largest = np.argsort(-found.sizes[found.selected], kind="stable")[:_WORST]
    return np.unique(np.concatenate([np.arange(0, count, step), largest]))


def _data(found: Errors, measurements: Columns, robot: Robot) -> ColumnDataSource:
    """What the pictures of single rows share."""
    at = _drawn(found)
    rows = found.rows[at]
    columns = {f"{model}_mm": size[at] for model, size in found.sizes.items()}
    joints = np.stack([measurements[f"q{n + 1}"] for n in range(robot.dh.joints)], axis=1)[rows]
    joints = np.where(robot.dh.prismatic, joints, np.rad2deg(joints))
    columns |= {f"q{n + 1}": joints[:, n] for n in range(robot.dh.joints)}
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


def _shown(found: Errors) -> tuple[str, ...]:
    """The models of the pictures of rows: before and after."""
    return NOMINAL, found.selected


def _label(model: str, found: Errors) -> str:
    return f"{model_name(model)}, selected" if model == found.selected else model_name(model)


def _histogram(found: Errors) -> Picture:
    largest = max(size.max() for size in found.sizes.values())
    edges = np.linspace(0.0, largest * (1 + 1e-9), _BINS + 1)
    plot = pictures.figure("position error, mm", "rows", height_px=280, tools="box_zoom,reset,save")
    columns = {"from": edges[:-1], "to": edges[1:]}
    columns |= {m: np.histogram(size, edges)[0] for m, size in found.sizes.items()}
    data = pictures.source("histogram", columns)
    for model in found.sizes:
        mine = model == found.selected
        plot.quad(
            left="from",
            right="to",
            bottom=0,
            top=model,
            source=data,
            legend_label=_label(model, found),
            fill_color=_COLOURS.get(model, GREEN),
            fill_alpha=0.45 if mine else 0.08,
            line_color=_COLOURS.get(model, GREEN),
            line_width=2 if mine else 1.2,
            line_dash="solid" if mine or model == NOMINAL else "dashed",
        )
    pictures.from_zero(plot)
    plot.legend.click_policy = "hide"
    told = "; ".join(
        f"{model_name(m)}: mean {size.mean():.3f}, largest {size.max():.3f} mm"
        for m, size in found.sizes.items()
    )
    caption = "How many rows have an error of which size. A click in the legend hides a model."
    return Picture("histogram", plot, f"Histogram of position errors. {told}.", caption)


def _points(plot, found: Errors, data: ColumnDataSource, x: str, named: str) -> None:
    for model in _shown(found):
        after = model == found.selected
        plot.scatter(
            x,
            f"{model}_mm",
            source=data,
            size=5,
            marker="circle" if after else "triangle",
            color=_COLOURS.get(model, GREEN),
            fill_alpha=0.6 if after else 0.0,
            line_alpha=0.6,
            legend_label=_label(model, found),
            name=f"{named}-{model}",
            nonselection_alpha=0.25,
            selection_line_color=pictures.VERMILION,
            selection_fill_color=pictures.VERMILION,
        )
        plot.renderers[-1].glyph.name = f"{named}-{model}-glyph"
    plot.legend.click_policy = "hide"
    plot.legend.orientation = "horizontal"
    plot.add_layout(plot.legend[0], "above")
    pictures.from_zero(plot)


def _hover(found: Errors) -> list[tuple[str, str]]:
    sizes = [(f"{model_name(m)}, mm", f"@{m}_mm{{0.000}}") for m in _shown(found)]
    return [("", "@called"), *sizes]


def _details(found: Errors, data: ColumnDataSource) -> dict[str, str]:
    joints = [name for name in data.data if name[:1] == "q" and name[1:].isdigit()]
    return {
        "called": "{}",
        **{f"{m}_mm": f"{_label(m, found)} {{}} mm" for m in found.sizes},
        **{name: f"J{name[1:]} {{}}" for name in joints},
    }


def _over_file(found: Errors, data: ColumnDataSource) -> Picture:
    plot = pictures.figure(
        "row, in the order of the file", "position error, mm", hover=_hover(found)
    )
    _points(plot, found, data, "order", "over-file")
    large = float(np.quantile(found.sizes[found.selected], summary.LARGE_SHARE))
    plot.hspan(y=large, line_color=BLUE)
    caption = (
        f"Line: {summary.LARGE_SHARE:.0%} of the rows lie below it ({large:.3f} mm) with the "
        "selected model. A step or a slope along the file is time at work: a base that moved, an "
        "arm that warmed up."
    )
    words = f"Position error of every row in the order of the file. {caption}"
    return Picture("over-file", plot, words, caption, details=_details(found, data))


def _over_joint(found: Errors, data: ColumnDataSource, robot: Robot) -> Picture:
    plot = pictures.figure(_joint(robot, 0), "position error, mm", hover=_hover(found))
    _points(plot, found, data, "q1", "over-joint")
    plot.xaxis[0].name = "over-joint-axis"
    control = pictures.choice(
        "Joint",
        [(f"{n + 1}", f"q{n + 1}", _joint(robot, n)) for n in range(robot.dh.joints)],
        {f"over-joint-{m}-glyph": ("x",) for m in _shown(found)},
        "over-joint-axis",
    )
    caption = "The same rows over the angle of one joint: a wave that is left is that joint's."
    words = "Position error of every row over the angle of the joint that is chosen."
    return Picture("over-joint", plot, words, caption, (control,), details=_details(found, data))


def _joint(robot: Robot, joint: int) -> str:
    return f"joint {joint + 1}, {'mm' if robot.dh.prismatic[joint] else 'deg'}"


def _in_space(found: Errors, data: ColumnDataSource) -> Picture:
    top = float(np.quantile(found.sizes[found.selected], summary.LARGE_SHARE))
    plot, control = pictures.in_space(
        "in-space", data, f"{found.selected}_mm", top, "error, mm", _hover(found)
    )
    caption = (
        "Where the target was measured, in the instrument's frame; the colour is the error with "
        f"the selected model, all above {top:.2f} mm in the last colour."
    )
    return Picture(
        "in-space", plot, f"Errors in space. {caption}", caption, (control,),
        details=_details(found, data),
    )  # fmt: skip


def _worst(found: Errors, measurements: Columns, data: ColumnDataSource) -> Table:
    size = found.sizes[found.selected]
    order = np.argsort(-size, kind="stable")[:_WORST]
    names = _names(measurements, found.rows[order])
    drawn = {int(place): i for i, place in enumerate(np.asarray(data.data["order"]))}
    models = list(found.sizes)
    return Table(
        f"The {len(order)} rows that the selected model is farthest from, mm",
        ("row", *(_label(model, found) for model in models)),
        tuple(
            (name, *(f"{found.sizes[m][i]:.3f}" for m in models))
            for name, i in zip(names, order, strict=True)
        ),
        numeric=frozenset(range(1, len(models) + 1)),
        picked_in="over-file",
        picks=tuple(drawn[int(i)] for i in order),
    )
