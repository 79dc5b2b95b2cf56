"""Sections of a data set's page on its history, its accuracy map, the study and the paper."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from kinacc.calibration.summary import reported_joints
from kinacc.config.error_models import model_name
from kinacc.figures import history_over_time
from kinacc.figures.fig3 import cell_size
from kinacc.figures.paper import AT_MEASURED, OF_MODELS, draw_iterations, draw_noise, footnote
from kinacc.kinematics.robot import Robot
from kinacc.report import charts
from kinacc.report.page import Part
from kinacc.report.rendering import history_sentence
from kinacc.tables.allowed import VERDICTS
from kinacc.tables.columns import Tables

_LARGEST = 10
_DIFFERS = VERDICTS[1]
_STATISTICS = {"mean": "mean", "max": "largest", "gamma99": "99 % gamma"}
_OF_CELLS = {
    "radius_mm": "radius",
    "height_mm": "height",
    "position_max_mm": "position",
    "orientation_max_mrad": "orientation",
}
_PARAMETERS = {"theta_offset": "theta", "d": "d", "a": "a", "alpha": "alpha"}
_EXAMPLES = {
    "rejected": "Fig. 5: the bound is rejected",
    "rejected_larger_eta": "the same readings, a slightly larger bound",
    "not_rejected": "Fig. 6: the bound is not rejected",
}


def history(tables: Tables) -> Part:
    """The history of the robot, one row a data set of its series."""
    rows = pd.DataFrame(tables["history"])
    rows["called"], rows["remark"] = rows["model"].map(model_name), rows["reason"].fillna("")
    values = {"rows": rows, "sentence": history_sentence(rows)}
    figure = history_over_time.draw(tables["history"])
    return Part("history", values, figures={"history": figure})


def accuracy_map(tables: Tables, robot: Robot) -> Part:
    """The cells of ``accuracy_map``."""
    table = pd.DataFrame(tables["accuracy_map"])
    slides = robot.dh.prismatic
    joints = reported_joints(tables["accuracy_map"], len(slides))
    degrees = joints * np.where(slides, 1.0, 180.0 / np.pi)
    texts = [", ".join(f"{angle:.1f}" for angle in row) for row in degrees]
    reached = (table["solutions"] > 0).to_numpy()
    cells = (
        table[[*_OF_CELLS]]
        .rename(columns=_OF_CELLS)
        .assign(
            slice=table["slice_deg"].map("{:g} deg".format),
            reached=100.0 * table["solutions"] / table["wanted"],
            pose=table["worst_branch"].fillna(""),
            joints=np.where(reached, texts, ""),
        )
    )
    values = {
        "cells": len(cells),
        "slices": list(cells["slice"].unique()),
        "spans": {name: (cells[name].min(), cells[name].max()) for name in ("radius", "height")},
        "wanted": int(table["wanted"].max()),
        "unreached": int((~reached).sum()),
        "beyond": int((~reached & (table["extrapolating"] > 0)).sum()),
        "slides": bool(slides.any()),
        "largest": cells.dropna(subset="position").nlargest(_LARGEST, "position"),
    }
    size = [cell_size(np.unique(cells[name].round(3))) for name in ("radius", "height")]
    return Part("map", values, charts={"map": charts.accuracy_map(cells, *size)})


def truth(tables: Tables) -> dict[str, Any]:
    """The error that the study holds assessors to: its size in mm, its origin and its name."""
    note = footnote(tables)
    origins = {
        AT_MEASURED: "held-out errors of DH at measured poses, containing the instrument's noise",
        OF_MODELS: "VEC minus DH of this arm: of models, not measured",
        None: "VEC minus DH of the synthetic arm: known exactly",
    }
    return {
        "largest_mm": pd.Series(tables["assessment_points"]["true_error_mm"]).max(),
        "what": origins[note],
        "called": "largest error, taken as true" if note else "true largest error",
    }


def study(tables: Tables) -> Part:
    """``study_summary`` and ``study``, held to ``truth``."""
    summary, held_to = tables["study_summary"], truth(tables)
    rows = pd.DataFrame(summary)
    if "study" in tables:
        runs = pd.DataFrame(tables["study"])
        runs["small"] = runs["assessed_mm"] < held_to["largest_mm"]
        small = runs.groupby(["assessor", "noise_mm"])["small"].agg(["sum", "count"])
        texts = small["sum"].astype(str) + " of " + small["count"].astype(str)
        rows = rows.join(texts.rename("too_small"), on=["assessor", "noise_mm"])
    values = {
        "points": len(tables["assessment_points"]["point"]),
        "levels": rows["noise_mm"].nunique(),
        "truth": held_to,
        "rows": rows.assign(label=rows["assessor"].str.replace("_", " ")),
    }
    figure = draw_noise(summary, held_to["largest_mm"], footnote(tables))
    return Part("study", values, figures={"noise": figure})


def histories(tables: Tables) -> Part:
    """``histories`` reading by reading: the simulations of Figs. 5 and 6."""
    table, held_to, note = tables["histories"], truth(tables), footnote(tables)
    steps = pd.DataFrame(table).sort_values("iteration", kind="stable")
    final = steps.groupby("example").tail(1).set_index("example")
    final = final.loc[sorted(final.index, key=lambda name: [*_EXAMPLES, name].index(name))]
    beyond = final["rejection_probability"] > final["alpha"]
    names = final.index.to_series()
    called = names.map(_EXAMPLES).fillna(names.str.replace("_", " "))
    outcomes = final.assign(
        called=called,
        outcome=np.where(beyond, "rejected", "not rejected"),
        points=steps.groupby("example")["point"].nunique(),
        repeats=(steps["repeat"] > 1).groupby(steps["example"]).sum(),
        remark=("the nearest there is: " + final["rule"]).where(final["rule_met"] == 0, ""),
    )
    figures = {
        called[name]: draw_iterations(table, name, held_to["largest_mm"], note)
        for name in final.index
    }
    values = {
        "truth": held_to,
        "outcomes": outcomes,
        "readings": int((steps["example"] == steps["example"].iloc[0]).sum()),
        "noise_mm": steps["noise_mm"].iloc[0],
    }
    return Part("histories", values, figures=figures)


def paper_tables(tables: Tables) -> Part:
    """Tables I to III, as ``claims`` holds them beside the paper's."""
    known = pd.DataFrame(tables["claims"]).set_index("claim")
    values: dict[str, object] = {
        table: [
            _row(f"{quantity}, {unit}", known, f"{table}_{quantity}_{{}}", _STATISTICS)
            for quantity, unit in (("position", "mm"), ("orientation", "mrad"))
        ]
        for table in ("table1", "table3")
    }
    joints = known.index.str.startswith("table2_alpha_").sum()
    values["table2"] = [
        _row(joint, known, f"table2_{{}}_{joint}", _PARAMETERS) for joint in range(1, 1 + joints)
    ]
    values |= {"statistics": _STATISTICS, "apart": known.loc["table2_d_2_minus_d_3"]}
    return Part("paper-tables", values)


def _row(
    first: object, known: pd.DataFrame, pattern: str, names: Mapping[str, str]
) -> dict[str, object]:
    """Pairs of the paper's number and the one here; the remark names those that differ."""
    row: dict[str, object] = {"of": first}
    differing = []
    for name, text in names.items():
        claim = known.loc[pattern.format(name)]
        row |= {f"{name}_paper": claim["paper"], f"{name}_here": claim["reproduced"]}
        differing += [text] * (claim["verdict"] == _DIFFERS)
    return row | {"remark": f"{', '.join(differing)} differs" if differing else ""}


def claims(tables: Tables) -> Part:
    """Every row of ``claims``, those that differ first."""
    table = pd.DataFrame(tables["claims"])
    chose = table["used_to_choose"].astype(bool)
    counts = table["verdict"][~chose].value_counts().reindex(VERDICTS, fill_value=0).to_dict()
    return Part("claims", {"claims": table, "counts": counts, "chose": int(chose.sum())})
