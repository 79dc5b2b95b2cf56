"""A measuring campaign: a section of a data set's report, a page and a text of its own."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np
import pandas as pd

from kinacc import __version__
from kinacc.assess.statement import ACCEPT, REJECT
from kinacc.campaign import folder
from kinacc.campaign.folder import Opened
from kinacc.campaign.instrument import INSTRUMENT
from kinacc.campaign.plan import Plan
from kinacc.campaign.status import Bound, CampaignStatus, percent, status
from kinacc.config.error_models import model_name
from kinacc.figures.campaign import draw_bounds, draw_readings
from kinacc.report.page import FirstScreen, Page, Part, Table
from kinacc.report.rendering import environment, lines
from kinacc.tables.columns import Columns

_VERDICTS = {ACCEPT: "MODEL WITHIN", REJECT: "MODEL BEYOND"}
_LARGEST, _MOST_ROWS = 10, 300


def section(opened: Opened, tables: Mapping[str, Columns]) -> Part:
    """Return a campaign as a section of a page, from the tables of ``campaign.report.tables``."""
    summary, state, tolerance_mm = status(opened), opened.state, opened.plan.limits.tolerance_mm
    points = pd.DataFrame(tables["campaign_points"]).dropna(subset="error_mm")
    readings = pd.DataFrame(tables["campaign_readings"])
    measured = points.sort_values("error_mm", ascending=False, kind="stable")
    figures = {}
    if len(readings):
        growth = tables["campaign_points"], tables["campaign_bounds"], len(state.plan.route)
        figures["bounds"] = draw_bounds(*growth, tolerance_mm, summary.calibration)
        figures["readings"] = draw_readings(tables["campaign_readings"], tolerance_mm)
    values = {
        "status": summary,
        "candidates": _population(summary, opened.plan),
        "answers": lines("campaign_bounds.txt", s=summary),
        "bounds": [_row(bound) for bound in summary.bounds],
        "largest": measured[:_LARGEST],
        "every": measured[:_MOST_ROWS],
        "measured": len(measured),
        "left_out": [{"point": name, "reason": why} for name, why in summary.left_out.items()],
        "struck": readings[readings["struck"].notna()],
        "instruments": _instruments(summary, readings),
        "assumptions": lines(
            "assumptions.txt",
            status=summary,
            settings=defaultdict(int, vars(state.plan.assessor)),
            frames=any(device.frame == INSTRUMENT for device in state.plan.instruments),
            percent=percent,
        ),
        "facts": [
            dict(zip(("topic", "fact"), line.split(": ", 1), strict=True))
            for line in lines("campaign_facts.txt", **_facts(opened))
        ],
    }
    return Part("campaign", values, figures=figures)


def markdown(opened: Opened, tables: Mapping[str, Columns], picture: str) -> str:
    """The report as Markdown, with the values of the page.

    Parameters
    ----------
    opened, tables
        As for ``campaign_page``.
    picture
        Path of the picture of the bounds.

    Returns
    -------
    str
        Markdown.
    """
    values = section(opened, tables).rows()
    template = environment(is_page=False).get_template("campaign.md")
    return template.render({**values, "picture": picture})


def campaign_page(opened: Opened, tables: Mapping[str, Columns]) -> Page:
    """The page of a campaign.

    Parameters
    ----------
    opened
        The campaign.
    tables
        Its tables, as ``campaign.report.tables`` returns them.

    Returns
    -------
    Page
        Bounds and verdict, then readings, points, assumptions and origin.
    """
    summary = status(opened)
    main = summary.bound
    answers = lines("campaign_answers.txt", s=summary)
    columns = [["largest error at", "about"], ["at most", "upper_mm", ".3f"],
               ["estimate", "value_mm", ".3f"], ["at least", "lower_mm", ".3f"],
               ["confidence of each bound", "sure"]]  # fmt: skip
    if main.tolerance_mm is not None:
        columns.append([f"tolerance {main.tolerance_mm:g} mm", "verdict"])
    withheld = {"sure": ""} if summary.against else {}
    rows = [_row(bound) | withheld for bound in summary.bounds]
    first = FirstScreen(
        f"Largest error of the {model_name(summary.model)} model of {summary.robot}",
        lines("campaign_progress.txt", s=summary)[0],
        _badge(summary),
        list(dict.fromkeys(answers)),
        [Table("The largest error, mm", rows, columns)],
        {
            "CHECK": [*folder.doubts(opened), *summary.against[1:], *summary.overruled],
            "NOTES": summary.notes,
            "VALID": [f"for {_population(summary, opened.plan)}, not for other poses"],
            "NEXT": lines("campaign_next.txt", s=summary),
        },
    )
    marks = {name: str(value) for name, value in folder.marks_of(opened).items()}
    return Page(first, [section(opened, tables)], marks)


def _badge(summary: CampaignStatus) -> tuple[str, bool]:
    main = summary.bound
    if summary.against:
        return "BOUND IN DOUBT" if np.isfinite(main.upper_mm) else "NO BOUND", True
    if main.verdict in _VERDICTS:
        return f"{_VERDICTS[main.verdict]} {main.tolerance_mm:g} mm", main.verdict != ACCEPT
    if np.isnan(main.upper_mm):
        return "NO BOUND YET", True
    return ("tolerance: none set", False) if main.tolerance_mm is None else ("UNDECIDED", True)


def _row(bound: Bound) -> dict[str, object]:
    """A bound as a row of a table."""
    sure = percent(bound.confidence) if np.isfinite(bound.confidence) else ""
    return {**asdict(bound), "about": bound.about, "sure": sure}


def _instruments(summary: CampaignStatus, readings: pd.DataFrame) -> pd.DataFrame:
    """Readings by instrument."""
    rows = []
    for name, noise in summary.noise.items():
        taken = readings[readings["instrument"] == name]
        used, struck = taken["used"].notna(), taken["struck"].notna()
        rows.append(
            {
                "name": name,
                "noise": noise,
                "used": int(used.sum()),
                "waiting": int((~used & ~struck).sum()),
                "struck": int(struck.sum()),
                "mean": taken["error_mm"][used].mean(),
                "largest": taken["error_mm"][used].max(),
            }
        )
    return pd.DataFrame(rows)


def _facts(opened: Opened) -> dict[str, object]:
    """What was fixed and taken, as the template of facts takes it."""
    state = opened.state
    sizes = np.array([np.linalg.norm(item.error_mm) for item in state.used])
    return {
        "opened": opened,
        "state": state,
        "plan": state.plan,
        "settings": vars(state.plan.assessor),
        "large": int(np.sum(sizes > state.plan.limits.implausible_mm)),
        "files": {
            str(entry["file"]): entry.get("path")
            for entry in opened.journal.entries
            if "file" in entry
        },
        "version": __version__,
    }


def _population(summary: CampaignStatus, plan: Plan) -> str:
    return f"these {summary.candidates} candidates ({plan.about['candidates']})"
