"""How assessors would do on this arm: what they state under noise, beside the known error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from bokeh.models import CDSView, FixedTicker, GroupFilter
from bokeh.models.annotations import Label

from kinacc.kinematics.robot import Robot
from kinacc.report import pictures
from kinacc.report.page import Control, Option, Part, Picture, records
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION
from kinacc.tables.columns import Columns

_UM = 1e3
_MOST_RUNS = 6_000  # drawn one by one
TRUE = {"color": GREY, "line_width": 2.5, "line_dash": "8 4"}  # the line of the largest error
_GOLDEN = 0.618034  # spreads neighbours evenly across a row
_LOOKS = {
    "maximum": ("maximum measurement", ORANGE, "square", "dashed"),
    "outlier_rejection": ("outlier rejection", GREEN, "triangle", "dotted"),
    "model_invalidation": ("model invalidation", BLUE, "circle", "solid"),
}
_OTHERS = ((PURPLE, "diamond", "dashdot"), (VERMILION, "inverted_triangle", "dotdash"))


@dataclass(frozen=True)
class Truth:
    """The largest error of the study's points in mm, and what it is: known or taken as true."""

    largest_mm: float
    what: str
    known: bool

    @property
    def called(self) -> str:
        """Its name in pictures and tables."""
        return "true largest error" if self.known else "largest error, taken as true"


def truth(tables: Mapping[str, Columns]) -> Truth:
    """What the study holds assessors to, of ``assessment_points``."""
    points, measurements = tables["assessment_points"], tables["measurements"]
    largest = float(np.max(points["true_error_mm"]))
    if are_measured(points, measurements):
        what = "held-out errors of DH at measured poses, which contain the instrument's noise"
        return Truth(largest, what, False)
    if np.isfinite(np.asarray(measurements["row"], dtype=float)).any():
        return Truth(largest, "VEC minus DH of this arm: of models, not measured", False)
    return Truth(largest, "VEC minus DH of the synthetic arm: known exactly", True)


def section(tables: Mapping[str, Columns], robot: Robot) -> Part:
    """The section of a page on ``study_summary`` and ``study``, held to ``truth``."""
    summary, study, held_to = tables["study_summary"], tables.get("study"), truth(tables)
    looks = _looks(summary)
    place = list(looks)
    rows = [each | {"label": looks[each["assessor"]][0]} for each in records(summary)]
    for row in rows if study else ():
        mine = (study["assessor"] == row["assessor"]) & (study["noise_mm"] == row["noise_mm"])
        stated = study["assessed_mm"][mine]
        row["too_small"] = f"{np.sum(stated < held_to.largest_mm)} of {len(stated)}"
    rows.sort(key=lambda each: (place.index(each["assessor"]), each["noise_mm"]))
    values = {
        "points": len(tables["assessment_points"]["point"]),
        "levels": len(np.unique(summary["noise_mm"])),
        "truth": held_to,
        "rows": rows,
        "runs": study is not None,
    }
    drawn = (_runs(study, held_to),) if study else ()
    return Part("study", values, (_over_noise(rows, looks, held_to), *drawn))


def _looks(table: Columns) -> dict[str, tuple[str, str, str, str]]:
    """Label, colour, marker and dash by assessor: the paper's in its order, then others by name."""
    there = sorted(set(map(str, table["assessor"])))
    others = [name for name in there if name not in _LOOKS]
    spare = {
        name: (name.replace("_", " "), *_OTHERS[number % len(_OTHERS)])
        for number, name in enumerate(others)
    }
    return {name: look for name, look in _LOOKS.items() if name in there} | spare


