"""What a calibration is worth, as facts: data, errors, selection, range, what is left open."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from kinacc.config.error_models import COMPARISONS, MEASURED, NOMINAL, Comparison
from kinacc.kinematics import dh
from kinacc.kinematics.robot import Robot
from kinacc.measurements.folds import configurations
from kinacc.measurements.row_names import RowNames
from kinacc.tables.allowed import FINDING_LEVELS, LEFT_OUT, SELECTABLE, SUBSETS
from kinacc.tables.columns import Columns

LARGE_SHARE = 0.99  # of rows whose error is at most the quantile stated
TABLES = ("measurements", "robot", "frames", "dh_identified", "pose_errors", "model_selection")
_ORDER = (NOMINAL, *SELECTABLE)  # the plainest first
_BENDING = {
    "compliance_rad_per_nm": "rad/(N m)",
    "std_compliance_rad_per_nm": "rad/(N m)",
    "lever_coefficient_rad_per_mm": "rad/mm",
    "std_lever_coefficient_rad_per_mm": "rad/mm",
}
_ONE_WAY_DEG = 5.0  # a flange that turns less far away from its mean direction points one way
_LEAST_LENGTH = 1e-9
CONFIGURATIONS, SETTINGS = "configurations", "settings"  # what sets the highest order tried
_STATISTICS = ("n", "mean", "quantile_99", "largest")


class Fact(NamedTuple):
    """One row of ``summary``; a number with its unit, or a text."""

    topic: str
    item: str
    statistic: str
    value: float = np.nan
    unit: str | None = None
    text: str | None = None


def facts(tables: Mapping[str, Columns], robot: Robot, like_measured: float = np.nan) -> list[Fact]:
    """Everything ``summary`` holds of the tables ``TABLES`` and, where there, of models and data.

    ``robot``: the one the tables were made with; ``like_measured``: share of the box of the ranges
    of the joints where the selected model was measured, NaN where it is not known.
    """
    from kinacc.calibration import blind_words

    return [
        *_data(tables["measurements"], robot),
        *_frames(tables["frames"]),
        *(
            Fact(LEFT_OUT, str(number), "statement", text=text)
            for number, text in enumerate(left_out(tables.get("data_check")), 1)
        ),
        *_findings(tables.get("data_check")),
        *of_errors(tables["pose_errors"]),
        *of_selection(tables, robot),
        *(
            Fact("bending", f"joint {each['joint']}", name, float(each[name]), unit)
            for each in bending(tables.get("compliance_model"))
            for name, unit in _BENDING.items()
            if each[name] is not None
        ),
        *_excluded(tables.get("excluded_rows"), selected(tables["model_selection"])),
        *_range(tables["measurements"], robot),
        *_like_measured(like_measured),
        *of_pointing(tables["measurements"], robot),
        *(
            Fact("undetermined", str(number), "statement", text=text)
            for number, text in enumerate(blind_words.listed(tables["dh_identified"]), 1)
        ),
    ]


# What the tolerance of the configuration is of, in words.
TOLERANCE_OF = {
    "mean": "the mean error held out",
    "quantile_99": "the empirical 99 % quantile of the errors held out",
    "bound": "the upper bound of a campaign",
}


class Tolerance(NamedTuple):
    """Largest position error allowed, and of what that is said: a key of TOLERANCE_OF."""

    mm: float
    of: str

    def __str__(self) -> str:
        return f"{self.mm:g} mm for {TOLERANCE_OF[self.of]}"


def of_tolerance(section: Mapping | None) -> list[Fact]:
    """The configuration's section ``tolerance`` as facts; none where it sets none."""
    if not section or section["mm"] is None:
        return []
    return [Fact("tolerance", section["of"], "allowed", float(section["mm"]), "mm")]


def tolerance(found: Iterable[Fact]) -> Tolerance | None:
    """The tolerance of the configuration; None where it sets none."""
    stated = [each for each in found if each.topic == "tolerance"]
    return Tolerance(float(stated[0].value), str(stated[0].item)) if stated else None


