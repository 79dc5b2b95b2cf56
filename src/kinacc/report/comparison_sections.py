"""Sections of a page that compares calibrations: how far poses moved, where, and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from bokeh.models import CDSView, ColumnDataSource, HoverTool, IndexFilter
from bokeh.models.annotations import BoxAnnotation, Span

from kinacc.deployment.compare import Difference, Parameters, Shift
from kinacc.deployment.compare_words import is_in_doubt, number, remarks, shown_in
from kinacc.report import pictures
from kinacc.report.page import Block, Control, Option, Picture, Section, Table
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, VERMILION

_MOST_POSES = 6_000  # drawn one by one; of more every n-th is, and all of the largest
_WORST = 10
_STEPS = 200  # of the distribution
_QUANTILES = (0.5, 0.9, 0.99, 1.0)
FAR = 3.0  # standard deviations
LOOKS = {
    "plain": ("as they stand", ORANGE, "triangle", "solid"),
    "apart": ("after the best base and tool", GREEN, "circle", "dashed"),
}


@dataclass(frozen=True)
class Case:
    """What the page is about: the names, the poses (n, 3) of the first, and where it may be read.

    ``number`` (n,) are those of the poses among all given; ``measured`` (n,): where both
    calibrations were measured; ``extrapolates``: at so few poses that models without parameters of
    their own say nothing.
    """

    found: Difference
    names: tuple[str, str]
    model: str
    number: np.ndarray
    joints: np.ndarray
    slides: np.ndarray
    position_mm: np.ndarray
    measured: np.ndarray
    left_mm: tuple[float, ...]
    extrapolates: bool

    @property
    def shifts(self) -> Mapping[str, Shift]:
        """How poses moved, by what is done with base and tool."""
        return {"plain": self.found.as_they_stand, "apart": self.found.apart_from_frames}

    @property
    def in_doubt(self) -> bool:
        """Whether a change may be other poses."""
        return is_in_doubt(self.measured)


def shown(value: float) -> str:
    """A size as the tables show it; a dash where there is none."""
    if not np.isfinite(value):
        return "-"
    return number(value) if abs(value) >= 1000.0 else f"{value:.3f}"


def moved(case: Case) -> Section:
    """How far poses moved: the distribution of the shifts."""
    return Section(
        "moved",
        "How far poses moved",
        f"{len(case.joints)} modelled poses of the flange; no readings",
        "Which share of the poses moved by no more than so much: as they stand, and after the base "
        "and tool that bring the two closest.",
        "Good: both curves rise left of the dotted lines, which are what two calibrations of an "
        "unchanged arm show by chance. Bad: the curve after base and tool lies far to the right.",
        "Where only the first curve lies to the right, set up base and tool anew; where both do, "
        "the joints changed: look where, below.",
        (_distribution(case), _quantiles(case)),
    )


def _distribution(case: Case) -> Picture:
    share = np.linspace(0.0, 1.0, _STEPS + 1)
    columns = {"share": 100.0 * share}
    for key, shift in case.shifts.items():
        columns[f"{key}_mm"] = np.quantile(shift.position_mm, share)
        columns[f"{key}_mrad"] = 1e3 * np.quantile(shift.orientation_rad, share)
    data = pictures.source("distribution", columns)
    plot = pictures.figure("change of position, mm", "poses that moved no more, %")
    places = []
    for key, (label, colour, _, dash) in LOOKS.items():
        line = plot.line(
            f"{key}_mm", "share", source=data, line_color=colour, line_dash=dash, line_width=2,
            legend_label=label,
        )  # fmt: skip
        line.glyph.name = f"moved-{key}"
        hover = [("", f"@share{{0}} % {label}"), ("no more than", f"@{key}_mm{{0.000}} mm, "
                 f"@{key}_mrad{{0.000}} mrad")]  # fmt: skip
        plot.add_tools(HoverTool(tooltips=hover, renderers=[line]))
        shift = case.shifts[key]
        if np.isfinite(shift.chance_mm) and shift.chance_mm > 0.0:
            place = Span(
                dimension="height", location=shift.chance_mm, line_color=colour,
                line_dash="dotted", line_width=2, name=f"moved-chance-{key}",
            )  # fmt: skip
            plot.add_layout(place)
            places.append((place.name, shift.chance_mm, 1e3 * shift.chance_rad))
    plot.xaxis[0].name = "moved-axis"
    plot.x_range.update(start=0.0)
    plot.legend.orientation = "horizontal"
    plot.add_layout(plot.legend[0], "above")
    caption = "Dotted: rms expected by chance. " if places else ""
    caption += "To the left is good. The tables give the same in numbers."
    return Picture(
        "distribution", plot, f"Distribution of the shifts of the poses. {caption}", caption,
        (_quantity(places),),
    )  # fmt: skip


def _quantity(places: list[tuple[str, float, float]]) -> Control:
    """A control of what is drawn: position or orientation, with its marks of chance."""
    options = []
    for place, (label, unit) in enumerate((("position", "mm"), ("orientation", "mrad"))):
        sets: list[tuple[str, str, object]] = [
            (f"moved-{key}", "x", pictures.field(f"{key}_{unit}")) for key in LOOKS
        ]
        sets += [(name, "location", chance[place]) for name, *chance in places]
        sets.append(("moved-axis", "axis_label", f"change of {label}, {unit}"))
        options.append(Option(label, tuple(sets)))
    return Control("Quantity", tuple(options))


def _quantiles(case: Case) -> Table:
    rows = []
    for share in _QUANTILES:
        cells = []
        for shift in case.shifts.values():
            cells += [
                shown(float(np.quantile(shift.position_mm, share))),
                shown(1e3 * float(np.quantile(shift.orientation_rad, share))),
            ]
        rows.append(("all" if share == 1.0 else f"{share:.0%}", *cells))
    heads = ("of the poses", "as they stand, mm", "mrad", "after base and tool, mm", "mrad")
    return Table(
        "Poses moved no more than", heads, tuple(rows), numeric=frozenset(range(1, 5))
    )  # fmt: skip


def where(case: Case) -> Section:
    """Where poses moved: over joints and in space."""
    data, drawn, largest = _poses(case)
    place = {int(row): i for i, row in enumerate(drawn)}
    blocks: tuple[Block, ...] = (
        _over_joint(case, data),
        _in_space(case, data),
        _worst(case, largest, [place[int(row)] for row in largest]),
    )
    return Section(
        "where",
        "Where they moved",
        f"{len(drawn)} of {len(case.joints)} modelled poses of the flange, the largest shifts "
        "among them",
        "The same shifts over the angle of each joint, and in the robot's base.",
        "Good: no slope and no wave, at any joint. Bad: shifts that grow with the angle of one "
        "joint (that joint), or with the reach (a link, a base that tilts).",
        "Look for what happened at that joint or place: a crash, a new motor or gear, a tool or "
        "base that was taken off.",
        blocks,
    )


def _poses(case: Case) -> tuple[ColumnDataSource, np.ndarray, np.ndarray]:
    count = len(case.joints)
    step = -(-count // _MOST_POSES)
    largest = np.argsort(-case.found.apart_from_frames.position_mm, kind="stable")[:_WORST]
    rows = np.unique([*range(0, count, step), *largest])
    columns: dict[str, np.ndarray] = {}
    for key, shift in case.shifts.items():
        columns[f"{key}_mm"] = shift.position_mm[rows]
        columns[f"{key}_mrad"] = 1e3 * shift.orientation_rad[rows]
    columns |= {f"q{n + 1}": case.joints[rows, n] for n in range(case.joints.shape[1])}
    columns |= {axis: case.position_mm[rows, i] for i, axis in enumerate("xyz")}
    words = np.where(case.measured[rows], "both were measured there", "not measured by both there")
    columns |= {"number": case.number[rows], "standing": words.astype(object)}
    return pictures.source("poses", columns), rows, largest


def _hover() -> list[tuple[str, str]]:
    sizes = [(words, f"@{key}_mm{{0.000}} mm, @{key}_mrad{{0.000}} mrad")
             for key, (words, *_) in LOOKS.items()]  # fmt: skip
    return [("pose", "@number"), *sizes, ("", "@standing")]


def _details(case: Case) -> dict[str, str]:
    told = {"number": "pose {}"}
    for key, (words, *_) in LOOKS.items():
        told |= {f"{key}_mm": f"{words} {{}} mm", f"{key}_mrad": "{} mrad"}
    told |= {f"q{n + 1}": f"J{n + 1} {{}}" for n in range(case.joints.shape[1])}
    return {**told, "standing": "{}"}


def _over_joint(case: Case, data: ColumnDataSource) -> Picture:
    axes = [
        (f"{n + 1}", f"q{n + 1}", f"joint {n + 1}, {'mm' if slides else 'deg'}")
        for n, slides in enumerate(case.slides)
    ]
    plot = pictures.figure(axes[0][2], "change of position, mm", hover=_hover())
    for key, (label, colour, marker, _) in LOOKS.items():
        drawn = plot.scatter(
            "q1", f"{key}_mm", source=data, size=5, marker=marker, color=colour,
            fill_alpha=0.6 if key == "apart" else 0.0, line_alpha=0.6, legend_label=label,
            nonselection_alpha=0.25, selection_line_color=VERMILION,
            selection_fill_color=VERMILION,
        )  # fmt: skip
        drawn.glyph.name = f"over-{key}"
    plot.xaxis[0].name = "over-axis"
    plot.legend.click_policy = "hide"
    plot.legend.orientation = "horizontal"
    plot.add_layout(plot.legend[0], "above")
    pictures.from_zero(plot)
    named = {f"over-{key}": ("x",) for key in LOOKS}
    caption = "How far each pose moved, over the angle of one joint. A click in the legend hides."
    return Picture(
        "over-joint", plot, caption, caption, (pictures.choice("Joint", axes, named, "over-axis"),),
        _details(case), invitation="Select a pose to see what it is.",
    )  # fmt: skip


def _in_space(case: Case, data: ColumnDataSource) -> Picture:
    top = float(np.max(np.asarray(data.data["apart_mm"]))) or 1.0
    plot, control = pictures.in_space("space", data, "apart_mm", top, "moved, mm", _hover())
    caption = (
        f"Where the flange is by {case.names[0]}, in the robot's base; the colour is how far it "
        "moved after the best base and tool."
    )
    return Picture(
        "space", plot, f"Shifts in space. {caption}", caption, (control,), _details(case),
        invitation="Select a pose to see what it is.",
    )  # fmt: skip


def _worst(case: Case, rows: np.ndarray, picks: list[int]) -> Table:
    units = ["mm" if slides else "deg" for slides in case.slides]
    heads = ("pose", *(f"{words}, mm" for words, *_ in LOOKS.values()),
             *(f"J{n + 1} {unit}" for n, unit in enumerate(units)))  # fmt: skip
    return Table(
        f"The {len(rows)} poses that moved the most after the best base and tool",
        heads,
        tuple(
            (
                str(case.number[row]),
                *(shown(float(shift.position_mm[row])) for shift in case.shifts.values()),
                *(f"{joint:.2f}" for joint in np.round(case.joints[row], 2) + 0.0),
            )
            for row in rows
        ),
        numeric=frozenset(range(len(heads))),
        picked_in="over-joint",
        picks=tuple(picks),
    )


def parameters(case: Case, each: Parameters) -> Section:
    """The parameters of both, in standard deviations of their difference."""
    known = bool(np.isfinite(each.sigmas).any())
    blocks: list[Block] = [_bars(each)] if known else []
    return Section(
        "parameters",
        "Parameters",
        f"{len(each.names)} DH parameters of {case.names[1]} minus those of {case.names[0]}",
        "How far each parameter moved, in standard deviations of the difference where both "
        "calibrations know one.",
        "Good: all within 3. Bad: one or two joints far beyond it. Parameters that the poses of "
        "either leave open differ without meaning.",
        "Take a single parameter for a cause only where the poses show it as well: base, tool and "
        "neighbouring joints share what they do.",
        (*blocks, _table_of_parameters(case, each, folded=known)),
    )


def _bars(each: Parameters) -> Picture:
    names, unit, scale = shown_in(each)
    sigmas, known = each.sigmas, np.isfinite(each.sigmas)
    change = each.difference * scale
    data = pictures.source(
        "parameters",
        {
            "called": names,
            "sigmas": np.where(known, sigmas, 0.0),
            "said": np.array([f"{s:+.1f} standard deviations" if k else "no standard deviation"
                              for s, k in zip(sigmas, known, strict=True)], dtype=object),
            "change": np.array([f"{c:+.4f} {u}" for c, u in zip(change, unit, strict=True)],
                               dtype=object),
            "remark": np.array([str(r) or "determined in both" for r in remarks(each)],
                               dtype=object),
        },
    )  # fmt: skip
    plot = pictures.figure(
        "change, standard deviations", "", height_px=90 + 19 * len(names),
        y_range=[str(name) for name in names[::-1]],
    )  # fmt: skip
    plot.add_layout(BoxAnnotation(left=-FAR, right=FAR, fill_color=GREY, fill_alpha=0.15))
    far = known & (np.abs(sigmas) > FAR)
    drawn = []
    for which, colour, hatch, label in (
        (known & ~far, BLUE, " ", f"within {FAR:g}"),
        (far, VERMILION, "/", f"beyond {FAR:g}"),
    ):
        if which.any():
            drawn.append(
                plot.hbar(
                    y="called",
                    right="sigmas",
                    height=0.62,
                    source=data,
                    color=colour,
                    hatch_pattern=hatch,
                    hatch_color="white",
                    legend_label=label,
                    view=CDSView(filter=IndexFilter(np.flatnonzero(which).tolist())),
                )
            )
    if (~known).any():
        drawn.append(
            plot.scatter(
                "sigmas",
                "called",
                source=data,
                size=7,
                marker="x",
                color=GREY,
                legend_label="no standard deviation",
                view=CDSView(filter=IndexFilter(np.flatnonzero(~known).tolist())),
            )
        )
    hover = [("", "@called"), ("change", "@change"), ("", "@said"), ("", "@remark")]
    plot.add_tools(HoverTool(tooltips=hover, renderers=drawn))
    plot.legend.orientation = "horizontal"
    plot.add_layout(plot.legend[0], "above")
    caption = "A cross has no standard deviation: the poses leave it open, or it was held."
    words = f"Changes of the parameters in standard deviations. {caption}"
    details = {"called": "{}", "change": "{}", "said": "{}", "remark": "{}"}
    return Picture("parameters-bars", plot, words, caption, details=details,
                   invitation="Select a parameter to see its change.")  # fmt: skip


def _table_of_parameters(case: Case, each: Parameters, folded: bool) -> Table:
    names, unit, scale = shown_in(each)
    said = remarks(each)
    rows = tuple(
        (
            str(names[row]),
            str(unit[row]),
            *(_signed(value[row] * scale[row], "") for value in (each.first, each.second)),
            _signed(each.difference[row] * scale[row], "+"),
            f"{each.std[row] * scale[row]:.4f}" if np.isfinite(each.std[row]) else "-",
            f"{each.sigmas[row]:+.1f}" if np.isfinite(each.sigmas[row]) else "-",
            str(said[row]),
        )
        for row in range(len(names))
    )
    heads = ("parameter", "unit", *case.names, "difference", "std", "in std", "remark")
    caption = "Parameters of both, and their difference"
    return Table(caption, heads, rows, numeric=frozenset(range(2, 7)), folded=folded)


def _signed(value: float, sign: str) -> str:
    """Four digits after the point, and no minus before a zero."""
    return f"{round(float(value), 4) + 0.0:{sign}.4f}"
