"""A measuring campaign: a section of a data set's report, a page and a text of its own."""

from __future__ import annotations

from collections import defaultdict
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
from kinacc.report.page import Page, Part
from kinacc.report.rendering import environment, lines
from kinacc.tables.columns import Tables

_VERDICTS = {ACCEPT: "MODEL WITHIN", REJECT: "MODEL BEYOND"}
_LARGEST, _MOST_ROWS = 10, 300


def section(opened: Opened, tables: Tables) -> Part:
    """Return a campaign as a section of a page, from the tables of ``campaign.report.tables``."""
    summary, state, plan = status(opened), opened.state, opened.plan
    points, readings = (tables[f"campaign_{name}"] for name in ("points", "readings"))
    measured = pd.DataFrame(points).dropna(subset="error_mm")
    measured = measured.sort_values("error_mm", ascending=False, kind="stable")
    figures = {}
    if len(readings["reading"]):
        growth, tolerance_mm = tables["campaign_bounds"], plan.limits.tolerance_mm
        figures = {
            "bounds": draw_bounds(
                points, growth, len(plan.route), tolerance_mm, summary.calibration
            ),
            "readings": draw_readings(readings, tolerance_mm),
        }
    taken = pd.DataFrame(readings)
    sizes_mm = np.array([np.linalg.norm(item.error_mm) for item in state.used])
    facts = lines(
        "campaign_facts.txt",
        opened=opened,
        state=state,
        waiting=len(state.readings) - len(state.used),
        plan=plan,
        settings=vars(plan.assessor),
        large=int(np.sum(sizes_mm > plan.limits.implausible_mm)),
        files=dict.fromkeys(item.path for item in state.taken if item.path),
        version=__version__,
    )
    values = {
        "status": summary,
        "candidates": _population(summary, plan),
        "answers": lines("campaign_bounds.txt", s=summary),
        "bounds": [_row(bound) for bound in summary.bounds],
        "largest": measured[:_LARGEST],
        "every": measured[:_MOST_ROWS],
        "measured": len(measured),
        "left_out": [{"point": name, "reason": why} for name, why in summary.left_out.items()],
        "struck": taken[taken["struck"].notna()],
        "instruments": _instruments(summary, taken),
        "assumptions": lines(
            "assumptions.txt",
            status=summary,
            settings=defaultdict(int, vars(plan.assessor)),
            frames=any(device.frame == INSTRUMENT for device in plan.instruments),
            percent=percent,
        ),
        "facts": [dict(zip(("topic", "fact"), line.split(": ", 1), strict=True)) for line in facts],
    }
    return Part("campaign", values, figures=figures)


def markdown(part: Part, picture: str) -> str:
    """The section of a campaign as Markdown; ``picture`` is the path of that of the bounds."""
    template = environment(is_page=False).get_template("campaign.md")
    return template.render({**part.rows(), "picture": picture})


def campaign_page(opened: Opened, part: Part) -> Page:
    """The page of a campaign: bounds and verdict, then its section."""
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
    return Page(
        f"Largest error of the {model_name(summary.model)} model of {summary.robot}",
        lines("campaign_progress.txt", s=summary)[0],
        _badge(summary),
        list(dict.fromkeys(answers)),
        "The largest error, mm",
        rows,
        columns,
        {
            "CHECK": [*folder.doubts(opened), *summary.against[1:], *summary.overruled],
            "NOTES": summary.notes,
            "VALID": [f"for {_population(summary, opened.plan)}, not for other poses"],
            "NEXT": lines("campaign_next.txt", s=summary),
        },
        [part],
    )


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


def _population(summary: CampaignStatus, plan: Plan) -> str:
    return f"these {summary.candidates} candidates ({plan.about['candidates']})"