def facts_in(table: Mapping[str, np.ndarray]) -> list[Fact]:
    """The facts that a table ``summary`` holds."""
    return [Fact(*row) for row in zip(*(table[name] for name in Fact._fields), strict=True)]


def selected(choice: Mapping) -> str:
    """The model that a ``model_selection`` table says is selected."""
    return next(
        str(name) for name, yes in zip(choice["model"], choice["selected"], strict=True) if yes
    )


def bending(table: Mapping | None) -> list[dict]:
    """Coefficients of every joint that bends by a ``compliance_model``, None where not fitted."""
    rows = range(len(table["joint"])) if table is not None else ()
    found = []
    for row in rows:
        values = {name: float(table[name][row]) for name in _BENDING}
        if any(np.isfinite(value) for value in values.values()):
            known = {name: value if np.isfinite(value) else None for name, value in values.items()}
            found.append({"joint": int(table["joint"][row]), **known})
    return found


def findings(table: Mapping) -> list[str]:
    """Findings of a ``data_check`` table in words, the gravest first."""
    return [each.text for each in _findings(table) if each.text]


def left_out(table: Mapping | None) -> list[str]:
    """What is not used of the measured file, in words, from a ``data_check`` table."""
    if table is None:
        return []
    pairs = zip(table["finding"], table["what"], strict=True)
    return [str(what) for kind, what in pairs if kind == LEFT_OUT]


def excluded_errors(table: Mapping, model: str) -> list[tuple[int, str, float]]:
    """Line, reason and position error in mm of every row left out; NaN where it has none."""
    size = np.linalg.norm([table[f"e{axis}_mm"] for axis in "xyz"], axis=0)
    rows = np.flatnonzero(table["comparison"] == Comparison(MEASURED, model).name)
    rows = rows[np.argsort(table["line"][rows], kind="stable")]
    return [(int(table["line"][i]), str(table["reason"][i]), float(size[i])) for i in rows]


def _data(measurements: Mapping, robot: Robot) -> Iterator[Fact]:
    rows = np.asarray(measurements.get("row", [np.nan]), dtype=float)
    source = "file" if np.isfinite(rows).any() else "synthetic"
    counts = {
        "readings": len(measurements["pose"]),
        "poses": len(np.unique(measurements["pose"])),
        "targets": len(np.unique(np.asarray(measurements["target"]).astype(str))),
        "fitted": int(np.sum(np.asarray(measurements["subset"]) == SUBSETS[0])),
    }
    yield Fact("robot", robot.name, "name", text=robot.name)
    yield Fact("data", "measurements", "source", text=source)
    yield from (Fact("data", "measurements", name, n, "1") for name, n in counts.items())


def _frames(table: Mapping) -> Iterator[Fact]:
    """Whether base and tool were fitted."""
    yield Fact("robot", "base and tool", "fitted", float(_frames_fitted(table)), "1")


def _frames_fitted(table: Mapping) -> bool:
    """Whether every model has a base and tool of its own: then they were fitted."""
    places = np.stack([table[name] for name in ("x_mm", "y_mm", "z_mm", "qx", "qy", "qz")], axis=1)
    own = np.asarray(table["model"]) == NOMINAL
    first = np.asarray(table["model"]) == np.asarray(table["model"])[~own][0]
    return not np.array_equal(places[own], places[first])


def _findings(table: Mapping | None) -> Iterator[Fact]:
    if table is None:
        return
    note = FINDING_LEVELS[-1]
    order = [i for i, kind in enumerate(table["finding"]) if kind != LEFT_OUT]
    order.sort(key=lambda i: table["level"][i] == note)
    for i in order:
        text = f"{table['finding'][i]}: {table['what'][i]}"
        lines = str(table["lines"][i] or "")
        told = re.search(rf"{re.escape(lines)}(?![\w-])", text)
        text += "" if told else f"; {lines}"
        text += f"; accepted: {table['accepted'][i]}" if table["accepted"][i] else ""
        count = float(table["rows"][i])
        yield Fact("check", str(table["finding"][i]), str(table["level"][i]), count, "1", text)
    yield Fact("check", "data_check", "findings", float(len(order)), "1")