def _over_noise(rows: Sequence[Mapping], looks: Mapping[str, tuple], held_to: Truth) -> Picture:
    plot = pictures.figure(
        "noise of one reading, standard deviation per axis, µm",
        "assessed accuracy, mm",
        height_px=340,
        tools="box_zoom,reset,save",
    )
    for name, (label, colour, marker, dash) in looks.items():
        mine = [each for each in rows if each["assessor"] == name]
        names = ("mean_mm", "min_mm", "max_mm", "bias_mm")
        columns = {each: np.array([row[each] for row in mine]) for each in names}
        columns["noise"] = np.array([row["noise_mm"] * _UM for row in mine])
        shared = {
            "source": pictures.source(f"study-{name}", columns),
            "color": colour,
            "legend_label": label,
        }
        plot.varea("noise", "min_mm", "max_mm", **shared, alpha=0.13)
        plot.line("noise", "mean_mm", **shared, line_width=2, line_dash=dash)
        told = [
            ("", f"{label}, @noise{{0}} µm"),
            ("mean, mm", "@mean_mm{0.000}"),
            ("smallest to largest, mm", "@min_mm{0.000} to @max_mm{0.000}"),
            ("mean less the line, mm", "@bias_mm{+0.000}"),
        ]
        pictures.hover(
            plot, told, plot.scatter("noise", "mean_mm", **shared, marker=marker, size=9)
        )
    noise = [row["noise_mm"] * _UM for row in rows]
    words = f"{held_to.called}, {held_to.largest_mm:.3f} mm"
    ends = np.array([min(noise), max(noise)])
    plot.line(ends, held_to.largest_mm, **TRUE, legend_label=words)
    pictures.legend_above(plot)
    return Picture("study-noise", plot)


def _runs(study: Columns, held_to: Truth) -> Picture:
    """Every single simulation, one noise level at a time."""
    looks = _looks(study)
    levels, of_level = np.unique(study["noise_mm"], return_inverse=True)
    drawn = np.flatnonzero(study["repetition"] % -(-len(of_level) // _MOST_RUNS) == 0)
    assessor = np.array([list(looks).index(each) for each in study["assessor"]])[drawn]
    repetition = study["repetition"][drawn]
    columns = {
        "level": of_level[drawn].astype(np.int16),
        "assessor": assessor.astype(np.int8),
        "repetition": repetition.astype(np.int32),
        "place": -assessor + 0.6 * (repetition * _GOLDEN % 1.0 - 0.5),
        "less": study["assessed_mm"][drawn] - held_to.largest_mm,
    }
    for name in ("assessed_mm", "measurements", "points_visited", "lower_mm", "upper_mm"):
        columns[name] = np.asarray(study[name], dtype=float)[drawn]
    data = pictures.source("study-runs", columns)
    plot = pictures.figure("assessed accuracy, mm", "", height_px=90 + 75 * len(looks))
    shown = GroupFilter("level", 0, name="study-level")
    for number, (label, colour, marker, _) in enumerate(looks.values()):
        points = plot.scatter(
            "assessed_mm", "place", source=data, marker=marker, color=colour, size=7,
            fill_alpha=0.45, view=CDSView(filter=shown & GroupFilter("assessor", number)),
            nonselection_alpha=0.4, selection_color=VERMILION,
        )  # fmt: skip
        told = [
            ("", f"{label}, simulation @repetition"),
            ("stated, mm", "@assessed_mm{0.000}"),
            ("less the line, mm", "@less{+0.000}"),
        ]
        pictures.hover(plot, told, points)
    largest = held_to.largest_mm
    plot.vspan(x=largest, line_color=GREY, line_width=2.5, line_dash="8 4")
    words = f"{held_to.called} {largest:.3f} mm"
    plot.add_layout(Label(x=largest, y=0.42, text=words, text_font_size="12px", x_offset=4))
    labels = {-n: look[0] for n, look in enumerate(looks.values())}
    plot.yaxis.ticker = FixedTicker(ticks=list(labels))
    plot.yaxis.major_label_overrides = {n: each.replace(" ", "\n") for n, each in labels.items()}
    plot.y_range.update(start=0.4 - len(looks), end=0.75)
    plot.ygrid.visible = False
    options = tuple(
        Option(f"{level * _UM:g} µm", (("study-level", "group", number),))
        for number, level in enumerate(levels)
    )
    details = {
        "assessor": "{}",
        "repetition": "simulation {}",
        "assessed_mm": "states {} mm",
        "less": "less the dashed line {} mm",
        "measurements": "{} readings",
        "points_visited": "of {} points",
        "lower_mm": "at least {} mm",
        "upper_mm": "at most {} mm",
    }
    return Picture(
        "study-runs", plot, controls=(Control("Noise", options),), details=details,
        names={"assessor": tuple(labels.values())},
    )  # fmt: skip


def are_measured(points: Mapping, measurements: Mapping) -> bool:
    """Whether every operating point is at joints that were measured."""
    names = [name for name in points if name[:1] == "q" and name[1:].isdigit()]
    measured = set(zip(*(np.asarray(measurements[name]).tolist() for name in names), strict=True))
    wanted = zip(*(np.asarray(points[name]).tolist() for name in names), strict=True)
    return all(each in measured for each in wanted)
