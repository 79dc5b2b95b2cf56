"""Sections of a data set's page on its history, its accuracy map, the study and the paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from kinacc.config.error_models import model_name
from kinacc.figures import fig4, history_over_time, iterations
from kinacc.figures.truth import FOOTNOTE, OF_MODELS
from kinacc.kinematics.robot import Robot
from kinacc.report import charts
from kinacc.report.history_lines import sentence
from kinacc.report.page import Part, records
from kinacc.tables.allowed import VERDICTS
from kinacc.tables.columns import Columns

_LARGEST = 10
_DIFFERS = VERDICTS[1]
_STATISTICS = {"mean": "mean", "max": "largest", "gamma99": "99 % gamma"}
_PARAMETERS = ("theta_offset", "d", "a", "alpha")
_EXAMPLES = {
    "rejected": "Fig. 5: the bound is rejected",
    "rejected_larger_eta": "the same readings, a slightly larger bound",
    "not_rejected": "Fig. 6: the bound is not rejected",
}
Tables = Mapping[str, Columns]


def history(tables: Tables, robot: Robot) -> Part:
    """The history of the robot, one row a data set of its series."""
    table = tables["history"]
    rows = [
        each | {"called": model_name(str(each["model"]))}
        | ({"remark": each["reason"]} if each["reason"] else {})
        for each in records(table)
    ]  # fmt: skip
    values = {"rows": rows, "sentence": sentence(table)}
    return Part("history", values, figures={"history": history_over_time.draw(table)})


def accuracy_map(tables: Tables, robot: Robot) -> Part:
    """The cells of ``accuracy_map``."""
    table = pd.DataFrame(dict(tables["accuracy_map"]))
    joints = [name for name in table if name[:1] == "q" and name[1:].isdigit()]
    slides = robot.dh.prismatic
    degrees = table[joints].to_numpy() * np.where(slides, 1.0, 180.0 / np.pi)[: len(joints)]
    reached = (table["solutions"] > 0).to_numpy()
    cells = pd.DataFrame(
        {
            "slice": [f"{each:g} deg" for each in table["slice_deg"]],
            "radius": table["radius_mm"],
            "height": table["height_mm"],
            "position": table["position_max_mm"],
            "orientation": table["orientation_max_mrad"],
            "reached": 100.0 * table["solutions"] / table["wanted"],
            "pose": [each or "" for each in table["worst_branch"]],
            "joints": [
                ", ".join(f"{each:.1f}" for each in row) if known else ""
                for row, known in zip(degrees, reached, strict=True)
            ],
        }
    )
    largest = cells.dropna(subset="position").sort_values(
        "position", ascending=False, kind="stable"
    )
    beyond = ~reached & (table["extrapolating"] > 0).to_numpy()
    values = {
        "cells": len(cells),
        "slices": list(dict.fromkeys(cells["slice"])),
        "spans": {name: (cells[name].min(), cells[name].max()) for name in ("radius", "height")},
        "wanted": int(table["wanted"].max()),
        "unreached": int((~reached).sum()),
        "beyond": int(beyond.sum()),
        "slides": any(slides),
        "largest": largest[:_LARGEST].to_dict("records"),
    }
    size = (_step(cells["radius"]), _step(cells["height"]))
    return Part("map", values, charts={"map": charts.accuracy_map(cells, *size)})


def _step(values: pd.Series, alone_mm: float = 25.0) -> float:
    """Distance of neighbouring grid values."""
    levels = np.unique(np.round(values, 3))
    return float(np.diff(levels).min()) if len(levels) > 1 else alone_mm


@dataclass(frozen=True)
class Truth:
    """The largest error of the study's points in mm, and its origin: known or taken as true."""

    largest_mm: float
    what: str
    footnote: str | None

    @property
    def called(self) -> str:
        """Its name in pictures and tables."""
        return "largest error, taken as true" if self.footnote else "true largest error"


def truth(tables: Tables) -> Truth:
    """The error that the study holds assessors to, of ``assessment_points``."""
    points, measurements = tables["assessment_points"], tables["measurements"]
    largest = float(np.max(points["true_error_mm"]))
    names = [name for name in points if name[:1] == "q" and name[1:].isdigit()]
    measured = set(zip(*(np.asarray(measurements[name]).tolist() for name in names), strict=True))
    wanted = zip(*(np.asarray(points[name]).tolist() for name in names), strict=True)
    if all(each in measured for each in wanted):
        what = "held-out errors of DH at measured poses, which contain the instrument's noise"
        return Truth(largest, what, FOOTNOTE)
    if np.isfinite(np.asarray(measurements["row"], dtype=float)).any():
        return Truth(largest, "VEC minus DH of this arm: of models, not measured", OF_MODELS)
    return Truth(largest, "VEC minus DH of the synthetic arm: known exactly", None)