def of_errors(table: Mapping) -> Iterator[Fact]:
    """Statistics of every comparison; held out at rows that every model was tried on."""
    comparison, estimate = (np.asarray(table[name]) for name in ("comparison", "estimate"))
    sizes = np.linalg.norm([table[f"e{axis}_mm"] for axis in "xyz"], axis=0)
    turns = np.linalg.norm([table[f"r{axis}_mrad"] for axis in "xyz"], axis=0)
    populations = {
        "cross_validated": ("held_out_error", "held_out_model_difference"),
        "train": ("training_error", "model_difference"),
    }
    for kind, topics in populations.items():
        of_kind = {
            each: np.flatnonzero((comparison == each.name) & (estimate == kind))
            for each in sorted(COMPARISONS, key=lambda each: _ORDER.index(each.model))
        }
        there = {each: rows for each, rows in of_kind.items() if len(rows)}
        if not there:
            continue
        common = set.intersection(*(set(table["row"][rows]) for rows in there.values()))
        for each, rows in there.items():
            shared = rows[np.isin(table["row"][rows], list(common))]
            measured = each.reference == MEASURED
            item = each.model if measured else each.name
            yield from _sized(topics[0 if measured else 1], item, sizes[shared], "mm")
            if measured and kind == "cross_validated":
                turned = turns[shared[np.isfinite(turns[shared])]]
                yield from _sized("held_out_orientation_error", item, turned, "mrad")


def _sized(topic: str, item: str, size: np.ndarray, unit: str) -> Iterator[Fact]:
    """The statistics of magnitudes (n,), none where there are none."""
    if len(size):
        for name, value in zip(_STATISTICS, _statistics(size), strict=True):
            yield Fact(topic, item, name, value, "1" if name == "n" else unit)


def _statistics(size: np.ndarray) -> tuple[float, ...]:
    """Number, mean, empirical 99 % quantile and largest of magnitudes (n,)."""
    quantile = np.quantile(size, LARGE_SHARE)
    return float(len(size)), float(size.mean()), float(quantile), float(size.max())


def of_selection(tables: Mapping, robot: Robot) -> Iterator[Fact]:
    choice = tables["model_selection"]
    for i, name in enumerate(map(str, choice["model"])):
        yield Fact("selection", name, "selected", float(choice["selected"][i]), "1")
        yield Fact("selection", name, "held_out_rms", float(choice["held_out_rms_mm"][i]), "mm")
        yield Fact("selection", name, "gain", float(choice["gain_mm2"][i]), "mm^2")
        error = float(choice["gain_std_error_mm2"][i])
        yield Fact("selection", name, "gain_std_error", error, "mm^2")
        order = tables.get(f"{name}_model", {}).get("order")
        if order is not None:
            yield Fact("selection", name, "order", float(np.max(order)), "1")
            yield from _orders(name, tables, robot)


def _orders(name: str, tables: Mapping[str, Columns], robot: Robot) -> Iterator[Fact]:
    """The orders that held-out errors were found with, and the highest of several tried."""
    table = tables.get(f"{name}_orders")
    if table is None:
        return
    order, chosen = (np.asarray(table[each], dtype=float) for each in ("order", "chosen"))
    folds = np.isfinite(np.asarray(table["fold"], dtype=float)) & (chosen == 1)
    if folds.any():
        yield Fact("selection", name, "low_order_held_out", float(order[folds].min()), "1")
        yield Fact("selection", name, "high_order_held_out", float(order[folds].max()), "1")
    if len(np.unique(order)) > 1:
        from kinacc.calibration.selection import ORDERS

        yield Fact("selection", name, "highest_order_tried", float(order.max()), "1")
        count, most = _carried(tables["measurements"], robot, _frames_fitted(tables["frames"]))
        higher = next((each for each in ORDERS if each > order.max()), most)
        yield Fact("selection", name, "configurations", float(count), "1")
        by = SETTINGS if higher <= most else CONFIGURATIONS
        yield Fact("selection", name, "highest_order_set_by", text=by)


