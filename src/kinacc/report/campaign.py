"""A measuring campaign: a section of a data set's report, a page and a text of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
import pandas as pd

from kinacc.assess.conformity import ACCEPT, REJECT
from kinacc.campaign import consistency, folder, report
from kinacc.campaign.folder import Opened
from kinacc.campaign.state import State
from kinacc.campaign.status import Bound, CampaignStatus, assumptions, percent, status
from kinacc.config.error_models import model_name
from kinacc.figures import campaign as drawing
from kinacc.report.page import FirstScreen, Page, Part, Table
from kinacc.report.rendering import environment
from kinacc.tables.columns import Columns

_VERDICTS = {ACCEPT: "MODEL WITHIN", REJECT: "MODEL BEYOND"}
_LARGEST, _MOST_ROWS = 10, 300


def section(opened: Opened, state: State, tables: Mapping[str, Columns]) -> Part:
    """Return a campaign as a section of a page, from the tables of ``campaign.report.tables``."""
    found, limits = status(opened, state), state.plan.limits
    points = pd.DataFrame(dict(tables["campaign_points"]))
    readings = pd.DataFrame(dict(tables["campaign_readings"]))
    measured = points.dropna(subset="error_mm").sort_values(
        "error_mm", ascending=False, kind="stable"
    )
    figures = {}
    if len(readings):
        figures["bounds"] = drawing.draw(
            tables["campaign_points"],
            tables["campaign_bounds"],
            len(state.plan.route),
            limits.tolerance_mm,
            found.calibration,
        )
        figures["readings"] = drawing.readings(tables["campaign_readings"], limits.tolerance_mm)
    values = {
        "status": found,
        "candidates": _population(found, state),
        "bounds": [_row(each) for each in found.bounds],
        "largest": measured[:_LARGEST].to_dict("records"),
        "every": measured[:_MOST_ROWS].to_dict("records"),
        "measured": len(measured),
        "left_out": [{"point": name, "reason": why} for name, why in found.left_out.items()],
        "struck": readings[readings["struck"].notna()].to_dict("records"),
        "instruments": _instruments(found, state, readings),
        "assumptions": assumptions(found, state.plan),
        "facts": [{"topic": k, "fact": text} for k, text in report.facts(opened, state).items()],
    }
    return Part("campaign", values, figures=figures)


def markdown(opened: Opened, state: State, tables: Mapping[str, Columns], picture: str) -> str:
    """Return the report as text, with the values of the page."""
    values = section(opened, state, tables).values
    return (
        environment(is_page=False)
        .get_template("campaign.md")
        .render({**values, "picture": picture})
    )


def campaign_page(opened: Opened, state: State, tables: Mapping[str, Columns]) -> Page:
    """Return the page of a campaign, from the tables of ``campaign.report.tables``."""
    found = status(opened, state)
    main = found.bound
    answers = [found.headline, *(each for each in (main.text, found.assumes) if each)]
    answers.append("This is the error of the model at these poses; the robot is not changed.")
    columns = [["largest error at", "about"], ["at most", "upper_mm", ".3f"],
               ["estimate", "value_mm", ".3f"], ["at least", "lower_mm", ".3f"],
               ["confidence of each bound", "sure"]]  # fmt: skip
    if main.tolerance_mm is not None:
        columns.append([f"tolerance {main.tolerance_mm:g} mm", "verdict"])
    rows = [_row(each) | ({"sure": ""} if found.against else {}) for each in found.bounds]
    first = FirstScreen(
        f"Largest error of the {model_name(found.model)} model of {found.robot}",
        f"calibration {found.calibration}, {found.point}; {found.progress}",
        _badge(found),
        list(dict.fromkeys(answers)),
        [Table("The largest error, mm", rows, columns)],
        {
            "CHECK": [*folder.doubts(opened), *found.against[1:], *found.overruled],
            "NOTES": found.notes,
            "VALID": [f"for {_population(found, state)}, not for other poses"],
            "NEXT": _next(found),
        },
    )
    return Page(
        first,
        [section(opened, state, tables)],
        {name: str(value) for name, value in folder.marks_of(opened).items()},
    )


def _badge(found: CampaignStatus) -> tuple[str, bool]:
    main = found.bound
    if found.against:
        return found.headline.partition(":")[0], True
    if main.verdict in _VERDICTS:
        return f"{_VERDICTS[main.verdict]} {main.tolerance_mm:g} mm", main.verdict != ACCEPT
    if np.isnan(main.upper_mm):
        return "NO BOUND YET", True
    return ("tolerance: none set", False) if main.tolerance_mm is None else ("UNDECIDED", True)


def _row(bound: Bound) -> dict:
    """A bound as a row of a table."""
    sure = percent(bound.confidence) if np.isfinite(bound.confidence) else ""
    return {**asdict(bound), "about": bound.about, "sure": sure, "text": bound.text}


def _instruments(found: CampaignStatus, state: State, readings: pd.DataFrame) -> list[dict]:
    """Readings by instrument, and the scatter of repeats over the stated noise."""
    apart = readings["reading"].map(consistency.deviations(state))
    struck, used = readings["struck"].notna(), readings["used"].notna()
    rows = []
    for name, noise in found.noise.items():
        of_instrument = readings["instrument"] == name
        sizes, repeats = readings["error_mm"][of_instrument & used], apart[of_instrument].dropna()
        rows.append(
            {
                "name": name,
                "noise": noise,
                "used": len(sizes),
                "waiting": int((of_instrument & ~struck & ~used).sum()),
                "struck": int((of_instrument & struck).sum()),
                "mean": sizes.mean(),
                "largest": sizes.max(),
                "repeats": len(repeats),
                "scatter": np.sqrt(np.mean(repeats.astype(float) ** 2)),
            }
        )
    return rows


def _population(found: CampaignStatus, state: State) -> str:
    return f"these {found.candidates} candidates ({state.plan.about['candidates']})"


def _next(found: CampaignStatus) -> Sequence[str]:
    """What to do now; commands stand alone."""
    verdict = found.bound.verdict
    if found.against:
        return found.advice or (
            "Check whether something moved; begin a new campaign with the noise as it is.",
        )
    if found.next_point is not None:
        done = "The tolerance is decided; more readings narrow the bounds."
        text = f"Measure point {found.next_point}."
        return (*([done] if verdict in _VERDICTS else []), text, found.next_command)
    texts = {
        "": "Nothing is left to measure.",
        ACCEPT: "Nothing: the tolerance is kept at these candidates.",
        REJECT: "Calibrate with more poses or with another model, and begin a new campaign.",
    }
    more = "Begin a new campaign with a larger budget (kinacc campaign plan) and new candidates."
    return (texts.get(verdict, more),)
