"""What was measured, and what the check of the file found before anything was fitted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from bokeh.palettes import Viridis256
from bokeh.transform import log_cmap

from kinacc.artifacts.allowed import FINDING_LEVELS, LEFT_OUT, SUBSETS
from kinacc.artifacts.columns import Columns
from kinacc.artifacts.error_models import model_name
from kinacc.calibration import noise, summary
from kinacc.calibration.summary_words import counted
from kinacc.kinematics.robot import Robot
from kinacc.measurements.row_names import RowNames
from kinacc.report import pictures
from kinacc.report.page import Block, Picture, Section, Table, Text

_BINS = 60  # of a joint's travel
_MOST_NAMED = 6  # targets and sessions that are listed by name
_MOST_SHOWN = 12  # rows of a table that is not folded
_ROW_PX, _FRAME_PX = 34, 110
_NONE = "–"
_SEEN = Viridis256[64:]  # its darkest part is not seen on a dark page


def section(tables: Mapping[str, Columns], robot: Robot) -> Section:
    """The section of a page on the measured file: ``data_check``, ``measurements`` and the like."""
    measurements, found = tables["measurements"], tables.get("data_check")
    return Section(
        "data",
        "Data check",
        _population(measurements),
        "What was measured, how much of the travel of every joint it covers, and what the check "
        "of the file found before anything was fitted.",
        "Good: nothing suspicious, readings repeated at some poses, every joint over most of its "
        "travel. Bad: a finding without a reason; a joint that moves through less than a tenth of "
        "its travel, or leaves gaps: nothing measured speaks for the robot there.",
        "Look up the lines that are named. Measure them again, or leave them out with a reason "
        "(measurements.file.exclude); a finding you know the reason of is accepted with it "
        "(data_check.accept). Measure more poses where a joint has a gap.",
        (
            *_findings(found),
            *_excluded(tables),
            _measured(tables, robot),
            _coverage(measurements, robot),
            _ranges(measurements, robot),
            *_left_out(found),
        ),
    )


def _population(measurements: Columns) -> str:
    poses = counted(len(np.unique(measurements["pose"])), "pose")
    targets = counted(len(set(_texts(measurements["target"]))), "target")
    arm = "a measured arm" if _lines(measurements).any() else "a synthetic arm"
    return f"{counted(len(measurements['pose']), 'reading')} of {targets} at {poses} of {arm}"


def _texts(column: np.ndarray) -> list[str]:
    return ["" if each is None else str(each) for each in column]


def _lines(measurements: Columns) -> np.ndarray:
    """Whether a reading stands in a line of a file (n,)."""
    return np.isfinite(np.asarray(measurements["row"], dtype=float))


def _findings(table: Columns | None) -> list[Block]:
    if table is None:
        return [Text("The arm is synthetic: there is no measured file to check.")]
    rows = [i for i, kind in enumerate(table["finding"]) if kind != LEFT_OUT]
    rows.sort(key=lambda i: FINDING_LEVELS.index(table["level"][i]))
    if not rows:
        return [Text("The check found nothing suspicious in the file.")]
    heads = ["level", "finding", "what", "lines", "what to do"]
    names = ["level", "finding", "what", "lines", "fix"]
    if any(table["accepted"][i] for i in rows):
        heads, names = [*heads, "accepted, because"], [*names, "accepted"]
    cells_ = tuple(tuple(str(table[name][i] or _NONE) for name in names) for i in rows)
    caption = f"What the check found: {counted(len(rows), 'finding')}, the gravest first"
    return [Table(caption, tuple(heads), cells_)]


def _left_out(table: Columns | None) -> list[Block]:
    told = summary.left_out(table)
    caption = "Not used of the measured file"
    return [Table(caption, ("what",), tuple((each,) for each in told), folded=True)] if told else []


def _excluded(tables: Mapping[str, Columns]) -> list[Block]:
    """Rows that the configuration leaves out, with the errors of a model that has not seen them."""
    table = tables.get("excluded_rows")
    if table is None:
        return []
    model = summary.selected(tables["model_selection"])
    names = RowNames.of_columns({**table, "row": table["line"]})
    rows = tuple(
        (names.one(line), f"{size:.3f}" if np.isfinite(size) else "could not be read", reason)
        for line, reason, size in summary.excluded_errors(table, model)
    )
    caption = "Rows left out by measurements.file.exclude; no fit has seen them"
    heads = ("row", f"error of {model_name(model)}, mm", "reason")
    return [Table(caption, heads, rows, frozenset({1}), folded=len(rows) > _MOST_SHOWN)]


def _measured(tables: Mapping[str, Columns], robot: Robot) -> Table:
    """What there is, in pairs of a name and words."""
    measurements = tables["measurements"]
    count = len(measurements["pose"])
    fitted = int(np.sum(np.asarray(measurements["subset"]) == SUBSETS[0]))
    rest = f"{fitted} of {count}; {count - fitted} held out (measurements.validation_fold)"
    sessions = len({*_texts(measurements["session"])}) > 1
    rows = (
        ("robot", f"{robot.name}: {robot.source}" if robot.source else robot.name),
        ("readings", str(count)),
        ("poses", str(len(np.unique(measurements["pose"])))),
        ("targets", _named(measurements["target"])),
        ("sessions", _named(measurements["session"]) if sessions else ""),
        ("orientation", _turned(measurements)),
        ("fitted by the delivered models", "all" if fitted == count else rest),
        ("noise of a reading", _noise(measurements, robot)),
        ("noise as the file states it", _stated(measurements)),
    )
    return Table("What was measured", ("property", "value"), tuple(row for row in rows if row[1]))


def _named(column: np.ndarray) -> str:
    names, counts = np.unique(_texts(column), return_counts=True)
    if len(names) > _MOST_NAMED:
        return str(len(names))
    return ", ".join(
        f"{name} ({counted(n, 'reading')})" for name, n in zip(names, counts, strict=True)
    )


def _turned(measurements: Columns) -> str:
    turned = int(np.isfinite(np.asarray(measurements["qw"], dtype=float)).sum())
    if turned == len(measurements["pose"]):
        return "measured in every reading"
    if turned:
        return f"measured in {turned} of {counted(len(measurements['pose']), 'reading')}"
    return "not measured: how the tool is turned is judged nowhere on this page"


def _noise(measurements: Columns, robot: Robot) -> str:
    """The noise of one reading, in words."""
    found = noise.of_measurements(measurements, robot)
    if not found.freedom:
        return "unknown: no configuration was read twice"
    axes = ", ".join(f"{axis} {each:.2g}" for axis, each in zip("xyz", found.std_mm, strict=True))
    return (
        f"standard deviation {axes} mm (axes of the instrument), pooled over "
        f"{counted(found.configurations, 'configuration')} with {found.readings} readings "
        f"({_degrees(found.freedom)}); contains how well the arm repeats a configuration where it "
        "came back to one"
    )


def _degrees(freedom: int) -> str:
    return f"{freedom} {'degree' if freedom == 1 else 'degrees'} of freedom"


def _stated(measurements: Columns) -> str:
    std = np.array([measurements[f"std_{axis}_mm"] for axis in "xyz"], dtype=float)
    known = np.isfinite(std).all(axis=0)
    if not known.any():
        return ""
    middle = np.median(std[:, known], axis=1)
    axes = ", ".join(f"{axis} {each:.2g}" for axis, each in zip("xyz", middle, strict=True))
    return f"standard deviation {axes} mm (the middle one of {counted(known.sum(), 'reading')})"


def _joints(measurements: Columns, robot: Robot) -> np.ndarray:
    """Reported joints (p, k) of every pose once, deg, or mm where one slides."""
    first = np.unique(measurements["pose"], return_index=True)[1]
    numbers = range(1, robot.dh.joints + 1)
    joints = np.stack([np.asarray(measurements[f"q{n}"], dtype=float) for n in numbers], axis=1)
    return _shown(robot, joints[first])


def _shown(robot: Robot, joints: np.ndarray) -> np.ndarray:
    """Joints (..., k) as a person reads them, and no minus zero."""
    return np.where(robot.dh.prismatic, joints, np.rad2deg(joints)) + 0.0


def _coverage(measurements: Columns, robot: Robot) -> Picture:
    """Where in the travel of every joint there are poses: a bar a joint, a cell a sixtieth."""
    joints = _joints(measurements, robot)
    low, high = _shown(robot, robot.q_min_rad), _shown(robot, robot.q_max_rad)
    named = [_joint(robot, n) for n in range(robot.dh.joints)]
    data: dict[str, list] = {name: [] for name in ("joint", "left", "right", "where", "poses")}
    for joint, name in enumerate(named):
        width = (high[joint] - low[joint]) / _BINS
        place = (joints[:, joint] - low[joint]) / width
        cell = np.where(place == _BINS, _BINS - 1, np.floor(place)).astype(int)
        for number, poses in zip(*np.unique(cell, return_counts=True), strict=True):
            ends = low[joint] + width * number, low[joint] + width * (number + 1)
            data["joint"].append(name)
            data["left"].append(100.0 * number / _BINS)
            data["right"].append(100.0 * (number + 1) / _BINS)
            data["where"].append(f"{ends[0]:.0f} to {ends[1]:.0f}")
            data["poses"].append(int(poses))
    plot = pictures.figure(
        "share of the joint's travel, %",
        "",
        height_px=_FRAME_PX + _ROW_PX * len(named),
        tools="reset,save",
        hover=[("", "@joint: @where"), ("poses", "@poses")],
        y_range=named[::-1],
    )
    shared = pictures.source("coverage", {name: np.array(each) for name, each in data.items()})
    top = max(data["poses"])
    filled = plot.hbar(
        y="joint",
        left="left",
        right="right",
        height=0.6,
        source=shared,
        line_color=None,
        fill_color=log_cmap("poses", _SEEN, 1, max(top, 2)),
    )
    plot.hbar(y=named, left=0.0, right=100.0, height=0.75, fill_color=None, line_color="grey")
    plot.add_layout(filled.construct_color_bar(title="poses", width=10), "right")
    plot.ygrid.grid_line_color = None
    told = "; ".join(" ".join(row) for row in _ranges(measurements, robot).rows)
    caption = (
        "The frame is the whole travel of a joint by the robot file, a filled cell is a sixtieth "
        "of it with at least one pose. Where a row is empty, no pose was measured."
    )
    return Picture("coverage", plot, f"Poses over the travel of every joint: {told}.", caption)


def _joint(robot: Robot, joint: int) -> str:
    return f"J{joint + 1}, {'mm' if robot.dh.prismatic[joint] else 'deg'}"


def _ranges(measurements: Columns, robot: Robot) -> Table:
    joints = _joints(measurements, robot)
    least, most = _shown(robot, robot.q_min_rad), _shown(robot, robot.q_max_rad)
    low, high = joints.min(axis=0), joints.max(axis=0)
    rows = tuple(
        (
            _joint(robot, n),
            f"{low[n]:.1f} to {high[n]:.1f}",
            f"{least[n]:.1f} to {most[n]:.1f}",
            f"{(high[n] - low[n]) / (most[n] - least[n]):.0%}",
        )
        for n in range(robot.dh.joints)
    )
    heads = ("joint", "measured", "limits", "share of travel")
    return Table("Range of every joint over all poses", heads, rows, frozenset({1, 2, 3}))
