"""How assessors would do on this arm: what they state under noise, beside the known error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from bokeh.models import CDSView, FixedTicker, GroupFilter
from bokeh.models.annotations import Label

from kinacc.artifacts.columns import Columns
from kinacc.kinematics.robot import Robot
from kinacc.report import pictures
from kinacc.report.page import Block, Control, Option, Picture, Section, Table, Text
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION
from kinacc.study.summary import are_measured

_UM = 1e3
_MOST_RUNS = 6_000  # drawn one by one
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


def section(tables: Mapping[str, Columns], robot: Robot) -> Section:
    """The section of a page on ``study_summary`` and ``study``, held to ``truth``."""
    summary, held_to = tables["study_summary"], truth(tables)
    levels = np.unique(summary["noise_mm"])
    blocks: list[Block] = [_over_noise(summary, held_to)]
    if "study" in tables:
        blocks.append(_runs(tables["study"], held_to))
        blocks += map(Text, _words(summary, tables["study"], held_to))
        blocks.append(_table(summary, tables["study"], held_to))
    counts = summary["repetitions"]
    span = f"{np.min(counts)}" if np.ptp(counts) == 0 else f"{np.min(counts)} to {np.max(counts)}"
    return Section(
        "study",
        "Study: what assessors would state here",
        f"{len(tables['assessment_points']['point'])} operating points of the study with errors "
        f"that it takes as known ({held_to.what}); {span} simulations at each of {len(levels)} "
        "noise levels. The readings are simulated: nothing of this was measured in a campaign",
        "The accuracy that the paper's methods would state from noisy readings of these points, "
        f"beside the largest error among them, {held_to.largest_mm:.3f} mm.",
        "Good: a narrow band about the line at the noise of your instrument. Bad: a band below "
        "the line, for it calls the model better than it is, or one that rises with the noise, "
        "for it states the noise and not the robot.",
        "Do not state a largest error by these three: they come with no confidence. Plan a "
        "campaign for your noise (kinacc plan-campaign), and run it (kinacc campaign start).",
        tuple(blocks),
    )


def _assessors(table: Columns) -> list[str]:
    """The paper's first, in its order; then others by name."""
    there = set(map(str, table["assessor"]))
    return [name for name in _LOOKS if name in there] + sorted(there - set(_LOOKS))


def _look(name: str, number: int) -> tuple[str, str, str, str]:
    """Label, colour, marker and dash of an assessor."""
    return _LOOKS.get(name) or (name.replace("_", " "), *_OTHERS[number % len(_OTHERS)])


def _over_noise(summary: Columns, held_to: Truth) -> Picture:
    plot = pictures.figure(
        "noise of one reading, standard deviation per axis, µm",
        "assessed accuracy, mm",
        height_px=340,
        tools="box_zoom,reset,save",
    )
    for number, name in enumerate(_assessors(summary)):
        label, colour, marker, dash = _look(name, number)
        mine = np.flatnonzero(np.asarray(summary["assessor"]) == name)
        mine = mine[np.argsort(summary["noise_mm"][mine], kind="stable")]
        columns = {each: summary[f"{each}_mm"][mine] for each in ("mean", "min", "max", "bias")}
        columns["noise"] = summary["noise_mm"][mine] * _UM
        data = pictures.source(f"study-{name}", columns)
        plot.varea("noise", "min", "max", source=data, color=colour, alpha=0.13, legend_label=label)
        plot.line(
            "noise",
            "mean",
            source=data,
            color=colour,
            line_width=2,
            line_dash=dash,
            legend_label=label,
        )
        points = plot.scatter(
            "noise", "mean", source=data, color=colour, marker=marker, size=9, legend_label=label
        )
        told = [
            ("", f"{label}, @noise{{0}} µm"),
            ("mean, mm", "@mean{0.000}"),
            ("smallest to largest, mm", "@min{0.000} to @max{0.000}"),
            ("mean less the line, mm", "@bias{+0.000}"),
        ]
        pictures.hover(plot, told, points)
    ends = np.array([np.min(summary["noise_mm"]), np.max(summary["noise_mm"])]) * _UM
    label = f"{held_to.called}, {held_to.largest_mm:.3f} mm"
    plot.line(
        ends, held_to.largest_mm, color=GREY, line_width=2.5, line_dash="8 4", legend_label=label
    )
    pictures.legend_above(plot)
    caption = (
        "Lines: mean of the simulations; bands: from the smallest to the largest of them; grey: "
        f"the {held_to.called}. A click in the legend hides a method."
    )
    return Picture("study-noise", plot, f"Assessed accuracy over noise. {caption}", caption)


