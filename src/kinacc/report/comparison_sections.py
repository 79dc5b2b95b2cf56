"""Sections of a page that compares calibrations: how far poses moved, where, and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from bokeh.models import CDSView, IndexFilter
from bokeh.models.annotations import BoxAnnotation, Span

from kinacc.deployment.compare import Difference, Shift
from kinacc.report import pictures
from kinacc.report.page import Control, Option, Part, Picture
from kinacc.report.pictures import BLUE, GREEN, GREY, ORANGE, VERMILION

_MOST_POSES = 6_000  # drawn one by one; of more every n-th is, and all of the largest
_WORST = 10
_STEPS = 200  # of the distribution
_QUANTILES = {"50%": 0.5, "90%": 0.9, "99%": 0.99, "all": 1.0}
FAR = 3.0  # standard deviations
REMARKS = pd.Series({
    "": "",
    "first": "undetermined in the first",
    "second": "undetermined in the second",
    "both": "undetermined in both",
})  # fmt: skip
SHIFTS = {  # label, colour, marker and dash
    "plain": ("as they stand", ORANGE, "triangle", "solid"),
    "apart": ("after the best base and tool", GREEN, "circle", "dashed"),
}


@dataclass(frozen=True)
class Case:
    """A comparison at poses: joints (n, k) as shown, positions (n, 3) by the first calibration.

    ``number`` (n,) are those of the poses among all given.
    """

    found: Difference
    number: np.ndarray
    joints: np.ndarray
    slides: np.ndarray
    position_mm: np.ndarray

    @property
    def shifts(self) -> Mapping[str, Shift]:
        """How poses moved, by what is done with base and tool."""
        return {"plain": self.found.as_they_stand, "apart": self.found.apart_from_frames}


def moved(case: Case) -> Part:
    """How far poses moved: the distribution of the shifts."""
    rows = []
    for label, share in _QUANTILES.items():
        row: dict = {"share": label}
        for key, shift in case.shifts.items():
            row[f"{key}_mm"] = np.quantile(shift.position_mm, share)
            row[f"{key}_mrad"] = 1e3 * np.quantile(shift.orientation_rad, share)
        rows.append(row)
    chance = any(shift.chance_mm > 0.0 for shift in case.shifts.values())
    values = {"poses": len(case.joints), "quantiles": rows, "chance": chance}
    return Part("moved", values, (_distribution(case),))


def _distribution(case: Case) -> Picture:
    share = np.linspace(0.0, 1.0, _STEPS + 1)
    columns = {"share": 100.0 * share}
    for key, shift in case.shifts.items():
        columns[f"{key}_mm"] = np.quantile(shift.position_mm, share)
        columns[f"{key}_mrad"] = 1e3 * np.quantile(shift.orientation_rad, share)
    data = pictures.source("distribution", columns)
    plot = pictures.figure("change of position, mm", "poses that moved no more, %")
    sets: dict[str, list] = {
        unit: [("moved-axis", "axis_label", f"change of {of}, {unit}")]
        for of, unit in (("position", "mm"), ("orientation", "mrad"))
    }
    for key, (label, colour, _, dash) in SHIFTS.items():
        line = plot.line(
            f"{key}_mm", "share", source=data, line_color=colour, line_dash=dash, line_width=2,
            legend_label=label,
        )  # fmt: skip
        line.glyph.name = f"moved-{key}"
        sizes = f"@{key}_mm{{0.000}} mm, @{key}_mrad{{0.000}} mrad"
        pictures.hover(plot, [("", f"@share{{0}} % {label}"), ("no more than", sizes)], line)
        shift = case.shifts[key]
        chance = {"mm": shift.chance_mm, "mrad": 1e3 * shift.chance_rad}
        for unit, of_unit in sets.items():
            of_unit.append((line.glyph.name, "x", pictures.field(f"{key}_{unit}")))
            if chance["mm"] > 0.0:
                of_unit.append((f"moved-chance-{key}", "location", chance[unit]))
        if chance["mm"] > 0.0:
            place = Span(
                dimension="height", location=chance["mm"], line_color=colour,
                line_dash="dotted", line_width=2, name=f"moved-chance-{key}",
            )  # fmt: skip
            plot.add_layout(place)
    plot.xaxis[0].name = "moved-axis"
    plot.x_range.update(start=0.0)
    pictures.legend_above(plot)
    labels = zip(("position", "orientation"), sets.values(), strict=True)
    options = tuple(Option(label, tuple(each)) for label, each in labels)
    return Picture("distribution", plot, controls=(Control("Quantity", options),))


def where(case: Case) -> Part:
    """Where poses moved: over joints and in space."""
    largest = np.argsort(-case.found.apart_from_frames.position_mm, kind="stable")[:_WORST]
    count = len(case.joints)
    drawn = np.union1d(np.arange(0, count, -(-count // _MOST_POSES)), largest)
    joints = {f"q{n + 1}": joint for n, joint in enumerate(case.joints.T)}
    sizes = {f"{key}_mm": shift.position_mm for key, shift in case.shifts.items()}
    sizes |= {f"{key}_mrad": 1e3 * shift.orientation_rad for key, shift in case.shifts.items()}
    words = np.where(case.found.measured, "both were measured there", "not measured by both there")
    columns = {
        **{"number": case.number, **sizes, **joints},
        **dict(zip("xyz", case.position_mm.T, strict=True)),
        "standing": words.astype(object),
    }
    data = pictures.source("poses", {name: each[drawn] for name, each in columns.items()})
    hover = [
        ("pose", "@number"),
        *(
            (label, f"@{key}_mm{{0.000}} mm, @{key}_mrad{{0.000}} mrad")
            for key, (label, *_) in SHIFTS.items()
        ),
        ("", "@standing"),
    ]
    details = {"number": "pose {}"}
    for key, (label, *_) in SHIFTS.items():
        details |= {f"{key}_mm": f"{label} {{}} mm", f"{key}_mrad": "{} mrad"}
    details |= {name: f"J{name[1:]} {{}}" for name in joints} | {"standing": "{}"}
    series = [
        (f"{key}_mm", label, colour, marker, 0.6 if key == "apart" else 0.0)
        for key, (label, colour, marker, _) in SHIFTS.items()
    ]
    change = "change of position, mm"
    top = float(np.max(sizes["apart_mm"][drawn])) or 1.0
    plots = {
        "over-joint": pictures.over_joint("over", data, case.slides, series, change, hover),
        "space": pictures.in_space("space", data, "apart_mm", top, "moved, mm", hover),
    }
    invitation = "Select a pose to see its shifts."
    rows = [
        {name: each[row] for name, each in columns.items()} | {"pick": pick}
        for row, pick in zip(largest, np.searchsorted(drawn, largest).tolist(), strict=True)
    ]
    values = {
        "poses": count,
        "drawn": len(drawn),
        "largest": rows,
        "slides": case.slides.tolist(),
        "first": case.found.names[0],
    }
    return Part(
        "where",
        values,
        tuple(
            Picture(key, plot, controls=(control,), details=details, invitation=invitation)
            for key, (plot, control) in plots.items()
        ),
    )


def parameters(found: Difference, table: pd.DataFrame) -> Part:
    """The parameters of both, in standard deviations of their difference."""
    columns = {name: table[name].to_numpy() for name in table}
    columns |= {
        "called": columns["name"],
        "remarks": REMARKS.loc[columns["undetermined"]].to_numpy(),
    }
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    known = bool(np.isfinite(columns["sigmas"]).any())
    values = {"rows": rows, "names": found.names, "known": known, "far": FAR}
    return Part("changes", values, (_bars(columns),) if known else ())


def _bars(columns: Mapping[str, np.ndarray]) -> Picture:
    sigmas, known = columns["sigmas"], np.isfinite(columns["sigmas"])
    said = {
        "said": [f"{s:+.1f} standard deviations" if np.isfinite(s) else "no standard deviation"
                 for s in sigmas],
        "change": [f"{c:+.4f} {u}"
                   for c, u in zip(columns["difference"], columns["unit"], strict=True)],
        "remark": [each or "determined in both" for each in columns["remarks"]],
    }  # fmt: skip
    texts = {name: np.array(each, dtype=object) for name, each in said.items()}
    names = columns["called"]
    shown = {"called": names, "sigmas": np.where(known, sigmas, 0.0), **texts}
    data = pictures.source("parameters", shown)
    plot = pictures.figure(
        "change, standard deviations", "", height_px=90 + 19 * len(names),
        y_range=[str(name) for name in names[::-1]],
        hover=[("", "@called"), ("change", "@change"), ("", "@said"), ("", "@remark")],
    )  # fmt: skip
    plot.add_layout(BoxAnnotation(left=-FAR, right=FAR, fill_color=GREY, fill_alpha=0.15))
    far = known & (np.abs(sigmas) > FAR)
    for which, colour, hatch, label in (
        (known & ~far, BLUE, " ", f"within {FAR:g}"),
        (far, VERMILION, "/", f"beyond {FAR:g}"),
        (~known, GREY, None, "no standard deviation"),
    ):
        if not which.any():
            continue
        view = CDSView(filter=IndexFilter(np.flatnonzero(which).tolist()))
        look = {"source": data, "color": colour, "legend_label": label, "view": view}
        if hatch is None:
            plot.scatter("sigmas", "called", size=7, marker="x", **look)
        else:
            bar = {"hatch_pattern": hatch, "hatch_color": "white", "height": 0.62}
            plot.hbar(y="called", right="sigmas", **bar, **look)
    pictures.legend_above(plot, 3)
    details = {"called": "{}", "change": "{}", "said": "{}", "remark": "{}"}
    invitation = "Select a parameter to see its change."
    return Picture("parameters-bars", plot, details=details, invitation=invitation)