def study(tables: Tables, robot: Robot) -> Part:
    """``study_summary`` and ``study``, held to ``truth``."""
    summary, runs, held_to = tables["study_summary"], tables.get("study"), truth(tables)
    rows = [each | {"label": str(each["assessor"]).replace("_", " ")} for each in records(summary)]
    for row in rows if runs else ():
        mine = (runs["assessor"] == row["assessor"]) & (runs["noise_mm"] == row["noise_mm"])
        stated = runs["assessed_mm"][mine]
        row["too_small"] = f"{np.sum(stated < held_to.largest_mm)} of {len(stated)}"
    values = {
        "points": len(tables["assessment_points"]["point"]),
        "levels": len(np.unique(summary["noise_mm"])),
        "truth": held_to,
        "rows": rows,
    }
    figure = fig4.draw(summary, true_accuracy_mm=held_to.largest_mm, taken_as_true=held_to.footnote)
    return Part("study", values, figures={"noise": figure})


def histories(tables: Tables, robot: Robot) -> Part:
    """``histories`` reading by reading: the simulations of Figs. 5 and 6."""
    table, held_to = tables["histories"], truth(tables)
    every = pd.DataFrame(dict(table)).sort_values("iteration", kind="stable")
    outcomes, figures = [], {}
    names = list(dict.fromkeys([*_EXAMPLES, *every["example"]]))
    for name in names:
        rows = every[every["example"] == name]
        if rows.empty:
            continue
        called = _EXAMPLES.get(name, name.replace("_", " "))
        final = rows.iloc[-1].to_dict()
        beyond = final["rejection_probability"] > final["alpha"]
        found = {
            "called": called,
            "outcome": "rejected" if beyond else "not rejected",
            "points": rows["point"].nunique(),
            "repeats": int((rows["repeat"] > 1).sum()),
        }
        if not final["rule_met"]:
            found["remark"] = f"the nearest there is: {final['rule']}"
        outcomes.append(final | found)
        figures[called] = iterations.draw(
            table, example=name, true_accuracy_mm=held_to.largest_mm,
            taken_as_true=held_to.footnote,
        )  # fmt: skip
    values = {
        "truth": held_to,
        "outcomes": outcomes,
        "readings": int((every["example"] == every["example"].iloc[0]).sum()),
        "noise_mm": every["noise_mm"].iloc[0],
    }
    return Part("histories", values, figures=figures)


def paper_tables(tables: Tables, robot: Robot) -> Part:
    """Tables I to III, as ``claims`` holds them beside the paper's."""
    known = {each["claim"]: each for each in records(tables["claims"])}
    values: dict[str, object] = {
        table: [
            _row(f"{what}, {unit}", known, f"{table}_{what}_{{}}", _STATISTICS)
            for what, unit in (("position", "mm"), ("orientation", "mrad"))
        ]
        for table in ("table1", "table3")
    }
    values["table2"] = [
        _row(joint, known, f"table2_{{}}_{joint}", _PARAMETERS)
        for joint in range(1, 1 + sum(name.startswith("table2_alpha_") for name in known))
    ]
    values |= {"statistics": _STATISTICS, "apart": known["table2_d_2_minus_d_3"]}
    return Part("paper-tables", values)


def _row(first: object, known: Mapping[str, dict], pattern: str, names: Iterable[str]) -> dict:
    """Pairs of the paper's number and the one here; the remark names those that differ."""
    found = {name: known[pattern.format(name)] for name in names}
    row: dict[str, object] = {"of": first}
    for name, claim in found.items():
        row |= {f"{name}_paper": claim["paper"], f"{name}_here": claim["reproduced"]}
    differs = [name for name, claim in found.items() if claim["verdict"] == _DIFFERS]
    if differs:
        words = ", ".join(_STATISTICS.get(name, name.partition("_")[0]) for name in differs)
        row["remark"] = f"{words} differs"
    return row


def claims(tables: Tables, robot: Robot) -> Part:
    """Every row of ``claims``, those that differ first."""
    table = tables["claims"]
    chose = np.asarray(table["used_to_choose"], dtype=bool)
    verdicts = list(table["verdict"][~chose])
    counts = ", ".join(f"{verdicts.count(name)} {name}" for name in VERDICTS)
    counted = f"{len(verdicts)} claims: {counts}"
    if chose.any():
        counted += f" ({chose.sum()} that chose a reading are not counted)"
    return Part("claims", {"claims": records(table), "counted": counted})
