"""The page of a data set: the answer, then the evidence, a section a subject."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinacc.campaign import folder as campaigns
from kinacc.campaign import report
from kinacc.deployment.folder import robot_of
from kinacc.report import campaign, fit_sections, study_sections, terminal
from kinacc.report.page import Page, Part
from kinacc.report.rendering import counted
from kinacc.report.summarise import summarise
from kinacc.report.summary import CalibrationSummary

_OF_THE_STUDY = (
    ("study_summary", study_sections.study),
    ("histories", study_sections.histories),
    ("claims", study_sections.paper_tables),
    ("claims", study_sections.claims),
)


def run(
    inputs: Mapping[str, Any], folder: str, left_out: Sequence[str] = (), outdated: str = ""
) -> Page:
    """The page on the tables that are there, and on the campaign of their calibration.

    ``folder`` of the results; ``left_out`` tables made from others than those now there;
    ``outdated``, why all results are.
    """
    files = {role: path for role, path in inputs.items() if isinstance(path, Path)}
    tables = {role: table for role, table in inputs.items() if role not in files}
    places = [path.parent for role, path in files.items() if role.startswith("campaign_")]
    summary, arm = summarise(folder, tables, places, outdated), robot_of(tables)
    sections = [study_sections.history(tables)] if "history" in tables else []
    sections.append(fit_sections.residuals(tables, summary))
    if "accuracy_map" in tables:
        sections.append(study_sections.accuracy_map(tables, arm))
    sections.append(fit_sections.data(tables, arm, summary))
    if "dh_covariance" in tables:
        sections.append(fit_sections.identifiability(tables, arm, summary))
    sections.append(fit_sections.parameters(tables, arm, summary))
    sections.append(fit_sections.selection(tables, summary))
    if summary.campaign is not None:
        opened = campaigns.open_(summary.campaign.folder)
        sections.append(campaign.section(opened, report.tables(opened)))
    sections += [make(tables) for needed, make in _OF_THE_STUDY if needed in tables]
    return page_of(summary, left_out, sections)


def page_of(summary: CalibrationSummary, left_out: Sequence[str], sections: Sequence[Part]) -> Page:
    """The answer, the errors before and after, and what is open; then the sections.

    ``left_out``: tables made from others than those now there.
    """
    errors = summary.error_table()
    columns = [["model", "model"], *([name, name, ""] for name in errors.columns[1:])]
    errors["remark"] = np.where(errors.index == summary.selected, "selected", "")
    where = "held-out" if summary.is_held_out else "fitted"
    count = counted(summary.best.n, "reading")
    about, *answers = terminal.headline(summary)
    steps = [text for item in summary.next_steps.items() for text in (f"{item[0]}:", item[1])]
    notes = {"Next": steps, **terminal.notes(summary, None)}
    problems = len(summary.open_findings)
    badge = f"DATA: {counted(problems, 'problem')}" if problems else "DATA: OK"
    if summary.synthetic:
        badge = "SYNTHETIC ARM"
    elif not summary.checked:
        badge = "DATA: not checked"
    if left_out:
        made = f"{', '.join(left_out)}: made from other tables than those here, so not shown"
        notes["Left out"] = [made, "kinacc check-results"]
    return Page(
        summary.name,
        about,
        (badge, not summary.synthetic and badge != "DATA: OK"),
        answers,
        f"Errors at the same {count} ({where}) for every model",
        errors.to_dict("records"),
        columns,
        notes,
        sections,
    )