def _carried(measurements: Mapping, robot: Robot, frames_fitted: bool) -> tuple[int, int]:
    """Number of configurations that folds hold out, and the highest order they carry."""
    from kinacc.calibration import frames
    from kinacc.calibration.observations import from_columns
    from kinacc.calibration.selection import carried, highest_order

    every = from_columns(measurements, robot)
    anywhere = frames.known(sessions=len(every.session_names), targets=len(every.target_names))
    estimated = frames.coordinates(every, anywhere, frames_fitted, frames_fitted).size
    seen = every.select(every.fold >= 0)
    most = highest_order(carried(seen), every.joints, estimated)
    return len(np.unique(configurations(seen.pose, seen.q_rad))), most


def _excluded(table: Mapping | None, model: str) -> Iterator[Fact]:
    if table is None:
        return
    names = RowNames.of_columns({**table, "row": table["line"]})
    for line, reason, error in excluded_errors(table, model):
        unit = "mm" if np.isfinite(error) else None
        yield Fact("excluded_rows", names.one(line), "error", error, unit, reason)


def _range(measurements: Mapping, robot: Robot) -> Iterator[Fact]:
    """Range of each reported joint that the poses cover, and its share of the joint's travel."""
    for joint, (low, high) in enumerate(zip(*covered(measurements, robot), strict=True)):
        slides = bool(robot.dh.prismatic[joint])
        scale, unit = (1.0, "mm") if slides else (180.0 / np.pi, "deg")
        share = (high - low) / (robot.q_max_rad[joint] - robot.q_min_rad[joint])
        item = f"joint {joint + 1}"
        yield Fact("range", item, "low", float(scale * low), unit)
        yield Fact("range", item, "high", float(scale * high), unit)
        yield Fact("range", item, "share", float(share), "1")


def covered(measurements: Mapping, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Ends (k,), (k,) of the reported joints of all poses."""
    reported = _reported(measurements, robot)
    return reported.min(axis=0), reported.max(axis=0)


def _reported(measurements: Mapping, robot: Robot) -> np.ndarray:
    """Reported joints (n, k)."""
    numbers = range(1, len(robot.q_min_rad) + 1)
    return np.stack([np.asarray(measurements[f"q{n}"], dtype=float) for n in numbers], axis=1)


def _like_measured(share: float) -> Iterator[Fact]:
    if np.isfinite(share):
        yield Fact("like_measured", "ranges of all joints", "share", share, "1")


def of_pointing(measurements: Mapping, robot: Robot) -> Iterator[Fact]:
    """How far the flange turns away from one direction, where that is next to nothing."""
    axis = dh.forward(robot.dh, robot.dh_joints(_reported(measurements, robot))).rotation[..., 2]
    middle = axis.mean(axis=0)
    along = axis @ middle / max(float(np.linalg.norm(middle)), _LEAST_LENGTH)
    off = float(np.rad2deg(np.arccos(np.clip(along.min(), -1.0, 1.0))))
    if off < _ONE_WAY_DEG:
        yield Fact("one_way", "flange", "farthest_off", off, "deg")


def of(found: Iterable[Fact], topic: str) -> dict[str, dict[str, Fact]]:
    """Facts on one topic by item and statistic, in their order."""
    chosen: dict[str, dict[str, Fact]] = {}
    for each in found:
        if each.topic == topic:
            chosen.setdefault(each.item, {})[each.statistic] = each
    return chosen