def _runs(study: Columns, held_to: Truth) -> Picture:
    """Every single simulation, one noise level at a time."""
    names = _assessors(study)
    levels, of_level = np.unique(study["noise_mm"], return_inverse=True)
    step = -(-len(of_level) // _MOST_RUNS)
    drawn = np.flatnonzero(np.asarray(study["repetition"]) % step == 0)
    assessor = np.array([names.index(str(each)) for each in study["assessor"]])[drawn]
    repetition = np.asarray(study["repetition"])[drawn]
    labels = tuple(_look(name, number)[0] for number, name in enumerate(names))
    columns = {
        "level": of_level[drawn].astype(np.int16),
        "assessor": assessor.astype(np.int8),
        "repetition": repetition.astype(np.int32),
        "place": -assessor + 0.6 * (repetition * _GOLDEN % 1.0 - 0.5),
        "less": np.asarray(study["assessed_mm"])[drawn] - held_to.largest_mm,
    }
    for name in ("assessed_mm", "measurements", "points_visited", "lower_mm", "upper_mm"):
        columns[name] = np.asarray(study[name], dtype=float)[drawn]
    data = pictures.source("study-runs", columns)
    plot = pictures.figure("assessed accuracy, mm", "", height_px=90 + 75 * len(names))
    shown = GroupFilter("level", 0, name="study-level")
    for number, name in enumerate(names):
        _, colour, marker, _ = _look(name, number)
        points = plot.scatter(
            "assessed_mm", "place", source=data, marker=marker, color=colour, size=7,
            fill_alpha=0.45, view=CDSView(filter=shown & GroupFilter("assessor", number)),
            nonselection_alpha=0.4, selection_color=VERMILION,
        )  # fmt: skip
        told = [
            ("", f"{labels[number]}, simulation @repetition"),
            ("stated, mm", "@assessed_mm{0.000}"),
            ("less the line, mm", "@less{+0.000}"),
        ]
        pictures.hover(plot, told, points)
    largest = held_to.largest_mm
    plot.vspan(x=largest, line_color=GREY, line_width=2.5, line_dash="8 4")
    words = f"{held_to.called} {largest:.3f} mm"
    plot.add_layout(Label(x=largest, y=0.42, text=words, text_font_size="12px", x_offset=4))
    plot.yaxis.ticker = FixedTicker(ticks=[-n for n in range(len(names))])
    plot.yaxis.major_label_overrides = {
        -n: label.replace(" ", "\n") for n, label in enumerate(labels)
    }
    plot.y_range.update(start=0.4 - len(names), end=0.75)
    plot.ygrid.visible = False
    options = tuple(
        Option(f"{level * _UM:g} µm", (("study-level", "group", number),))
        for number, level in enumerate(levels)
    )
    caption = (
        "Each point is what one simulation would state. Left of the dashed line it calls the "
        "model better than it is."
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
        "study-runs", plot, f"Assessed accuracy of single simulations. {caption}", caption,
        (Control("Noise", options),), details, {"assessor": labels},
    )  # fmt: skip


def _too_small(study: Columns, name: str, noise_mm: float, held_to: Truth) -> tuple[int, int]:
    """In how many simulations the stated value is below the largest error, and of how many."""
    mine = (np.asarray(study["assessor"]) == name) & (np.asarray(study["noise_mm"]) == noise_mm)
    stated = np.asarray(study["assessed_mm"])[mine]
    return int((stated < held_to.largest_mm).sum()), len(stated)


def _words(summary: Columns, study: Columns, held_to: Truth) -> list[str]:
    """One sentence a method: how far off, and how often too small, at least and most noise."""
    ends = np.unique(summary["noise_mm"])[[0, -1]]
    found = []
    for number, name in enumerate(_assessors(summary)):
        parts = []
        for noise in dict.fromkeys(ends.tolist()):
            mine = (np.asarray(summary["assessor"]) == name) & (summary["noise_mm"] == noise)
            bias = float(summary["bias_mm"][mine][0])
            low, of = _too_small(study, name, noise, held_to)
            side = "above" if bias >= 0 else "below"
            parts.append(
                f"at {noise * _UM:g} µm on average {abs(bias):.3f} mm {side} the line, and too "
                f"small in {low} of {of} simulations"
            )
        label = _look(name, number)[0]
        found.append(f"{label[0].upper()}{label[1:]}: {'; '.join(parts)}.")
    return found


def _table(summary: Columns, study: Columns, held_to: Truth) -> Table:
    rows = []
    for number, name in enumerate(_assessors(summary)):
        mine = np.flatnonzero(np.asarray(summary["assessor"]) == name)
        for row in mine[np.argsort(summary["noise_mm"][mine], kind="stable")]:
            noise = float(summary["noise_mm"][row])
            low, of = _too_small(study, name, noise, held_to)
            sizes = (f"{summary[f'{each}_mm'][row]:.3f}" for each in ("mean", "min", "max"))
            bias = f"{summary['bias_mm'][row]:+.3f}"
            label = _look(name, number)[0]
            rows.append((label, f"{noise * _UM:g}", *sizes, bias, f"{low} of {of}"))
    heads = ("method", "noise, µm", "mean", "smallest", "largest", "mean less line", "too small in")
    return Table(
        f"What each method states, mm; line: {held_to.called}, {held_to.largest_mm:.3f} mm",
        heads,
        tuple(rows),
        frozenset(range(1, len(heads))),
        folded=True,
    )
